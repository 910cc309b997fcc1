#include "estimator/soc_quality.hpp"

#include <gtest/gtest.h>

#include "tests/cells.hpp"

namespace bms::estimator {
namespace {

struct Watched {
  model::Cell<double, model::max_intervals> cell = tests::prepared<double>();
  SocQuality<double> quality;

  SocQuality<double>::Result at(double soc, double sigma, double current_a = 0, double counted = 0,
                                std::uint32_t flags = 0) {
    Estimate<double> e;
    e.soc = soc;
    e.soc_sigma = sigma;
    e.flags = flags;
    return quality.update(e, model::look_up(cell, soc), {current_a, 1, 25}, counted, 1'000, 0.02);
  }
};

TEST(SocQuality, AKneeIsObservableAndAPlateauIsNot) {
  Watched w;
  EXPECT_TRUE(w.at(0.95, 0.005).observable);
  EXPECT_TRUE(w.at(0.05, 0.005).observable);
  EXPECT_FALSE(w.at(0.45, 0.005).observable);
  EXPECT_FALSE(w.at(0.85, 0.005).observable);
}

TEST(SocQuality, CountsTimeAndChargeSinceTheAnchor) {
  Watched w;
  w.at(0.95, 0.005);
  SocQuality<double>::Result now;
  for (int k = 0; k < 60; ++k) now = w.at(0.85, 0.005, -6, -0.001);
  for (int k = 0; k < 60; ++k) now = w.at(0.85, 0.005, 6, 0.001);
  EXPECT_EQ(now.since_anchor_s, 120U);
  EXPECT_NEAR(now.since_anchor_soc, 0.12, 1e-9) << "either way";
  EXPECT_EQ(w.at(0.95, 0.005).since_anchor_s, 0U);
}

TEST(SocQuality, WhereSocIsNotKnownThereIsNoAnchor) {
  Watched w;
  w.at(0.95, 0.005);
  EXPECT_EQ(w.at(0.95, 0.05).since_anchor_s, 1U);
  EXPECT_FALSE(w.at(0.95, 0.005, 0, 0, soc_ambiguous).observable);
  EXPECT_FALSE(w.at(0.95, 0.005, 0, 0, voltage_missing).observable);
}

TEST(SocQuality, UnderAHighCurrentLessIsObservable) {
  Watched w;
  EXPECT_TRUE(w.at(0.65, 0.005).observable);
  EXPECT_FALSE(w.at(0.65, 0.005, -100).observable) << "2 % of R0 and R1 are 40 mV there";
}

}  // namespace
}  // namespace bms::estimator
