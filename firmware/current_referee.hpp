// Which of two current sensors is wrong, by the ohmic law of the model: a change of the current changes the voltage of
// the cells at once, by the series resistance.
//
//   e_i = sum (dv - r_i di_i)^2      dv, di_i: changes of the mean cell and of sensor i from sample to sample
//   r_i = sum dv di_i / sum di_i^2   at least 0; the sums forget with a time constant of 64 samples
//
// A sensor is wrong if its e is more than four times that of the other one, while the voltage has moved by more than
// its noise. A sensor that is stuck, saturated or reversed is named. One with a wrong gain or offset explains the
// changes as well as the other one, and is not: then nothing is known. The sensors average over different times, so e
// is not 0 for the right one either.
#pragma once

#include <cstdint>

#include "can_messages.hpp"  // generated from firmware/can/greybox_bms.dbc
#include "measurement/sample.hpp"

namespace bms::firmware {

class CurrentReferee {
 public:
  /// mean: of the cells. Call with every sample.
  void update(const measurement::Sample& mean, std::int32_t second_ua) {
    const bool known = mean.voltage_uv != measurement::no_reading && mean.current_ua != measurement::no_reading &&
                       second_ua != measurement::no_reading;
    if (known && known_) {
      const float dv = 1e-3F * static_cast<float>(mean.voltage_uv - voltage_uv_);
      forget(moved_, dv * dv);
      first_.add(dv, 1e-6F * static_cast<float>(mean.current_ua - first_ua_));
      second_.add(dv, 1e-6F * static_cast<float>(second_ua - second_ua_));
    }
    known_ = known;
    voltage_uv_ = mean.voltage_uv;
    first_ua_ = mean.current_ua;
    second_ua_ = second_ua;
  }

  /// can::TruckInputs::wrong_current_sensor_*, if the sensors contradict each other now.
  std::uint32_t verdict() const {
    using M = can::TruckInputs;
    constexpr float least_mv2 = 64 * 2 * 2, least_ratio = 4;  // 2 mV each sample
    if (moved_ < least_mv2) return M::wrong_current_sensor_not_known;
    const float first = first_.unexplained(moved_), second = second_.unexplained(moved_);
    if (first > least_ratio * second) return M::wrong_current_sensor_first;
    return second > least_ratio * first ? M::wrong_current_sensor_second : M::wrong_current_sensor_not_known;
  }

 private:
  static constexpr void forget(float& sum, float more) { sum += more - sum / 64; }

  struct Sums {
    float squares = 0, products = 0;

    constexpr void add(float dv, float di) {
      forget(squares, di * di);
      forget(products, dv * di);
    }
    constexpr float unexplained(float moved) const {
      const float left = products > 0 && squares > 0 ? moved - products * products / squares : moved;
      return left > 0.01F * moved ? left : 0.01F * moved;
    }
  };

  Sums first_, second_;
  float moved_ = 0;  ///< [mV^2]
  std::int32_t voltage_uv_ = 0, first_ua_ = 0, second_ua_ = 0;
  bool known_ = false;
};

}  // namespace bms::firmware
