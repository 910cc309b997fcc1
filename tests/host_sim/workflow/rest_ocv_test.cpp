#include "workflow/rest_ocv.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <stdexcept>
#include <string>

#include "experiments/experiment.hpp"
#include "files/cell_file.hpp"

namespace bms::workflow {
namespace {

constexpr double capacity_ah = 6;

/// A straight line for the voltage: only the rests matter.
measurement::Recording recording_of(const std::string& experiment) {
  measurement::Recording r;
  double soc = 1, before_s = 0;
  const auto rows = experiments::experiment(experiment, {.capacity_ah = capacity_ah});
  for (const experiments::ProfileRow& row : *rows) {
    soc += row.current_a * (row.time_s - before_s) / 3'600 / capacity_ah;
    before_s = row.time_s;
    r.time_s.edit().push_back(row.time_s);
    r.current_a.edit().push_back(row.current_a);
    r.voltage_v.edit().push_back(3.0 + 0.5 * soc);
  }
  return r;
}

TEST(RestOcv, AcceptsTheRestsOfTheExperimentsThatAreMadeForIt) {
  for (const char* experiment : {"ocv_10min_rest", "ocv_1h_rest"}) {
    const std::vector<RestedPoint> points = rested_points(recording_of(experiment), 1, capacity_ah);
    EXPECT_GE(points.size(), 8u) << experiment;
    files::CellFile cell = files::read_cell("table9");
    cell.parameters.capacity_ah = capacity_ah;
    EXPECT_NO_THROW(move_ocv_to(points, cell)) << experiment;
  }
}

TEST(RestOcv, RefusesASingleRestInASentence) {
  files::CellFile cell = files::read_cell("table9");
  try {
    move_ocv_to({{0.5, 3.3, 600}}, cell);
    FAIL() << "accepted";
  } catch (const std::invalid_argument& e) {
    EXPECT_THAT(e.what(), ::testing::StartsWith("1 rest of ten minutes or more"));
  }
}

}  // namespace
}  // namespace bms::workflow
