// The results of a replay: JSON and page.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "files/recording.hpp"
#include "files/text_file.hpp"
#include "reports/json_replay.hpp"
#include "reports/report_page.hpp"

namespace bms::reports {
namespace {

using ::testing::HasSubstr;

replay::ReplayResult replayed() {
  replay::ReplayResult result;
  result.cell = files::read_cell("table9");
  result.target = "host";
  result.recording = files::read_recording(BMS_SOURCE_DIR "/evidence/recordings/forklift_shift.csv");
  result.track = replay::run_on_host(result.cell, measurement::samples(result.recording), std::nullopt,
                                     replay::ScalarKind::float32);
  replay::evaluate(result);
  return result;
}

TEST(Results, AreNullWithoutAReference) {
  replay::ReplayResult r = replayed();
  EXPECT_THAT(json_of(r, ""), Not(HasSubstr("\"rmse\": null")));
  r.recording.soc_ref = {};
  r.soc = {};
  r.open_loop_v.clear();
  replay::evaluate(r);
  EXPECT_THAT(json_of(r, ""), HasSubstr("\"rmse\": null"));
}

TEST(Results, ReportASignificantCurrentOffset) {
  replay::ReplayResult r = replayed();
  EXPECT_THAT(statement(r), Not(HasSubstr("The current sensor seems to read")));
  r.soc.current_offset_a = -0.05;
  r.soc.current_offset_sigma_a = 0.02;
  EXPECT_THAT(statement(r), HasSubstr("The current sensor seems to read low by 50 mA (standard deviation 20 mA)"));
  r.soc.current_offset_sigma_a = 0.04;
  EXPECT_THAT(statement(r), Not(HasSubstr("The current sensor seems to read")));
}

TEST(Results, AnUnreliableResultSaysSoFirstAndWhy) {
  replay::ReplayResult r = replayed();
  EXPECT_THAT(statement(r), ::testing::StartsWith("After 8.0 hours"));
  EXPECT_THAT(json_of(r, ""), HasSubstr("\"reliable\": true"));
  r.doubts = {"the sign of the current looks inverted"};
  EXPECT_THAT(statement(r),
              ::testing::StartsWith("The result is not reliable: the sign of the current looks inverted. "));
  EXPECT_THAT(json_of(r, ""), HasSubstr("\"reliable\": false"));
}

/// Content of each script element, in order.
std::vector<std::string> scripts_of(const std::string& page) {
  std::vector<std::string> found;
  for (std::size_t at = 0; (at = page.find("<script>", at)) != std::string::npos;) {
    const std::size_t begin = at + std::string("<script>").size();
    at = page.find("</script>", begin);
    found.push_back(page.substr(begin, at - begin));
  }
  return found;
}

TEST(Report, ATitleCannotBecomeMarkup) {
  const std::string title = "x/</title><script>alert(document.title)</script>&\"'.csv";
  const std::string page = page_of({title, "", {}, {}, {}});
  EXPECT_THAT(page,
              HasSubstr("<title>x/&lt;/title&gt;&lt;script&gt;alert(document.title)&lt;/script&gt;&amp;&quot;&#39;"
                        ".csv</title>"));
  EXPECT_EQ(page.find("<script>alert"), std::string::npos);
}

/// The policy of W3C's Content Security Policy Level 3: only scripts with these hashes run.
TEST(Report, ItsPolicyAllowsItsOwnScriptsAndNothingElse) {
  const std::string page = page_of({"title </script>", "statement", {}, {}, {}});
  const std::string policy = policy_in(page);
  EXPECT_THAT(policy, ::testing::StartsWith("default-src 'none'; script-src 'sha256-"));
  const std::vector<std::string> scripts = scripts_of(page);
  EXPECT_EQ(scripts.size(), 5U);
  for (const std::string& script : scripts)
    EXPECT_THAT(policy, HasSubstr("'sha256-" + files::sha256_base64(script) + "'"));
  const std::string of_scripts =
      policy.substr(policy.find("script-src"), policy.find("; style-src") - policy.find("script-src"));
  EXPECT_THAT(of_scripts, Not(HasSubstr("unsafe")));
  EXPECT_THAT(policy, Not(HasSubstr("connect-src")));
  EXPECT_LT(page.find("Content-Security-Policy"), page.find("<script>"));
  EXPECT_EQ(page.find("@POLICY@"), std::string::npos);
}

TEST(Report, ContainsItsScriptAndDataAndLoadsNothing) {
  replay::ReplayResult r = replayed();
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
