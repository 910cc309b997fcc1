// What a battery in the field has stored, written by the firmware's own code on a model of flash, and whether it is
// still there.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "storage/persistence.hpp"
#include "tests/firmware/flash_controller_model.hpp"
#include "tests/firmware/storage/flash_model.hpp"

namespace bms::boot {

using Stored = firmware::FlashControllerModel;

inline constexpr std::uint16_t some_key = 0x7A, some_fault = 9;
inline constexpr std::int32_t some_value = -12'345;

inline void start_stored(storage::Persistence& p, FlashModel& model, const std::vector<std::uint8_t>& bytes) {
  for (std::uint32_t k = 0; k < Stored::sectors; ++k)
    model.fill(k, {bytes.begin() + k * Stored::sector_bytes, bytes.begin() + (k + 1) * Stored::sector_bytes});
  plug_in(&model);
  p.start(hal::ResetCause::power_on, std::nullopt, std::nullopt);
}

/// A record of each kind that an update must not lose.
inline std::vector<std::uint8_t> years_of_use() {
  FlashModel model({Stored::sectors, Stored::sector_bytes}, 1);
  storage::Persistence p;
  start_stored(p, model, std::vector<std::uint8_t>(Stored::sectors * Stored::sector_bytes, 0xFF));
  EXPECT_TRUE(p.set(some_key, some_value));
  p.observe({});
  p.fault(some_fault);
  p.action({.code = 3, .operator_number = 42, .argument = 7}, std::nullopt);
  measurement::Sample s;
  s.current_ua = 10'000'000;
  storage::EstimatorSnapshot now;
  now.pack = estimator::StoredEstimate{};
  now.pack->soc_ppb = 612'000'000;
  now.pack->soc_sigma_ppb = 20'000'000;
  for (int minute = 0; minute < 3; ++minute) {  // 10 A
    for (int k = 0; k < 61; ++k, s.time_us += 1'000'000) p.count(s);
    p.store(now, std::nullopt);
  }
  p.power_failing(now, std::nullopt);
  std::vector<std::uint8_t> all;
  for (std::uint32_t k = 0; k < Stored::sectors; ++k) std::ranges::copy(model.bytes(k), std::back_inserter(all));
  plug_in(nullptr);
  return all;
}

inline storage::ChargeRecord charge_in(const std::vector<std::uint8_t>& bytes) {
  FlashModel model({Stored::sectors, Stored::sector_bytes}, 1);
  storage::Persistence p;
  start_stored(p, model, bytes);
  plug_in(nullptr);
  return p.charge();
}

/// The charge before the interrupted write of records, and after it.
struct Charges {
  storage::ChargeRecord before, after;
};

inline void expect_nothing_lost(const std::vector<std::uint8_t>& bytes, const Charges& charges,
                                const std::string& when) {
  FlashModel model({Stored::sectors, Stored::sector_bytes}, 1);
  storage::Persistence p;
  start_stored(p, model, bytes);
  plug_in(nullptr);
  EXPECT_EQ(p.settings().get(some_key), some_value) << when;
  bool fault = false;
  for (std::uint32_t k = 0; k < storage::EventsRecord::max_faults; ++k)
    fault = fault || p.events().last(k).code == some_fault;
  EXPECT_TRUE(fault) << when;
  bool action = false;
  for (std::uint32_t k = 0; k < 16; ++k) action = action || p.actions().last(k).operator_number == 42;
  EXPECT_TRUE(action) << when;
  EXPECT_TRUE(p.charge() == charges.before || p.charge() == charges.after) << when;
}

}  // namespace bms::boot
