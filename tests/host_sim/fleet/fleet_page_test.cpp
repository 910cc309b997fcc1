// The page of a depot in a real browser: what to visit, links to recordings, only the visible rows of the table.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "files/text_file.hpp"
#include "fleet/manifest.hpp"
#include "tests/end_to_end/run_tool.hpp"

namespace bms {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;
using ::testing::Not;

/// The result of a diagnosis, as bms diagnose prints what the table contains.
json result_of(const std::string& verdict, double resistance) {
  json result = {{"verdict", verdict},
                 {"statement", "a statement"},
                 {"recordings", {{{"initial_soc", 0.95}, {"initial_soc_sigma", 0.01}}}},
                 {"mechanisms", json::array()},
                 {"estimates",
                  {{{"id", "resistance_growth"},
                    {"parameter", "fraction"},
                    {"value", resistance},
                    {"std", 0.01},
                    {"unit", "1"}}}}};
  if (verdict == "CAUSE")
    result["mechanisms"].push_back({{"id", "contact_intermittent"},
                                    {"probability", 0.9},
                                    {"gain", 80},
                                    {"equivalent_to", json::array()},
                                    {"parameters", json::array()}});
  return result;
}

/// A depot whose results are written here: 24 days of cells in trucks of 4; cell 3 of truck 5 is loose from day 12 on.
void write_depot(const std::filesystem::path& folder, std::size_t cells) {
  std::filesystem::create_directories(folder);
  files::write_file(folder / "depot.json", R"({"task": "diagnose", "arguments": [], "pages": "all"})");
  std::ofstream manifest(folder / "manifest.csv");
  manifest << "recording,cell,truck,cell_index,started_at\n";
  for (std::size_t c = 0; c < cells; ++c) {
    for (std::size_t d = 0; d < 24; ++d) {
      const std::string date = fmt::format("2026-03-{:02}", d + 1),
                        truck = c / 4 == 5 ? "</script><b>5" : std::to_string(c / 4);
      const fleet::Unit unit{fmt::format("/logs/c{}_{}.csv", c, d), "table9", truck, std::to_string(c % 4 + 1), date};
      manifest << fmt::format("{},{},{},{},{}\n", unit.recording, unit.cell, unit.truck, unit.cell_index, date);
      const std::string key = fleet::key_of(unit), verdict = c == 22 && d >= 11 ? "CAUSE" : "NO_MISMATCH";
      const auto path = folder / "results" / key.substr(0, 2) / (key + ".json");
      std::filesystem::create_directories(path.parent_path());
      std::ofstream(path) << json{{"version", "1"},         {"cell_sha256", ""},
                                  {"recording_sha256", ""}, {"page", true},
                                  {"error", nullptr},       {"result", result_of(verdict, 0.001 * double(d))}};
    }
  }
}

std::string document_of(const std::filesystem::path& page, const std::filesystem::path& folder) {
  const auto out = folder / "dom";
  const std::string command =
      "chromium --headless --no-sandbox --disable-gpu --disable-quic --no-first-run --disable-background-networking "
      "--disable-component-update --disable-sync --window-size=1400,1100 --virtual-time-budget=5000 --user-data-dir=" +
      (folder / "profile").string() + " --dump-dom file://" + page.string() + " > " + out.string() + " 2>/dev/null";
  EXPECT_EQ(std::system(command.c_str()), 0);
  return content(out);
}

std::size_t count(const std::string& text, const std::string& what) {
  std::size_t n = 0;
  for (std::size_t at = text.find(what); at != std::string::npos; at = text.find(what, at + 1)) ++n;
  return n;
}

TEST(FleetPage, SaysWhatToVisitAndDrawsOnlyTheVisibleRows) {
  const files::TemporaryFolder folder;
  write_depot(folder.path() / "depot", 40);
  const std::string depot = (folder.path() / "depot").string(), page = (folder.path() / "page.html").string(),
                    result = (folder.path() / "r.json").string();
  ASSERT_EQ(run_tool("fleet merge " + depot).exit_code, 0);
  const ToolRun run = run_tool("fleet report " + depot + " --report " + page + " --json " + result);
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(run.out, HasSubstr("cell 3: an intermittent contact, 13 of 24 shifts since 2026-03-12"));
  const json issues = json::parse(content(result))["issues"];
  ASSERT_EQ(issues.size(), 1U);
  EXPECT_EQ(issues[0]["cause"], "contact_intermittent");
  EXPECT_EQ(issues[0]["confirmed"], true);
  EXPECT_EQ(issues[0]["onset"], "2026-03-12");
  const std::string html = content(page);
  EXPECT_EQ(count(html, "<b>5"), 0U) << "a name of a truck is not markup";
  EXPECT_THAT(html, HasSubstr("Content-Security-Policy"));
  if (!images::in_path("chromium")) GTEST_SKIP() << "no chromium";
  const std::string dom = document_of(page, folder.path());
  EXPECT_THAT(dom, HasSubstr("an intermittent contact"));
  EXPECT_THAT(dom, HasSubstr("href=\"depot/pages/"));
  EXPECT_THAT(dom, HasSubstr("960 of 960"));
  EXPECT_GE(count(dom, "<canvas"), 2U);
  const std::size_t titles = dom.find("id=\"titles\"");
  ASSERT_NE(titles, std::string::npos);
  EXPECT_THAT(dom.substr(titles, 300), HasSubstr("<td>verdict</td>"));
  const std::size_t table = dom.find("id=\"rows\"");
  ASSERT_NE(table, std::string::npos);
  EXPECT_EQ(count(dom.substr(table, dom.find("</table>", table) - table), "<tr>"), 24U);
}

/// One recording of a cell names a contact, one is not a recording, and cell 1 of truck 0 has two readings at 45 %.
TEST(FleetPage, TheTerminalListsEveryFindingLimitAndBrokenFile) {
  const files::TemporaryFolder folder;
  const auto depot = folder.path() / "depot";
  std::filesystem::create_directories(depot);
  files::write_file(depot / "depot.json", R"({"task": "diagnose", "arguments": [], "pages": "all"})");
  std::string manifest = "recording,cell,truck,cell_index,started_at\n";
  const auto add = [&](const std::string& truck, const std::string& date, const json& result, const json& error) {
    const fleet::Unit unit{"/logs/" + truck + date + ".csv", "table9", truck, "1", date};
    manifest += unit.recording + ",table9," + truck + ",1," + date + "\n";
    const std::string key = fleet::key_of(unit);
    std::filesystem::create_directories(depot / "results" / key.substr(0, 2));
    std::ofstream(depot / "results" / key.substr(0, 2) / (key + ".json"))
        << json{{"version", "1"}, {"cell_sha256", ""}, {"recording_sha256", ""},
                {"page", false},  {"error", error},    {"result", result}};
  };
  json grown = result_of("CAUSE", 0.45);
  grown["mechanisms"][0]["id"] = "resistance_growth";
  add("T1", "2026-01-10", grown, nullptr);
  add("T1", "2026-05-10", grown, nullptr);
  add("T2", "2026-05-10", result_of("CAUSE", 0.01), nullptr);
  add("T3", "2026-05-10", nullptr, "/logs/T32026-05-10.csv:7: no column 'voltage_v', expected one");
  files::write_file(depot / "manifest.csv", manifest);
  ASSERT_EQ(run_tool("fleet merge " + depot.string()).exit_code, 0);
  const ToolRun run = run_tool("fleet report " + depot.string());
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(run.out, HasSubstr("Truck T2, cell 1: an intermittent contact, 1 of 1 shift"));
  EXPECT_THAT(run.out, HasSubstr("is not confirmed: a healthy one is named like this in 1 of "));
  EXPECT_THAT(run.out,
              HasSubstr("Truck T1, cell 1: growth of the resistance 45 ± 1 % on 2026-05-10; when it reaches the "
                        "limit of 50 % cannot be said: 2 readings, a trend needs 4."));
  EXPECT_THAT(run.out, HasSubstr("T32026-05-10.csv: line 7: no column 'voltage_v', expected one"));
}

TEST(FleetPage, IsRefusedForOtherTasksAndWithoutATable) {
  const files::TemporaryFolder folder;
  EXPECT_EQ(run_tool("fleet report " + folder.path().string() + " --json -").exit_code, 2);
  files::write_file(folder.path() / "depot.json", R"({"task": "replay", "arguments": [], "pages": "all"})");
  const ToolRun run = run_tool("fleet report " + folder.path().string() + " --json -");
  EXPECT_EQ(run.exit_code, 2);
  EXPECT_THAT(run.err, HasSubstr("results of the task replay, expected those of diagnose"));
}

}  // namespace
}  // namespace bms
