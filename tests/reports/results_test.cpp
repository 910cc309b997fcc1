// The results of a replay: JSON and page.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "files/recording.hpp"
#include "reports/json_results.hpp"
#include "reports/report_page.hpp"

namespace bms::reports {
namespace {

using ::testing::HasSubstr;

host_sim::ReplayResult replayed() {
  host_sim::ReplayResult result;
  result.cell = files::read_cell("table9");
  result.target = "host";
  result.recording = files::read_recording(BMS_SOURCE_DIR "/recordings/forklift_shift.csv");
  result.track = host_sim::run_on_host(result.cell, measurement::samples(result.recording), std::nullopt,
                                       host_sim::ScalarKind::float32);
  host_sim::evaluate(result);
  return result;
}

TEST(Results, AreNullWithoutAReference) {
  host_sim::ReplayResult r = replayed();
  EXPECT_THAT(json_of(r, ""), Not(HasSubstr("\"rmse\": null")));
  r.recording.soc_ref = {};
  r.soc = {};
  r.open_loop_v.clear();
  host_sim::evaluate(r);
  EXPECT_THAT(json_of(r, ""), HasSubstr("\"rmse\": null"));
}

TEST(Results, ReportASignificantCurrentOffset) {
  host_sim::ReplayResult r = replayed();
  EXPECT_THAT(statement(r), Not(HasSubstr("The current sensor seems to read")));
  r.soc.current_offset_a = -0.05;
  r.soc.current_offset_sigma_a = 0.02;
  EXPECT_THAT(statement(r), HasSubstr("The current sensor seems to read low by 50 mA (standard deviation 20 mA)"));
  r.soc.current_offset_sigma_a = 0.04;
  EXPECT_THAT(statement(r), Not(HasSubstr("The current sensor seems to read")));
}

TEST(Report, ContainsItsScriptAndDataAndLoadsNothing) {
  host_sim::ReplayResult r = replayed();
  r.recording.path = "logs/</script><b>.csv";
  const std::string page = replay_report(r);
  EXPECT_THAT(page, HasSubstr("new Dygraph("));
  EXPECT_THAT(page, HasSubstr("\"two_sigma\""));
  EXPECT_EQ(page.find("@DATA@"), std::string::npos);
  EXPECT_EQ(page.find("</script><b>"), std::string::npos) << "a file's name must not become markup";
  EXPECT_EQ(page.find("<script src"), std::string::npos);
  EXPECT_EQ(page.find("<link"), std::string::npos);
  EXPECT_LT(page.size(), 3'000'000U);
}

}  // namespace
}  // namespace bms::reports
