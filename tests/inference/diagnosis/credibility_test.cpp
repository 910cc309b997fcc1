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
    RecordingFacts facts;
    facts.step_s = step_s;
    const double edge_s = thresholds.noise.edge_jitter * step_s;
    for (const double sign : {-1.0, 1.0}) {
      EXPECT_TRUE(is_implausible(with_first(skew, sign * 0.9 * edge_s), skew, facts)) << step_s;
      EXPECT_FALSE(is_implausible(with_first(skew, sign * 1.1 * edge_s), skew, facts)) << step_s;
    }
    EXPECT_FALSE(is_implausible(with_first(offset, 0.9 * edge_s), offset, facts));
  }
}

TEST(Credibility, StagesOfTheOcvComeCloserTogetherWithTheCapacityAlone) {
  constexpr std::size_t shape = model::mechanism_index_of<model::OcvShape>,
                        capacity = model::mechanism_index_of<model::CapacityChange>;
  const double apart = thresholds.decision.slides_apart_soc, closer = thresholds.decision.stages_closer;
  const auto slid = [&](double low, double high) {
    HypothesisFit f = with_first(shape, low);
    f.hypothesis.settings.front().value[1] = high;
    return f;
  };
  HypothesisFit f = slid(0.03, 0.03 - 1.1 * closer * apart);
  EXPECT_TRUE(is_implausible(f, shape, {}));
  EXPECT_FALSE(is_implausible(slid(0.03, 0.03 - 0.9 * closer * apart), shape, {}));
  EXPECT_FALSE(is_implausible(slid(-0.08, 0.08), shape, {})) << "a lost electrode spreads them";
  EXPECT_FALSE(is_implausible(slid(0.1, 0.1), shape, {})) << "lost lithium moves both";
  f.hypothesis.settings.push_back({capacity, {0.5 * closer}, {}});
  EXPECT_FALSE(is_implausible(f, shape, {})) << "the capacity is lost as well";
}

TEST(Credibility, MuchCapacityIsLostWithResistanceAlone) {
  constexpr std::size_t capacity = model::mechanism_index_of<model::CapacityChange>;
  const double lost = thresholds.decision.capacity_lost_alone, grown = thresholds.decision.resistance_grown;
  EXPECT_TRUE(is_implausible(with_first(capacity, 1.1 * lost), capacity, {}));
  EXPECT_FALSE(is_implausible(with_first(capacity, 0.9 * lost), capacity, {}));
  for (const std::size_t m :
       {model::mechanism_index_of<model::ResistanceGrowth>, model::mechanism_index_of<model::PolarisationGrowth>}) {
    HypothesisFit f = with_first(capacity, 1.1 * lost);
    f.hypothesis.settings.push_back({m, {0.9 * grown}, {}});
    EXPECT_TRUE(is_implausible(f, capacity, {})) << m;
    f.hypothesis.settings.back().value[0] = 1.1 * grown;
    EXPECT_FALSE(is_implausible(f, capacity, {})) << m;
  }
}

PreparedRecording of_1200_s() {
  PreparedRecording r;
  std::vector<double>& time_s = r.time_s.edit();
  for (int k = 0; k <= 1'200; ++k) time_s.push_back(k);
  return r;
}

TEST(Credibility, AContactAtTheEndAloneIsAtTheEnd) {
  constexpr std::size_t step = model::mechanism_index_of<model::ContactStep>,
                        loose = model::mechanism_index_of<model::ContactIntermittent>,
                        skew = model::mechanism_index_of<model::ChannelSkew>;
  const auto changed_at = [](double onset_s) {
    HypothesisFit f = with_first(step, 0.1);
    f.hypothesis.settings.front().value[contact_onset] = onset_s;
    return f;
  };
  EXPECT_TRUE(is_at_the_end(changed_at(1'101), step, {of_1200_s()}));
  EXPECT_FALSE(is_at_the_end(changed_at(1'099), step, {of_1200_s()}));
  EXPECT_FALSE(is_at_the_end(changed_at(1'101), step, {of_1200_s(), of_1200_s()})) << "it acts in all of the second";
  HypothesisFit f = with_first(loose, 0.1);
  f.hypothesis.bursts = {{{1'110, 1'120}, {1'130, 1'140}}};
  EXPECT_TRUE(is_at_the_end(f, loose, {of_1200_s()}));
  f.hypothesis.bursts.front().push_back({500, 510});
  EXPECT_FALSE(is_at_the_end(f, loose, {of_1200_s()}));
  EXPECT_FALSE(is_at_the_end(f, skew, {of_1200_s()}));
}

TEST(Credibility, AShareThatIsTheWholeIsNotWeakAndAnEndOfARangeIs) {
  constexpr std::size_t transfer = model::mechanism_index_of<model::ChargeTransfer>,
                        sensor = model::mechanism_index_of<model::TemperatureSensor>;
  const auto at_bounds = [](std::size_t mechanism, const model::MechanismValues<>& value) {
    HypothesisFit f;
    f.hypothesis.settings.push_back({mechanism, value, {}});
    f.at_bound.assign(f.hypothesis.sought().size(), 1);
    return f;
  };
  EXPECT_FALSE(is_weak(at_bounds(transfer, {0, 1, 10, 0.5}), transfer, {}));
  EXPECT_TRUE(is_weak(at_bounds(transfer, {0, 0, 10, 0.5}), transfer, {}));
  const double most = model::TemperatureSensor::parameters[0].high;
  EXPECT_TRUE(is_weak(at_bounds(sensor, {most, 200}), sensor, {}));
}

}  // namespace
}  // namespace bms::diagnosis
