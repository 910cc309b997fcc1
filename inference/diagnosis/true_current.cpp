#include "diagnosis/true_current.hpp"

#include <cmath>

#include "diagnosis/search.hpp"
#include "diagnosis/thresholds.hpp"

namespace bms::diagnosis {

namespace {

template <class... M>
bool is_one_of(std::size_t mechanism) {
  return ((mechanism == model::mechanism_index_of<M>) || ...);
}

}  // namespace

std::vector<PreparedRecording> with_true_current(const LikelihoodModel& likelihood, const HypothesisFit& fit) {
  std::vector<MechanismSetting> sensor;
  for (std::size_t k = fit.hypothesis.own; k < fit.hypothesis.settings.size(); ++k) {
    const MechanismSetting& s = fit.hypothesis.settings[k];
    if (is_one_of<model::CurrentGain, model::CurrentOffset>(s.index)) sensor.push_back(s);
  }
  const auto laws = model::chosen<double>(sensor, likelihood.cell().capacity_ah);
  std::vector<PreparedRecording> records = likelihood.records();
  for (std::size_t r = 0; r < records.size(); ++r) {
    std::vector<double> soc;
    likelihood.voltage(fit.hypothesis, fit.calibration, r, &soc);
    records[r].initial_soc = soc.front();
    for (double& a : records[r].current_a.edit()) a = laws.true_current(a);
  }
  return records;
}

std::vector<PreparedRecording> with_likeliest_current(LikelihoodModel likelihood) {
  const Progress silent;
  const Stopped never;
  Search search(likelihood, silent, never);
  const HypothesisFit control = search.with_own_noise(likelihood.fit(likelihood.base()));
  std::vector<std::size_t> instruments;
  for (std::size_t m = 0; m < model::mechanism_count; ++m) {
    const bool scales =
        is_one_of<model::CurrentGain, model::CurrentOffset, model::VoltageGain, model::VoltageOffset>(m);
    if (scales && likelihood.base().find(m) == nullptr) instruments.push_back(m);
  }
  const std::vector<HypothesisFit> fits = search.one_more(control, instruments);
  if (fits.empty() || search.gain(control, fits.front()) < thresholds.decision.detected) return likelihood.records();
  return with_true_current(likelihood, fits.front());
}

}  // namespace bms::diagnosis
