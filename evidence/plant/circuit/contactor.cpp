#include "plant/circuit/contactor.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

namespace bms::plant {

double Contactor::draw_s(const TimeRange& range) {
  return range.least_s + random_.uniform() * (range.most_s - range.least_s);
}

void Contactor::set_coil_v(double coil_v) {
  coil_v_ = fault_ == ContactorFault::open_coil ? 0 : coil_v;
  const bool pulls_in = coil_v_ >= parameters_.pull_in_share * parameters_.rated_v;
  const bool drops_out =
      coil_v_ < parameters_.drop_out_share * parameters_.rated_v && fault_ != ContactorFault::no_drop_out;
  if (pulls_in && armature_ == Armature::open) {
    armature_ = Armature::closing;
    rest_s_ = slowness_ * draw_s(parameters_.closing);
  } else if (pulls_in && armature_ == Armature::opening) {
    armature_ = Armature::closed;
  } else if (!pulls_in && armature_ == Armature::closing) {
    armature_ = Armature::open;
  } else if (drops_out && armature_ == Armature::closed) {
    armature_ = Armature::opening;
    rest_s_ = slowness_ * draw_s(parameters_.opening);
  }
}

/// The contact closes, and opens and closes again once or several times until the bounce time is over.
void Contactor::touch() {
  armature_ = Armature::closed;
  touching_ = true;
  changes_ = 0;
  const double bounce_s = draw_s(parameters_.bounce);
  const std::size_t changes = 2 * (1 + static_cast<std::size_t>(random_.bits() % 3));
  bounce_s_.assign(changes, bounce_s);
  for (std::size_t k = 1; k < changes; ++k) bounce_s_[k] = bounce_s * random_.uniform();
  std::sort(bounce_s_.rbegin(), bounce_s_.rend());
}

double Contactor::next_change_s() const {
  double next_s = std::numeric_limits<double>::infinity();
  if (armature_ == Armature::closing || armature_ == Armature::opening) next_s = rest_s_;
  if (bouncing()) next_s = std::min(next_s, bounce_s_.back());
  return next_s;
}

void Contactor::advance(double duration_s) {
  constexpr double same_s = 1e-9;  // sums of steps differ by rounding
  const double target_a = fault_ == ContactorFault::open_coil ? 0 : coil_v_ / parameters_.coil_ohm;
  coil_a_ = target_a + (coil_a_ - target_a) / (1 + duration_s / parameters_.coil_time_constant_s);
  for (double& change_s : bounce_s_) change_s -= duration_s;
  while (bouncing() && bounce_s_.back() < same_s) {
    bounce_s_.pop_back();
    touching_ = !touching_;
    ++changes_;
  }
  if (armature_ != Armature::closing && armature_ != Armature::opening) return;
  rest_s_ -= duration_s;
  if (rest_s_ >= same_s) return;
  if (armature_ == Armature::closing) {
    touch();
    return;
  }
  armature_ = Armature::open;
  touching_ = false;
  bounce_s_.clear();
}

bool Contactor::closed() const {
  if (fault_ == ContactorFault::welded) return true;
  return touching_ && fault_ != ContactorFault::no_contact;
}

bool Contactor::auxiliary_closed() const {
  if (auxiliary_fault_ == AuxiliaryFault::stuck_open) return false;
  if (auxiliary_fault_ == AuxiliaryFault::stuck_closed || fault_ == ContactorFault::welded) return true;
  return fault_ != ContactorFault::no_contact && (touching_ || bouncing());
}

}  // namespace bms::plant
