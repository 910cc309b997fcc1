#include "study/paper_tables.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "files/bad_input.hpp"

namespace bms::study {
namespace {

using ::testing::HasSubstr;

std::string rejection(const std::string& text) {
  try {
    static_cast<void>(PaperTable(text, "t.csv"));
  } catch (const files::BadInput& error) {
    return error.what();
  }
  ADD_FAILURE() << "accepted";
  return "";
}

TEST(PaperTables, HaveTheShapeAndSomeValuesOfThePaper) {
  const struct {
    int number;
    std::size_t rows, columns;
    double first, last;
  } tables[] = {{1, 10, 2, 2.984, 1.53}, {4, 5, 4, 68.76, 93.13},      {5, 4, 2, 73.90, 78.98},    {6, 4, 4, 0.0119, 0},
                {7, 7, 7, 93.09, 72.97}, {8, 7, 4, 0.00784, 0.023996}, {9, 10, 5, 0.0140197, 1.33}};
  for (const auto& t : tables) {
    const PaperTable& table = paper_table(t.number);
    EXPECT_EQ(table.rows(), t.rows) << t.number;
    EXPECT_EQ(table.columns(), t.columns) << t.number;
    EXPECT_EQ(table.at(0, 0), t.first) << t.number;
    if (t.last == 0) continue;  // nan in the file
    EXPECT_EQ(table.at(t.rows - 1, t.columns - 1), t.last) << t.number;
  }
  EXPECT_EQ(paper_table(6).at(3, 2), 5841.25);
  EXPECT_THROW(paper_table(3), std::out_of_range);
  EXPECT_EQ(TextTable("a,b\nx,\"y, z\"\n", "t.csv").rows()[0][1], "y, z");
  EXPECT_THROW(TextTable("a,b\nx,\"y\n", "t.csv"), files::BadInput);
}

TEST(PaperTables, ABadFileIsRejectedWithOneLine) {
  EXPECT_THAT(rejection("# comment\nrow,a,b\nx,1\n"), HasSubstr("t.csv:3: 2 fields, expected 3 as in the header"));
  EXPECT_THAT(rejection("row,a\nx,1,\n"), HasSubstr("t.csv:2: 3 fields"));
  EXPECT_THAT(rejection("row,a\nx,1 V\n"), HasSubstr("t.csv:2: '1 V' is not a number"));
  EXPECT_THAT(rejection("row\n"), HasSubstr("t.csv:1: one column"));
  EXPECT_THAT(rejection("row,a\n"), HasSubstr("no rows"));
}

}  // namespace
}  // namespace bms::study
