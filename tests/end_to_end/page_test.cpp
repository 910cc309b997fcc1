// The reports in a real browser: all charts and figures are there, without a script error.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/end_to_end/run_tool.hpp"

namespace bms {
namespace {

using ::testing::HasSubstr;

/// The page's document after its scripts ran, as the browser serialises it. Script errors are appended to it.
/// width: of the window, 500 or more.
std::string document_of(const std::filesystem::path& page, const std::filesystem::path& folder, int width = 1400) {
  std::string html = content(page);
  const std::string listener =
      "<script>const complain = text => { const p = document.createElement('p'); p.textContent = 'SCRIPT ERROR ' + "
      "text; document.documentElement.appendChild(p); };"
      "window.addEventListener('error', e => complain(e.message));"
      "document.addEventListener('securitypolicyviolation', e => complain(e.violatedDirective));"
      // texts of the pictures: whole, and inside of their cards
      "window.addEventListener('load', () => document.querySelectorAll('figure svg text').forEach(t => {"
      "const own = t.getBoundingClientRect(), card = t.closest('figure').getBoundingClientRect();"
      "const text = t.firstChild ? t.firstChild.textContent : '';"
      "if (own.left < card.left - 1 || own.right > card.right + 1 || text.endsWith('\\u2026')) complain('cut: ' + "
      "text);"
      "}));</script>";
  html.insert(html.find("<meta http-equiv"), listener);  // the page's policy applies to what follows
  const auto watched = folder / "watched.html", out = folder / "dom";
  std::ofstream(watched) << html;
  const std::string command =
      "chromium --headless --no-sandbox --disable-gpu --disable-quic --no-first-run --disable-background-networking "
      "--disable-component-update --disable-sync --window-size=" +
      std::to_string(width) + ",1100 --virtual-time-budget=5000 --user-data-dir=" + (folder / "profile").string() +
      " --dump-dom file://" + watched.string() + " > " + out.string() + " 2>/dev/null";
  EXPECT_EQ(std::system(command.c_str()), 0);
  return content(out);
}

std::size_t count(const std::string& text, const std::string& what) {
  std::size_t n = 0;
  for (std::size_t at = text.find(what); at != std::string::npos; at = text.find(what, at + 1)) ++n;
  return n;
}

TEST(ReportPage, DrawsFiveChartsAndTheFiguresWithoutAnError) {
  if (!images::in_path("chromium")) GTEST_SKIP() << "no chromium";
  const files::TemporaryFolder folder;
  const auto page = folder.path() / "report.html";
  ASSERT_EQ(
      run_tool("replay " BMS_SOURCE_DIR "/evidence/recordings/forklift_shift.csv --report " + page.string()).exit_code,
      0);
  const std::string dom = document_of(page, folder.path());
  EXPECT_EQ(count(dom, "SCRIPT ERROR"), 1U) << "only the listener's own text";
  EXPECT_GE(count(dom, "<canvas"), 10U);  // two per chart
  EXPECT_THAT(dom, HasSubstr("one-step prediction, RMS</td>"));
  EXPECT_THAT(dom, HasSubstr("After 8.0 hours the battery is at"));
}

TEST(ReportPage, HasNoErrorChartWithoutAReference) {
  if (!images::in_path("chromium")) GTEST_SKIP() << "no chromium";
  const files::TemporaryFolder folder;
  const auto page = folder.path() / "report.html", recording = folder.path() / "r.csv";
  std::ofstream csv(recording);
  csv << "time_s,current_a,voltage_v\n";
  for (int k = 0; k < 100; ++k) csv << k << "," << -(k % 3) << "," << 3.3 - 0.013 * (k % 3) << "\n";
  csv.close();
  ASSERT_EQ(run_tool("replay " + recording.string() + " --report " + page.string()).exit_code, 0);
  const std::string dom = document_of(page, folder.path());
  EXPECT_EQ(count(dom, "SCRIPT ERROR"), 1U);
  EXPECT_EQ(count(dom, "id=\"figure-error\""), 0U);
  EXPECT_GE(count(dom, "<canvas"), 8U);
}

TEST(StudyPage, DrawsTablesAndChartsWithoutAnError) {
  if (!images::in_path("chromium")) GTEST_SKIP() << "no chromium";
  const files::TemporaryFolder folder;
  ASSERT_EQ(run_tool("study --seeds 0 --out " + (folder.path() / "study").string()).exit_code, 0);
  const std::string dom = document_of(folder.path() / "study/study.html", folder.path());
  EXPECT_EQ(count(dom, "SCRIPT ERROR"), 1U);
  EXPECT_EQ(count(dom, "<table"), 16U);  // statements, tables 1 and 4 to 9, and what belongs to them
  EXPECT_GE(count(dom, "<canvas"), 12U);
  EXPECT_THAT(dom, HasSubstr("paper 93.09"));
}

/// Page of a diagnosis: the current of the shift through a cell with a mechanism, with a later recording as hold-out.
std::string diagnosis_dom(const std::string& with, const std::string& holdout, const files::TemporaryFolder& folder) {
  const auto simulated = [&](const std::string& name, int seed) {
    const std::string recording = (folder.path() / name).string();
    EXPECT_EQ(run_tool("simulate --cell table9 --recording " BMS_SOURCE_DIR
                       "/evidence/recordings/forklift_shift.csv --initial-soc 0.98 --noise-v 0.001 " +
                       with + " --seed " + std::to_string(seed) + " --out " + recording)
                  .exit_code,
              0);
    return recording;
  };
  const std::string page = (folder.path() / "report.html").string();
  EXPECT_EQ(run_tool("diagnose --cell table9 --initial-soc 0.98 --recording " + simulated("r.csv", 1) +
                     (holdout.empty() ? "" : " --holdout " + simulated(holdout, 2)) + " --report " + page)
                .exit_code,
            0);
  EXPECT_EQ(count(content(page), " src=") + count(content(page), "<link"), 0U) << "nothing is fetched";
  return document_of(page, folder.path());
}

TEST(DiagnosisPage, ShowsCauseLocationSizeComparisonReasonAndResidual) {
  if (!images::in_path("chromium")) GTEST_SKIP() << "no chromium";
  const files::TemporaryFolder folder;
  const std::string dom = diagnosis_dom("--with ocv_hysteresis:half_gap_v=0.015,decay=40", "later.csv", folder);
  EXPECT_EQ(count(dom, "SCRIPT ERROR"), 1U);
  EXPECT_GE(count(dom, "<canvas"), 8U);  // voltage and error of both recordings, two per chart
  EXPECT_GE(count(dom, "<svg"), 8U);     // strip, its scale, size, before and after, reasons, residual, regimes, limits
  EXPECT_THAT(dom, HasSubstr("charged or discharged last"));
  EXPECT_THAT(dom, HasSubstr("of the mismatch explained"));
  EXPECT_THAT(dom, HasSubstr("hold-out: later.csv"));
  EXPECT_THAT(dom, HasSubstr("slow_polarisation"));
  EXPECT_THAT(dom, HasSubstr("interval of the prediction contains"));
  EXPECT_EQ(count(dom, "extended with its 95 % interval, V"), 1U) << "of the hold-out alone";
  EXPECT_EQ(count(dom, "NaN"), count(content(folder.path() / "report.html"), "NaN")) << "no coordinate is lost";
}

TEST(DiagnosisPage, ShowsTheDetectionLimitsWithoutAMismatch) {
  if (!images::in_path("chromium")) GTEST_SKIP() << "no chromium";
  const files::TemporaryFolder folder;
  const std::string dom = diagnosis_dom("", "", folder);
  EXPECT_EQ(count(dom, "SCRIPT ERROR"), 1U);
  EXPECT_THAT(dom, HasSubstr("NO MISMATCH"));
  EXPECT_THAT(dom, HasSubstr("threshold of significance"));
  EXPECT_GE(count(dom, "<canvas"), 4U);
  const std::string narrow = document_of(folder.path() / "report.html", folder.path(), 500);
  EXPECT_EQ(count(narrow, "SCRIPT ERROR"), 1U) << "cut: " << narrow.substr(narrow.rfind("SCRIPT ERROR"), 100);
}

}  // namespace
}  // namespace bms
