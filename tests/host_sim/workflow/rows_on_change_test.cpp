// Recordings of loggers that write a row when something changes.
#include <cmath>
#include <fstream>

#include <gtest/gtest.h>

#include "files/temporary_folder.hpp"
#include "workflow/diagnose_recordings.hpp"

namespace bms::workflow {
namespace {

/// 200 s of pulses of 6 A with a row each second, then -1.5 A with a row each minute. The row with 0 A comes at the end
/// of the last minute, in which 1.5 A flowed.
measurement::Recording read(int minutes) {
  const files::TemporaryFolder folder;
  const std::string path = (folder.path() / "rows_on_change.csv").string();
  std::ofstream out(path);
  out << "time_s,current_a,voltage_v\n0,0,3.3\n";
  double time_s = 0;
  for (int k = 0; k < 200; ++k) out << (time_s += 1) << "," << (k % 20 < 10 ? -6 : 0) << ",3.28\n";
  out << (time_s += 1) << ",-1.5,3.27\n";
  for (int k = 1; k < minutes; ++k) out << (time_s += 60) << ",-1.5,3.27\n";
  out << (time_s += 60) << ",0,3.3\n";
  out.close();
  DiagnoseOptions options;
  options.cell = "table9";
  options.recordings = {path};
  options.initial_soc = {0.9};
  return read_diagnose_input(options).recordings.front().recording;
}

double charge_ah(const measurement::Recording& r) {
  double ah = 0;
  for (std::size_t k = 1; k < r.rows(); ++k) ah += r.current_a[k] * (r.time_s[k] - r.time_s[k - 1]) / 3'600;
  return ah;
}

TEST(RowsOnChange, TheCurrentHoldsUntilTheRowWithAnotherOne) {
  const measurement::Recording r = read(30);
  EXPECT_NEAR(charge_ah(r), -(100 * 6 + 1'800 * 1.5) / 3'600, 0.001);
  ASSERT_EQ(r.rows(), 233U) << "one row more than in the file";
  EXPECT_TRUE(std::isnan(r.voltage_v[231]));
  EXPECT_EQ(r.current_a[231], -1.5);
  EXPECT_EQ(r.time_s[231], r.time_s[232] - 1);
}

TEST(RowsOnChange, AFewLongStepsAreLeftAsTheyAre) { EXPECT_EQ(read(10).rows(), 212U); }

}  // namespace
}  // namespace bms::workflow
