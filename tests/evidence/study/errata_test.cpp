// The derivations behind the table of errata.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "identification/circuit_from_discrete.hpp"
#include "study/paper_tables.hpp"

namespace bms::study {
namespace {

using identification::circuit_from_discrete;
using identification::CircuitResult;

constexpr double capacity_c = 6 * 3'600, step_s = 1;

std::string right_of(const std::string& where) {
  for (const auto& row : text_table("errata").rows()) {
    if (row[0] == where) return row[2];
  }
  ADD_FAILURE() << "no row " << where;
  return "";
}

TEST(Errata, Equation17HasNoSlopeOfTheOcv) {
  const CircuitResult r = circuit_from_discrete({0.01317, -0.02263, 0.00946, -1.82, 0.8203}, step_s, capacity_c);
  EXPECT_NEAR(r.circuit.b1_v, 0, 1e-9);
  EXPECT_NEAR(r.circuit.r0_ohm, 0.0124, 5e-5);
  EXPECT_THAT(right_of("Eq. 17, section 3.2.1"), ::testing::HasSubstr("b1 = 0, R0 = 0.0124"));
}

TEST(Errata, Equations21And22GiveAnotherCircuit) {
  const CircuitResult r = circuit_from_discrete({0.009828, -0.01508, 0.005254, -1.835, 0.835}, step_s, capacity_c);
  EXPECT_NEAR(r.circuit.r0_ohm, 0.0082, 5e-5);
  EXPECT_NEAR(r.circuit.r1_ohm, 0.0194, 5e-5);
  EXPECT_NEAR(r.circuit.b1_v, 0.26, 0.005);
  EXPECT_THAT(right_of("Eq. 21, 22, section 3.2.2"), ::testing::HasSubstr("R0 = 0.0082, R1 = 0.0194"));
  EXPECT_THAT(right_of("Eq. 21, 22"), ::testing::HasSubstr("b1 = 0.26"));
}

// Of R0, R1 and C1 of the same rest, the text calls only C1 uncertain.
TEST(Errata, RelativeDeviationsOfTable8) {
  const double r0 = paper_table(8).at(0, 0) / 0.0126, c1 = paper_table(8).at(0, 2) / paper_table(6).at(3, 2);
  EXPECT_NEAR(r0, 0.62, 0.005);
  EXPECT_NEAR(c1, 0.48, 0.005);
}

TEST(Errata, TheTwoOcvTablesDiffer) {
  double largest_v = 0;
  for (std::size_t k = 0; k < 10; ++k) {
    const double soc = 0.1 * static_cast<double>(k + 1);
    const double one_v = paper_table(1).at(k, 0) + paper_table(1).at(k, 1) * soc;
    const double nine_v = paper_table(9).at(k, 3) + paper_table(9).at(k, 4) * soc;
    largest_v = std::max(largest_v, std::abs(one_v - nine_v));
  }
  EXPECT_GT(largest_v, 0.005);
}

}  // namespace
}  // namespace bms::study
