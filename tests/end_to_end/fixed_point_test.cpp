// The estimator in fixed point: as accurate as in double, and bit-identical on a Cortex-M0.
#include <gtest/gtest.h>

#include "tests/figures/fixed_point.hpp"

namespace bms {
namespace {

const std::filesystem::path data = BMS_DATA_DIR;
std::vector<FixedPointRun> runs() {
  return fixed_point_runs(BMS_SOURCE_DIR "/evidence/recordings/forklift_shift.csv", data);
}
constexpr std::size_t shift_and_recordings = 1 + 27 + 11 + 13;

TEST(FixedPoint, IsWithinATenthOfAPercentOfDoubleOverTheShiftAndEveryRealRecording) {
  std::size_t done = 0;
  for (const FixedPointRun& run : runs()) {
    const Deviation d = deviation(run);
    EXPECT_GT(d.estimates, 1'000U) << run.recording;
    EXPECT_GT(d.of_fixed, 0) << run.recording << ": not another arithmetic";
    EXPECT_LE(d.of_fixed, 1e-3) << run.recording << " with " << run.cell;
    ++done;
  }
  EXPECT_EQ(done, std::filesystem::exists(data) ? shift_and_recordings : 1U);
}

/// The shift, every third of the recordings and, of the cells with mechanisms, every eighth: their steps take four
/// times as long. `write_figures fixed` compares all.
TEST(FixedPoint, OfTheMicrobitIsTheHostsBitForBitOverTheShiftAndRealRecordings) {
  std::size_t done = 0, of_plain = 0, of_extended = 0;
  for (const FixedPointRun& run : runs()) {
    const bool extended = run.cell.ends_with("_extended");
    if (extended ? of_extended++ % 8 != 0 : of_plain++ % 3 != 0) continue;
    const auto difference = difference_on_microbit(run);
    EXPECT_FALSE(difference) << run.recording << " with " << run.cell << ": " << difference->field << " of sample "
                             << difference->sample << ", host " << difference->host << ", board " << difference->board;
    ++done;
  }
  EXPECT_EQ(done, std::filesystem::exists(data) ? 1U + 9 + 3 : 1U);
}

}  // namespace
}  // namespace bms
