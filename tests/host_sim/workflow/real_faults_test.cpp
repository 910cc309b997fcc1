// Large faults in real recordings, where a fit that begins far from its minimum ends in another one. They need
// recordings that are not in the repository.
#include <algorithm>
#include <filesystem>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "workflow/diagnose_recordings.hpp"
#include "workflow/identify_cell.hpp"

namespace bms::workflow {
namespace {

const std::filesystem::path data = std::filesystem::path(BMS_DATA_DIR) / "nasa_18650";

/// The cell file from recordings before or after the one that is diagnosed.
files::CellFile identified(const std::string& cell, const std::vector<std::string>& healthy, double capacity_ah) {
  IdentifyOptions options;
  options.start = "table9";
  options.chemistry = "NCA";
  options.capacity_ah = capacity_ah;
  options.ocv_from_load = true;
  options.initial_soc = {1, false};
  for (const std::string& name : healthy) options.recordings.push_back((data / cell / (name + ".csv")).string());
  options.healthy = options.recordings;
  options.name = "calibrated";
  return *identify_cell(options).cell_file;
}

measurement::Recording read(const std::string& cell, const std::string& recording, const files::CellFile& file) {
  return read_for_diagnosis((data / cell / (recording + ".csv")).string(), {}, file);
}

/// The causes of each finding, each with those alike.
std::vector<std::vector<std::string>> causes_of(const files::CellFile& file,
                                                const std::vector<measurement::Recording>& recordings) {
  diagnosis::Options how;
  how.healthy = file.healthy;
  std::vector<diagnosis::PreparedRecording> records;
  for (const measurement::Recording& r : recordings) records.push_back(prepared(r, "", file, start_of(r, file)).record);
  const diagnosis::Diagnosis d = diagnosis::diagnose(file.parameters, file.mechanisms, records, how);
  std::vector<std::vector<std::string>> causes;
  if (!diagnosis::names(d.verdict)) return causes;
  for (const diagnosis::Finding& f : d.findings) {
    std::vector<std::string>& of = causes.emplace_back();
    of.emplace_back(model::catalogue[f.setting.index].id);
    for (const std::size_t m : f.equivalent_to) of.emplace_back(model::catalogue[m].id);
  }
  return causes;
}

/// The causes of the first finding, in a recording whose readings a fault has changed.
template <class Fault>
std::vector<std::string> first_causes(const std::string& cell, const std::vector<std::string>& healthy,
                                      const std::string& recording, double capacity_ah, const Fault& fault) {
  const files::CellFile file = identified(cell, healthy, capacity_ah);
  measurement::Recording r = read(cell, recording, file);
  fault(r);
  const auto causes = causes_of(file, {r});
  return causes.empty() ? std::vector<std::string>() : causes.front();
}

bool contains(const std::vector<std::string>& causes, const std::string& id) {
  return std::find(causes.begin(), causes.end(), id) != causes.end();
}

/// Without its first ten minutes no cell file follows from this discharge at one current; without later ones it does.
TEST(RealFaults, ABlockThatCannotBeComparedTakesNoOtherWithIt) {
  if (!std::filesystem::exists(data)) GTEST_SKIP() << "no " << data;
  const files::CellFile file = identified("B0038", {"d006"}, 1.09);
  ASSERT_EQ(file.healthy.blocks.size(), 1u);
  EXPECT_GT(file.healthy.blocks.front().start_s, 0);
}

TEST(RealFaults, AnOffsetOfTheVoltageIsNotReadAsAGain) {
  if (!std::filesystem::exists(data)) GTEST_SKIP() << "no " << data;
  const auto causes = first_causes("B0043", {"d004", "d006"}, "d002", 1.7, [](measurement::Recording& r) {
    for (double& v : r.voltage_v.edit()) v += 0.27;
  });
  EXPECT_TRUE(contains(causes, "voltage_offset"));
}

TEST(RealFaults, ACurrentIsNotLostAmongCausesThatMayNotStay) {
  if (!std::filesystem::exists(data)) GTEST_SKIP() << "no " << data;
  for (const double factor : {1.28, 1.3}) {
    const auto causes = first_causes("B0007", {"d125", "d129", "d135"}, "d133", 1.81, [&](measurement::Recording& r) {
      for (double& a : r.current_a.edit()) a *= factor;
    });
    EXPECT_TRUE(contains(causes, "current_gain")) << factor;
  }
}

TEST(RealFaults, AGainIsFoundFarBeyondTheHealthyCurrents) {
  if (!std::filesystem::exists(data)) GTEST_SKIP() << "no " << data;
  const auto causes = [](const std::string& cell, const std::vector<std::string>& healthy, const std::string& recording,
                         double capacity_ah, double gain) {
    return first_causes(cell, healthy, recording, capacity_ah, [&](measurement::Recording& r) {
      for (double& a : r.current_a.edit()) a *= 1 + gain;
    });
  };
  EXPECT_TRUE(contains(causes("B0043", {"d004", "d006"}, "d002", 1.7, 0.371), "current_gain"))
      << "between the starts of a fit, the reading counts the cell to far below empty";
  EXPECT_TRUE(contains(causes("B0005", {"d508", "d613"}, "d587", 1.34, 0.531), "current_gain"))
      << "the signature sees nothing of it";
}

TEST(RealFaults, WhatALeadWandersIsNotSelfHeating) {
  if (!std::filesystem::exists(data)) GTEST_SKIP() << "no " << data;
  const files::CellFile file = identified("B0043", {"d004", "d006"}, 1.7);
  measurement::Recording behind_a_lead = read("B0043", "d002_load", file);
  behind_a_lead.current_ref_a = behind_a_lead.voltage_ref_v = {};
  const auto causes = causes_of(file, {read("B0043", "d004", file), behind_a_lead});
  ASSERT_EQ(causes.size(), 1) << testing::PrintToString(causes);
  EXPECT_EQ(causes.front().front(), "contact_step");
}

TEST(RealFaults, AContactThatOpensAtTheKneeAloneIsNone) {
  if (!std::filesystem::exists(data)) GTEST_SKIP() << "no " << data;
  const files::CellFile file = identified("B0007", {"d001", "d003", "d005"}, 1.88);
  for (const auto& causes : causes_of(file, {read("B0007", "d587", file)})) {
    EXPECT_NE(causes.front(), "contact_step") << "a quarter of the capacity is gone";
    EXPECT_NE(causes.front(), "contact_intermittent");
  }
}

}  // namespace
}  // namespace bms::workflow
