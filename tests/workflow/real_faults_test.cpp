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

/// The causes of the first finding, in a recording whose readings a fault has changed. The cell file is identified from
/// the recordings before or after it.
template <class Fault>
std::vector<std::string> first_causes(const std::string& cell, const std::vector<std::string>& healthy,
                                      const std::string& recording, double capacity_ah, const Fault& fault) {
  IdentifyOptions options;
  options.start = "table9";
  options.chemistry = "NCA";
  options.capacity_ah = capacity_ah;
  options.ocv_from_load = true;
  options.initial_soc = {1, false};
  for (const std::string& name : healthy) options.recordings.push_back((data / cell / (name + ".csv")).string());
  options.healthy = options.recordings;
  options.name = "calibrated";
  const files::CellFile file = *identify_cell(options).cell_file;
  measurement::Recording r = read_for_diagnosis((data / cell / (recording + ".csv")).string(), {}, file);
  fault(r);
  diagnosis::Options how;
  how.healthy = file.healthy;
  const diagnosis::Diagnosis d = diagnosis::diagnose(file.parameters, file.mechanisms,
                                                     {prepared(r, recording, file, start_of(r, file)).record}, how);
  std::vector<std::string> causes;
  if (!diagnosis::names(d.verdict)) return causes;
  const diagnosis::Finding& first = d.findings.front();
  causes.emplace_back(model::catalogue[first.setting.index].id);
  for (const std::size_t m : first.equivalent_to) causes.emplace_back(model::catalogue[m].id);
  return causes;
}

bool contains(const std::vector<std::string>& causes, const std::string& id) {
  return std::find(causes.begin(), causes.end(), id) != causes.end();
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

}  // namespace
}  // namespace bms::workflow
