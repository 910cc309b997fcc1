// Trusted instruments alongside: errors of the own instruments are read off, the cell is judged by the trusted
// readings.
#include "diagnosis/trusted_readings.hpp"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "diagnosis/diagnose.hpp"
#include "diagnosis/one_by_one.hpp"
#include "diagnosis/recording_check.hpp"
#include "diagnosis/reference.hpp"
#include "tests/inference/diagnosis/synthetic_recordings.hpp"

namespace bms::diagnosis {
namespace {

PreparedRecording healthy(std::uint64_t seed = 1) { return test::recorded(test::drive(0.5, seed), 0.8, seed); }

/// With trusted instruments that read what the own ones read now.
PreparedRecording with_references(PreparedRecording r) {
  r.current_ref_a = r.current_a;
  r.voltage_ref_v = r.voltage_v;
  return r;
}

const Finding* found(const Diagnosis& d, std::size_t mechanism) {
  for (const Finding& f : d.findings) {
    if (f.setting.index == mechanism) return &f;
  }
  return nullptr;
}

TEST(TrustedReadings, AGainThatTheCellCannotShowIsReadOff) {
  PreparedRecording r = with_references(healthy());
  for (double& a : r.current_a.edit()) a *= 0.993;
  const Diagnosis d = diagnose(test::table9(), {}, {r});
  EXPECT_EQ(d.verdict, Verdict::cause);
  const Finding* gain = found(d, model::mechanism_index_of<model::CurrentGain>);
  ASSERT_NE(gain, nullptr);
  EXPECT_NEAR(gain->setting.value[0], -0.007, 3e-4);
  EXPECT_LT(gain->setting.deviation[0], 1e-3);

  r.current_ref_a = {};
  EXPECT_EQ(diagnose(test::table9(), {}, {r}).verdict, Verdict::no_mismatch) << "without the ammeter it is not visible";
}

TEST(TrustedReadings, AContactAndAnOffsetAreDistinguished) {
  PreparedRecording r = with_references(healthy());
  for (std::size_t k = 0; k < r.size(); ++k) r.voltage_v.edit()[k] += 0.012 * r.current_a[k] + 0.015;
  const Diagnosis d = diagnose(test::table9(), {}, {r});
  EXPECT_EQ(d.verdict, Verdict::causes);
  const Finding *contact = found(d, model::mechanism_index_of<model::ContactStep>),
                *offset = found(d, model::mechanism_index_of<model::VoltageOffset>);
  ASSERT_NE(contact, nullptr);
  ASSERT_NE(offset, nullptr);
  EXPECT_NEAR(contact->setting.value[0], 0.012, 3e-4);
  EXPECT_NEAR(offset->setting.value[0], 0.015, 1e-3);
  EXPECT_EQ(d.findings.size(), 2U);
  EXPECT_LT(d.unexplained_rmse_v, 0.01);
  EXPECT_EQ(d.extended.sought().size(), static_cast<std::size_t>(d.covariance.rows()));
}

TEST(TrustedReadings, AContactIsNotInARecordingBeforeIt) {
  PreparedRecording later = with_references(healthy(2));
  for (std::size_t k = 0; k < later.size(); ++k) later.voltage_v.edit()[k] += 0.02 * later.current_a[k];
  const Diagnosis d = diagnose(test::table9(), {}, {healthy(1), later});
  ASSERT_NE(found(d, model::mechanism_index_of<model::ContactStep>), nullptr);
  ASSERT_EQ(d.views.size(), 2U);
  double first = 0, second = 0;
  for (std::size_t k = 0; k < d.views[0].base_v.size(); ++k) {
    first = std::max(first, std::abs(d.views[0].extended_v[k] - d.views[0].base_v[k]));
    second = std::max(second, std::abs(d.views[1].extended_v[k] - d.views[1].base_v[k]));
  }
  EXPECT_LT(first, 0.01);
  EXPECT_GT(second, 0.1);
}

TEST(TrustedReadings, AGainIsNotReadOffWhereNoCurrentFlows) {
  for (const double offset_a : {0.0, 0.02, 0.5}) {
    PreparedRecording r = test::recorded(std::vector<double>(1'800, 0.0), 0.8, 1);
    r.current_ref_a = std::vector<double>(r.size(), 0.0);  // the contactor is open
    for (double& a : r.current_a.edit()) a += offset_a;
    for (const InstrumentError& e : compare_instruments({r}, test::table9())) {
      EXPECT_EQ(e.setting.index, model::mechanism_index_of<model::CurrentOffset>) << offset_a;
      EXPECT_TRUE(std::isfinite(e.gain) && std::isfinite(e.setting.deviation[0]));
    }
  }
}

/// A finding with this mechanism, as its cause or a rival.
bool suspects(const Diagnosis& d, std::size_t mechanism) {
  return std::any_of(d.findings.begin(), d.findings.end(), [&](const Finding& f) {
    return f.setting.index == mechanism ||
           std::find(f.equivalent_to.begin(), f.equivalent_to.end(), mechanism) != f.equivalent_to.end();
  });
}

/// A drive with the own current sensor alone, and a later one with an ammeter. The cell gets less than the own sensor
/// reads: by the sensor's error, or by what flows inside the cell, where the ammeter does not read it either.
Diagnosis of_two_drives(bool inside_cell) {
  constexpr double less_a = 0.25;
  std::vector<PreparedRecording> records;
  for (const auto& [hours, seed] : {std::pair(2.0, 1U), std::pair(1.0, 2U)}) {
    std::vector<double> into_cell_a = test::drive(hours, seed);
    for (double& a : into_cell_a) a -= inside_cell ? less_a : 0;
    PreparedRecording& r = records.emplace_back(test::recorded(into_cell_a, 0.8, seed));
    const measurement::Column true_a = r.current_a;
    for (double& a : r.current_a.edit()) a += less_a;
    if (records.size() > 1) r.current_ref_a = inside_cell ? r.current_a : true_a;
  }
  return diagnose(test::table9(), {}, records);
}

TEST(TrustedReadings, AnAmmeterDecidesWhereTheMissingChargeOfAnEarlierRecordingGoes) {
  constexpr std::size_t offset = model::mechanism_index_of<model::CurrentOffset>,
                        leakage = model::mechanism_index_of<model::Leakage>;
  const Diagnosis outside = of_two_drives(false), inside = of_two_drives(true);
  EXPECT_NE(found(outside, offset), nullptr);
  EXPECT_FALSE(suspects(outside, leakage));
  EXPECT_NE(found(inside, leakage), nullptr) << name_of(inside.verdict);
  EXPECT_FALSE(suspects(inside, offset));
}

TEST(TrustedReadings, InstrumentsThatAgreeAreNotBlamed) {
  PreparedRecording r = with_references(healthy());
  for (std::size_t k = 0; k < r.size(); ++k) {
    r.voltage_v.edit()[k] += k % 2 == 0 ? 3e-4 : -3e-4;
    r.current_a.edit()[k] *= 1.001;
  }
  EXPECT_TRUE(compare_instruments({r}, test::table9()).empty());
  EXPECT_EQ(diagnose(test::table9(), {}, {r}).verdict, Verdict::no_mismatch);
}

TEST(TrustedReadings, AnAmmeterOfTheOtherSignIsADataFault) {
  PreparedRecording r = with_references(healthy());
  r.voltage_ref_v = {};
  r.voltage_v = std::vector<double>(r.size(), 3.3);  // says nothing of the sign
  for (std::size_t k = 0; k < r.size(); ++k) r.voltage_v.edit()[k] += 1e-3 * static_cast<double>(k % 3);
  for (double& a : r.current_a.edit()) a = -a;
  const Diagnosis d = diagnose(test::table9(), {}, {r});
  EXPECT_EQ(d.verdict, Verdict::data_fault);
  ASSERT_EQ(d.faults.size(), 1U);
  EXPECT_EQ(d.faults.front().id, "current_inverted");
}

TEST(TrustedReadings, AReferenceNowAndThenIsACheckAndNoMore) {
  PreparedRecording r = healthy();
  std::vector<double> sometimes(r.size(), std::nan(""));
  for (std::size_t k = 0; k < 100; ++k) sometimes[k] = r.current_a[k];
  average_references(r, sometimes, {}, test::table9());
  EXPECT_FALSE(have_trusted_readings({r}));
  EXPECT_FALSE(r.checks.empty());
  average_references(r, r.current_a.copy(), {}, test::table9());
  EXPECT_TRUE(have_trusted_readings({r}));
}

TEST(RecordingCheck, AVoltageThatFallsWithTheLoadIsNotADropout) {
  std::vector<double> profile(60, 0.0);
  profile.insert(profile.end(), 900, -12.0);
  profile.insert(profile.end(), 60, 0.0);
  const auto behind_a_contact = [](std::size_t, double a, double) { return 0.2 * a; };
  PreparedRecording drop = test::recorded(profile, 0.9, 3, behind_a_contact);
  ASSERT_LT(drop.voltage_v[500], 1.2);
  EXPECT_TRUE(check_recording(drop, test::table9()).faults.empty());
  EXPECT_TRUE(std::isfinite(drop.voltage_v[500])) << "such readings are used";

  PreparedRecording dropout = test::recorded(profile, 0.9, 3);
  for (std::size_t k = 200; k < 700; ++k) dropout.voltage_v.edit()[k] = 0.3;  // while the current stays
  EXPECT_EQ(check_recording(dropout, test::table9()).faults.front().id, "dropouts");
}

TEST(OneByOne, WhatOneRecordingShowsIsNotLost) {
  const std::vector<PreparedRecording> records = {healthy(1), healthy(2), healthy(3)};
  Diagnosis together;
  together.verdict = Verdict::unknown;
  together.cell = test::table9();
  const auto one = [&](const PreparedRecording& r) {
    Diagnosis d;
    d.cell = test::table9();
    d.verdict = Verdict::no_mismatch;
    d.extended = {{}, 0, {}};
    if (&r == &records.front() || r.voltage_v == records[0].voltage_v) return d;
    d.verdict = Verdict::cause;
    d.healthy = HealthyBasis{};
    d.base_cost = r.voltage_v == records[1].voltage_v ? 500 : 100;
    model::MechanismSetting contact = model::default_setting(model::mechanism_index_of<model::ContactStep>, d.cell);
    contact.value[0] = d.base_cost / 1e4;
    d.extended.settings = {contact};
    return d;
  };
  const Diagnosis d = likeliest_alone(together, test::table9(), {}, records, one);
  ASSERT_EQ(d.verdict, Verdict::cause);
  EXPECT_EQ(d.extended.settings.front().value[0], 0.05) << "of the recording with the larger gain";
  ASSERT_EQ(d.views.size(), 3U);
  EXPECT_EQ(d.views[0].extended_v, d.views[0].base_v) << "the contact is later than the first recording";
  EXPECT_NE(d.views[1].extended_v, d.views[1].base_v);
  EXPECT_EQ(d.warnings.size(), 1U);

  const auto none = [&](const PreparedRecording& r) { return one(r.name.empty() ? r : records.front()); };
  EXPECT_EQ(likeliest_alone(together, test::table9(), {}, records, none).verdict, Verdict::unknown);

  for (const bool compared : {true, false}) {
    const auto not_decided = [&](const PreparedRecording& r) {
      Diagnosis of = one(r);
      if (of.healthy) of.healthy->decided = false;
      if (!compared) of.healthy.reset();
      return of;
    };
    EXPECT_EQ(likeliest_alone(together, test::table9(), {}, records, not_decided).verdict, Verdict::unknown)
        << "at no known false alarm rate";
  }
}

}  // namespace
}  // namespace bms::diagnosis
