// Numbers that are not finite are found in every kind of output, and nothing else is taken for one.
#include "files/finite_text.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include <fmt/format.h>

namespace bms::files {
namespace {

TEST(FiniteText, APlantedNumberIsFoundInASummaryATableACellFileAndAPage) {
  const double not_a_number = std::nan(""), infinite = 1 / std::sin(0.0);
  for (const double planted : {not_a_number, -not_a_number, infinite, -infinite}) {
    EXPECT_THROW(require_finite(fmt::format("the battery is at {:.1f} % (standard deviation 2 %).", planted)),
                 std::runtime_error);
    EXPECT_THROW(require_finite(fmt::format("time_s,soc\n0,0.5\n1,{}\n", planted)), std::runtime_error);
    EXPECT_THROW(require_finite(fmt::format("capacity_ah = {}\n", planted)), std::runtime_error);
    EXPECT_THROW(require_finite(fmt::format("<td>{:.2f} mV</td>", planted)), std::runtime_error);
    EXPECT_THROW(require_finite(fmt::format("It is {}.", planted)), std::runtime_error);
    EXPECT_THROW(require_finite(fmt::format("{}", planted)), std::runtime_error);
  }
}

TEST(FiniteText, WordsNamesAndScriptsAreNoNumbers) {
  for (const char* text :
       {"information about an inference, a banana and a nanometre", "readings that are empty or 'nan'",
        "/tmp/nan/inf.csv: 12 rows", "<script>if (isNaN(x)) x = NaN;</script><p>1.5</p>", "", "nan_cell.toml",
        "--unit current_a=A"}) {
    EXPECT_EQ(not_finite_in(text), "") << text;
  }
}

TEST(FiniteText, ThePlaceIsQuoted) {
  EXPECT_NE(not_finite_in("the probability is nan %").find("probability is nan"), std::string_view::npos);
}

}  // namespace
}  // namespace bms::files
