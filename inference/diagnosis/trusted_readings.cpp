#include "diagnosis/trusted_readings.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "diagnosis/diagnose.hpp"
#include "diagnosis/locate.hpp"
#include "diagnosis/one_by_one.hpp"
#include "diagnosis/thresholds.hpp"
#include "measurement/statistics.hpp"

namespace bms::diagnosis {

namespace {

double strength(const std::vector<InstrumentError>& errors, std::size_t mechanism) {
  const auto found = std::find_if(errors.begin(), errors.end(),
                                  [&](const InstrumentError& e) { return e.setting.index == mechanism; });
  return found != errors.end() ? found->setting.value[0] : 0;
}

/// The trusted readings; elsewhere the own one without its error.
std::vector<double> current_of(const PreparedRecording& r, const std::vector<InstrumentError>& errors) {
  const double offset_a = strength(errors, model::mechanism_index_of<model::CurrentOffset>),
               gain = strength(errors, model::mechanism_index_of<model::CurrentGain>);
  std::vector<double> a(r.size());
  for (std::size_t k = 0; k < a.size(); ++k) {
    const bool trusted = has_trusted(r, Check::Channel::current) && std::isfinite(r.current_ref_a[k]);
    a[k] = trusted ? r.current_ref_a[k] : (r.current_a[k] - offset_a) / (1 + gain);
  }
  return a;
}

std::vector<double> voltage_of(const PreparedRecording& r, const std::vector<InstrumentError>& errors,
                               const std::vector<double>& current_a) {
  const double offset_v = strength(errors, model::mechanism_index_of<model::VoltageOffset>),
               gain = strength(errors, model::mechanism_index_of<model::VoltageGain>),
               contact_ohm = strength(errors, model::mechanism_index_of<model::ContactStep>);
  std::vector<double> v(r.size());
  for (std::size_t k = 0; k < v.size(); ++k) {
    // a row that was removed, because a source was read in the place of the cell
    const bool of_cell = std::isfinite(r.voltage_v[k]);
    const bool trusted = has_trusted(r, Check::Channel::voltage) && std::isfinite(r.voltage_ref_v[k]);
    v[k] = trusted ? r.voltage_ref_v[k] : (r.voltage_v[k] - offset_v - contact_ohm * current_a[k]) / (1 + gain);
    if (!of_cell) v[k] = std::numeric_limits<double>::quiet_NaN();
  }
  return v;
}

/// RMS of read less predicted [V]; the predictions become views.
double error_v(const std::vector<PreparedRecording>& records, const Diagnosis& d,
               std::vector<double> RecordingView::*predicted) {
  measurement::MeanSquare error;
  for (std::size_t n = 0; n < records.size(); ++n) {
    for (std::size_t k = 0; k < records[n].size(); ++k) {
      const double e = records[n].voltage_v[k] - (d.views[n].*predicted)[k];
      if (std::isfinite(e)) error.add(e);
    }
  }
  return error.root();
}

/// RMS change of the voltage by one of the errors [V].
double contribution_v(const Diagnosis& d, std::size_t mechanism, const std::vector<PreparedRecording>& records) {
  std::vector<MechanismSetting> without = d.extended.settings;
  std::erase_if(without, [&](const MechanismSetting& s) { return s.index == mechanism; });
  measurement::MeanSquare change;
  for (std::size_t n = 0; n < records.size(); ++n) {
    const std::vector<double> v = predict(d.cell, settings_in(records, n, without), records[n]);
    for (std::size_t k = 0; k < v.size(); ++k) {
      const double e = d.views[n].extended_v[k] - v[k];
      if (std::isfinite(e)) change.add(e);
    }
  }
  return change.root();
}

/// The errors as a part of the extended cell, which predicts what is read.
void extend(Diagnosis& d, const std::vector<InstrumentError>& errors, const model::CellParameters<>& cell,
            const std::vector<MechanismSetting>& own) {
  if (!names(d.verdict)) {
    d.cell = cell;
    d.extended = {own, own.size(), {}};
    d.covariance.resize(0, 0);
    d.findings.clear();
    d.law.reset();
  }
  for (const InstrumentError& e : errors) {
    std::erase_if(d.findings, [&](const Finding& f) { return f.setting.index == e.setting.index; });
    if (d.extended.find(e.setting.index) != nullptr) continue;
    d.extended.settings.push_back(e.setting);
    const Eigen::Index n = d.covariance.rows(), more = static_cast<Eigen::Index>(d.extended.sought().size()) - n;
    d.covariance.conservativeResizeLike(Eigen::MatrixXd::Zero(n + more, n + more));
    if (more > 0) d.covariance(n, n) = e.setting.deviation[0] * e.setting.deviation[0];
  }
}

Verdict verdict_of(const Diagnosis& d) {
  if (d.findings.size() > 1) return Verdict::causes;
  return d.findings.front().equivalent_to.empty() ? Verdict::cause : Verdict::ambiguous;
}

}  // namespace

bool have_trusted_readings(const std::vector<PreparedRecording>& records) {
  return std::any_of(records.begin(), records.end(), [](const PreparedRecording& r) {
    return has_trusted(r, Check::Channel::current) || has_trusted(r, Check::Channel::voltage);
  });
}

std::vector<PreparedRecording> as_trusted(const std::vector<PreparedRecording>& records,
                                          const std::vector<InstrumentError>& errors) {
  std::vector<PreparedRecording> trusted = records;
  for (PreparedRecording& r : trusted) {
    const bool any = have_trusted_readings({r});
    if (!any) continue;
    const std::vector<double> current_a = current_of(r, errors);
    if (has_trusted(r, Check::Channel::voltage)) r.voltage_v = voltage_of(r, errors, current_a);
    if (has_trusted(r, Check::Channel::current)) r.current_a = current_a;
    r.trusted_current = has_trusted(r, Check::Channel::current);
    r.trusted_voltage = has_trusted(r, Check::Channel::voltage);
    std::erase_if(r.checks, [&](const Check& c) { return has_trusted(r, c.channel); });
    r.current_ref_a = {};
    r.voltage_ref_v = {};
  }
  return trusted;
}

Diagnosis with_instrument_errors(Diagnosis d, const std::vector<InstrumentError>& errors,
                                 const model::CellParameters<>& cell, const std::vector<MechanismSetting>& own,
                                 const std::vector<PreparedRecording>& records) {
  if (errors.empty() || d.verdict == Verdict::data_fault || d.interrupted) return d;
  if (d.verdict == Verdict::unknown)
    d.warnings.emplace_back("what the trusted instruments read of the cell is not explained by its file");
  extend(d, errors, cell, own);
  set_views(d, cell, own, records);
  std::vector<Finding> of_instruments;
  for (const InstrumentError& e : errors) {
    Finding& f = of_instruments.emplace_back();
    f.setting = e.setting;
    f.at_bound.assign(model::catalogue[e.setting.index].parameters, 0);
    f.probability = thresholds.probability.at_most;
    f.equivalent_to = e.equivalent_to;
    f.gain = e.gain;
    f.rms_contribution_v = contribution_v(d, e.setting.index, records);
    f.because = "a trusted instrument read alongside";
    d.gains.push_back({e.setting.index, e.gain});
    d.best_cost -= e.gain;
  }
  d.findings.insert(d.findings.begin(), of_instruments.begin(), of_instruments.end());
  d.verdict = verdict_of(d);
  const double file_v = error_v(records, d, &RecordingView::base_v);
  d.unexplained_rmse_v = error_v(records, d, &RecordingView::extended_v);
  d.explained_share = explained_share(file_v, d.unexplained_rmse_v, d.noise.white_v);
  d.unexplained_share = 1 - d.explained_share;
  Ranked all{d.extended.added(), thresholds.probability.at_most, d.base_cost - d.best_cost, d.explained_share};
  d.candidates.insert(d.candidates.begin(), std::move(all));
  d.spans = {{records.front().time_s.front(), records.front().time_s.back()}};
  d.regimes.clear();
  return d;
}

}  // namespace bms::diagnosis
