// Every file and every test that the audit table names exists.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>

#include "study/paper_tables.hpp"
#include "study/statements.hpp"

namespace bms::study {
namespace {

const std::filesystem::path source = BMS_SOURCE_DIR;

std::vector<std::string> words_of(const std::string& text) {
  std::istringstream in(text);
  return {std::istream_iterator<std::string>(in), {}};
}

/// "Suite.Name" of all tests in the tree.
std::set<std::string> tests_of_tree() {
  std::set<std::string> names;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(source / "tests")) {
    if (entry.path().extension() != ".cpp") continue;
    std::ifstream file(entry.path());
    std::string all((std::istreambuf_iterator<char>(file)), {});
    std::erase_if(all, [](char c) { return c == '\n' || c == ' '; });
    for (std::size_t at = 0; (at = all.find("TEST", at)) != std::string::npos; ++at) {
      const std::size_t open = all.find('(', at), comma = all.find(',', open), close = all.find(')', open);
      if (close == std::string::npos || comma > close || open - at > 7) continue;
      names.insert(all.substr(open + 1, comma - open - 1) + "." + all.substr(comma + 1, close - comma - 1));
    }
  }
  return names;
}

TEST(Audit, EveryFileAndTestExists) {
  const std::set<std::string> tests = tests_of_tree();
  EXPECT_TRUE(tests.contains("Audit.EveryFileAndTestExists"));
  EXPECT_GE(text_table("audit").rows().size(), 60U);
  for (const auto& row : text_table("audit").rows()) {
    EXPECT_FALSE(row[0].empty() || row[1].empty() || row[3].empty()) << row[0];
    for (const std::string& file : words_of(row[1])) EXPECT_TRUE(std::filesystem::exists(source / file)) << file;
    EXPECT_FALSE(words_of(row[2]).empty()) << row[0];
    for (const std::string& test : words_of(row[2])) EXPECT_TRUE(tests.contains(test)) << row[0] << ": " << test;
  }
}

TEST(Audit, HasEveryEquationTableAndFigure) {
  const auto has = [](const std::string& item) {
    const auto& rows = text_table("audit").rows();
    return std::any_of(rows.begin(), rows.end(), [&](const auto& row) { return row[0] == item; });
  };
  for (int k = 1; k <= 22; ++k) EXPECT_TRUE(has("Eq. " + std::to_string(k))) << k;
  for (int k = 1; k <= 6; ++k) EXPECT_TRUE(has("Eq. A" + std::to_string(k))) << k;
  for (int k = 1; k <= 9; ++k) EXPECT_TRUE(has("Table " + std::to_string(k))) << k;
  for (int k = 1; k <= 14; ++k) EXPECT_TRUE(has("Fig. " + std::to_string(k))) << k;
  for (const char* item : {"Fig. A1", "Appendix B.1", "Appendix B.2", "Appendix B.3", "Appendix B.4"})
    EXPECT_TRUE(has(item)) << item;
  for (const Statement& s : statements()) EXPECT_TRUE(has("statement " + s.id)) << s.id;
}

}  // namespace
}  // namespace bms::study
