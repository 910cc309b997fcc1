// Which experiments are recognised among recordings.
#include "diagnosis/experiments_already_done.hpp"

#include <cmath>
#include <cstddef>

#include <gmock/gmock.h>

#include "diagnosis/next_experiment.hpp"
#include "diagnosis/reference.hpp"
#include "tests/inference/diagnosis/synthetic_recordings.hpp"

namespace bms::diagnosis {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::IsEmpty;
using testing::Not;

/// A course as a logger records it: laid out for this capacity, after a rest, with an offset of the sensor.
PreparedRecording recorded(std::string_view name, double capacity_ah, double rest_s = 0, bool with_references = true) {
  PreparedRecording r;
  std::vector<double> current_ref_a, voltage_ref_v;
  const auto rows = experiments::experiment(name, {.capacity_ah = capacity_ah}).value();
  for (double t = 0; t < rest_s; ++t) {
    r.time_s.edit().push_back(t);
    r.current_a.edit().push_back(0.03);
  }
  for (const experiments::ProfileRow& row : rows) {
    r.time_s.edit().push_back(rest_s + row.time_s);
    r.current_a.edit().push_back(row.current_a + 0.03);
  }
  r.voltage_v = std::vector<double>(r.size(), 3.3);
  if (!with_references) return r;
  const std::size_t rested = r.size() - rows.size();
  current_ref_a.assign(rested, std::nan(""));
  voltage_ref_v.assign(rested, std::nan(""));
  for (const experiments::ProfileRow& row : rows) {
    current_ref_a.push_back(row.current_ref_a());
    voltage_ref_v.push_back(row.voltmeter ? 3.3 : row.source_v);
  }
  average_references(r, current_ref_a, voltage_ref_v, test::table9());
  return r;
}

TEST(CoursesAmong, EachIsRecognisedWhateverItsCapacityAndTheRestBeforeIt) {
  for (const experiments::Experiment& e : experiments::experiments()) {
    if (!std::isfinite(e.start_soc) || e.step_s < 1) continue;
    EXPECT_THAT(experiments_already_done({recorded(e.name, 6)}, 6), Contains(std::string(e.name)));
    EXPECT_THAT(experiments_already_done({recorded(e.name, 4.8, 47)}, 6), Contains(std::string(e.name)))
        << "for a weak cell";
  }
  EXPECT_THAT(experiments_already_done({recorded("full_cycle", 6)}, 6), ElementsAre("full_cycle"));
  EXPECT_THAT(experiments_already_done({recorded("climate_steps", 6), recorded("rate_steps", 6)}, 6),
              ElementsAre("rate_steps", "climate_steps"));
}

TEST(CoursesAmong, OneWhoseTrustedInstrumentsDidNotReadIsNotAmongThem) {
  EXPECT_THAT(experiments_already_done({recorded("shunt_check", 6)}, 6), ElementsAre("shunt_check"));
  EXPECT_THAT(experiments_already_done({recorded("terminal_check", 6)}, 6),
              ElementsAre("shunt_check", "terminal_check"));
  EXPECT_THAT(experiments_already_done({recorded("terminal_check", 6, 0, false)}, 6), IsEmpty());
  EXPECT_THAT(experiments_already_done({recorded("meter_check", 6)}, 6), ElementsAre("zero_current", "meter_check"));
  EXPECT_THAT(experiments_already_done({recorded("zero_current", 6, 0, false)}, 6), IsEmpty());
}

TEST(CoursesAmong, ADriveIsNone) {
  EXPECT_THAT(experiments_already_done({test::recorded(test::drive(4, 1), 0.9, 1)}, 6), IsEmpty());
  PreparedRecording half = recorded("full_cycle", 6);
  for (auto column : {&PreparedRecording::time_s, &PreparedRecording::current_a, &PreparedRecording::voltage_v})
    half.*column = (half.*column).part(0, half.size() / 2);
  EXPECT_THAT(experiments_already_done({half}, 6), Not(Contains("full_cycle"))) << "interrupted";
}

}  // namespace
}  // namespace bms::diagnosis
