// The functions of hal/ that the application calls, for tests on this machine. Variables hold what the application has
// sent, switched and recorded, and what it reads. The flash is in another file (hal/absent/flash.cpp or
// tests/firmware/storage/flash_model.hpp). Also: the application's Board with the cell table9.
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <optional>
#include <vector>

#include "firmware/application.hpp"
#include "hal/device_key.hpp"
#include "hal/insulation.hpp"
#include "hal/power.hpp"
#include "hal/power_path.hpp"
#include "hal/request_queue.hpp"
#include "hal/second_current.hpp"
#include "hal/truck_inputs.hpp"
#include "tests/cells.hpp"

namespace bms::host_hal {

inline bool listening = true;
inline std::vector<can::Frame> sent;
inline std::deque<can::Frame> requests;
inline hal::RequestQueue* queue = nullptr;  ///< used instead of `requests` if it is set
inline std::vector<std::vector<std::uint32_t>> recorded;
inline hal::PowerPath switched;
inline hal::LinkVoltages link_readings{0, 0};
inline hal::AuxiliaryContacts contacts;
inline hal::TruckInputs truck;
inline hal::Insulation insulation;
inline std::uint32_t truck_outputs = 0;
inline std::uint32_t second_line = 0;
inline hal::FrontEndHealth front_end;
inline bool second_current_sensor = false;  ///< is fitted
inline std::int32_t second_current_reading_ua = measurement::no_reading;
inline bool parked = false;
inline unsigned switched_off = 0;  ///< times
inline bool load_side_empty = true;
inline hal::ResetCause cause = hal::ResetCause::power_on;
inline std::optional<hal::FaultRecord> fault;
inline int fed = 0;
inline hal::BoardState board_state;
inline std::uint32_t supply_falls = 0, supply_acknowledged = 0;
inline std::optional<std::uint32_t> calendar;
inline std::array<std::uint32_t, hal::backup_words> backup{};
inline bool backup_supplied = true;  ///< the backup words can be written
inline hal::CanHealth can_health;
inline std::uint32_t calendar_was_set_to = 0;
inline bool calendar_accepts = true;
inline hal::SensorCalibration calibrated;
inline bool calibration_accepts = true;
inline int second_line_cleared = 0;
inline std::optional<std::array<std::uint8_t, 16>> key;  ///< of the device
inline bool development = true;
inline std::uint32_t random_seed = 1;  ///< 0: no random numbers

/// Resets all variables.
void begin();

/// Sets the readings of the DC link, with ideal contactors as commanded last.
void set_link(double pack_v, double dc_link_v);

/// The last sent frame of a message.
template <class Message>
std::optional<Message> last() {
  for (auto f = sent.rbegin(); f != sent.rend(); ++f) {
    if (f->id == Message::id) return Message::of(*f);
  }
  return std::nullopt;
}

inline std::uint32_t cell_hash = 0x5EEDCE11;  ///< of the cell file, where the application is compared with an image

/// The application's Board with the cell table9, except plan(), which the board of a test adds.
template <std::size_t Cells>
struct Table9Board {
  using Estimator = estimator::SocEstimator<float>;
  static constexpr std::size_t cells = Cells;

  static const auto& tables() {
    static const auto tables = model::prepare<float, model::max_intervals>(tests::table9);
    return tables;
  }
  static estimator::Estimate<float> step(Estimator& estimator, const measurement::Sample& sample) {
    return estimator.step(tables(), sample);
  }
  static std::uint64_t estimated_us(const Estimator& estimator) { return estimator.time_us(); }
  static void update_condition(estimator::Condition<Estimator>& condition, const Estimator& estimator,
                               const measurement::Sample& sample, const estimator::Estimate<float>& e,
                               bool limits_wanted) {
    condition.update(tables(), sample, e, estimator, limits_wanted);
  }
  static void update_cells(estimator::PackCells<float, Cells>& differences, const measurement::PackSample<Cells>& pack,
                           const estimator::Estimate<float>& e) {
    differences.update(tables(), pack, e);
  }
  static const model::PlausibleRange& plausible() { return tables().plausible; }
  static protection::PackDesign design(double sample_period_s) {
    return {.limits = tests::table9.limits,
            .capacity_ah = tests::table9.capacity_ah,
            .cells = Cells,
            .temperatures = Cells > 1 ? 4 : 1,
            .sample_period_s = sample_period_s};
  }
};

}  // namespace bms::host_hal
