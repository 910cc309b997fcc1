// What the covariance of the filter costs on the board in three forms: the extended Kalman filter of the same equations
// with U-D factors and with Eigen's fixed-size matrices, a thousand steps each, for the instruction counter. Exit code
// 0: the three agree.
#include "cell_constants.hpp"
#include "estimator/ud_covariance.hpp"
#include "tests/estimator/eigen_covariance.hpp"
#include "tests/estimator/reference_filter.hpp"

namespace bms::firmware {

template <class Covariance>
using Filter = tests::ReferenceFilter<float, Covariance, false>;
using UdFilter = Filter<estimator::UdCovariance<float, 2>>;
using JosephFilter = Filter<tests::EigenCovariance<float, 2, tests::Form::joseph>>;
using PlainFilter = Filter<tests::EigenCovariance<float, 2, tests::Form::plain>>;

[[gnu::noinline, gnu::flatten]] float ud_step(UdFilter& filter, float current_a, float voltage_v) {
  return filter.step(generated::cell<float>, current_a, voltage_v, 1.0F);
}
[[gnu::noinline, gnu::flatten]] float eigen_joseph_step(JosephFilter& filter, float current_a, float voltage_v) {
  return filter.step(generated::cell<float>, current_a, voltage_v, 1.0F);
}
[[gnu::noinline, gnu::flatten]] float eigen_plain_step(PlainFilter& filter, float current_a, float voltage_v) {
  return filter.step(generated::cell<float>, current_a, voltage_v, 1.0F);
}

}  // namespace bms::firmware

int main() {
  using namespace bms;
  constexpr float first_soc = 0.77F, tolerance = 1e-4F;
  firmware::UdFilter ud(first_soc, 0.02F, 0.005F);
  firmware::JosephFilter joseph(first_soc, 0.02F, 0.005F);
  firmware::PlainFilter plain(first_soc, 0.02F, 0.005F);
  float soc = first_soc;
  for (int k = 0; k < 1'000; ++k) {
    const float current_a = k % 40 < 20 ? -5.0F : 1.0F;
    soc += current_a / (3'600 * 6);
    const auto at = model::look_up(generated::cell<float>, soc);
    const float voltage_v = at.ocv_v + (at.r0_ohm + at.r1_ohm) * current_a;
    const float a = firmware::ud_step(ud, current_a, voltage_v),
                b = firmware::eigen_joseph_step(joseph, current_a, voltage_v),
                c = firmware::eigen_plain_step(plain, current_a, voltage_v);
    if (!(arithmetic::magnitude(a - b) < tolerance && arithmetic::magnitude(a - c) < tolerance)) return 1;
  }
  return 0;
}
