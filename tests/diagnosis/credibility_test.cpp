#include "diagnosis/credibility.hpp"

#include <gtest/gtest.h>

#include "diagnosis/thresholds.hpp"

namespace bms::diagnosis {
namespace {

HypothesisFit with_first(std::size_t mechanism, double value) {
  HypothesisFit f;
  f.hypothesis.settings.push_back({mechanism, {value}, {}});
  return f;
}

TEST(Credibility, ASkewWithinTheJitterOfAnEdgeIsNone) {
  constexpr std::size_t skew = model::mechanism_index_of<model::ChannelSkew>,
                        offset = model::mechanism_index_of<model::CurrentOffset>;
  for (const double step_s : {0.1, 1.0, 10.0}) {
    const double edge_s = thresholds.noise.edge_jitter * step_s;
    for (const double sign : {-1.0, 1.0}) {
      EXPECT_TRUE(is_within_jitter(with_first(skew, sign * 0.9 * edge_s), skew, step_s)) << step_s;
      EXPECT_FALSE(is_within_jitter(with_first(skew, sign * 1.1 * edge_s), skew, step_s)) << step_s;
    }
    EXPECT_FALSE(is_within_jitter(with_first(offset, 0.9 * edge_s), offset, step_s));
  }
}

}  // namespace
}  // namespace bms::diagnosis
