#include "reports/identify_page.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "reports/cell_charts.hpp"
#include "reports/identify_tables.hpp"
#include "reports/report_page.hpp"

namespace bms::reports {

namespace id = identification;

namespace {

std::string file_name(const std::string& path) { return path.substr(path.rfind('/') + 1); }

std::vector<files::PageCell> fit_row(const std::string& name, const id::FitStatistics& f) {
  std::string ahead;
  for (const id::FitStatistics::PredictionError& a : f.ahead)
    ahead += fmt::format("{}{:.2f}", ahead.empty() ? "" : ", ", 1e3 * a.rmse_v);
  const id::ResidualAnalysis& r = f.residuals;
  return {files::text_cell(name),
          files::text_cell(fmt::format("{:.2f} mV", 1e3 * f.rmse_v)),
          files::text_cell(fmt::format("{:.2f} mV", 1e3 * f.largest_v)),
          files::text_cell(fmt::format("{:.1f} %", f.fit_percent)),
          files::text_cell(ahead + " mV"),
          files::text_cell(fmt::format("{:.2f}, {:.2f} mV", 1e3 * r.mean_v, 1e3 * r.mean_band_v)),
          files::text_cell(fmt::format("{:.0f} % autocorrelation, {:.0f} % correlation with the current",
                                       100 * r.autocorrelated, 100 * r.input_correlated))};
}

files::PageTable fit_table(const workflow::IdentifyResult& r) {
  const id::Optimum& optimum = r.identification.optimum;
  files::PageTable table{"fits",
                         "Error of the simulated voltage, open loop",
                         {"recording", "RMS", "largest", "fit", "1, 10 and 60 steps ahead, RMS", "mean and its band",
                          "lags outside the white-noise band"},
                         {},
                         fmt::format("Model {}, optimiser {}, {} iterations. {}", r.model, r.optimizer,
                                     optimum.iterations, optimum.reason)};
  table.rows.push_back(fit_row("identification data", r.identification.estimation));
  for (const auto& [path, fit] : r.validations) table.rows.push_back(fit_row(file_name(path), fit));
  return table;
}

/// What --extend has put into the cell file.
files::PageTable joint_table(const id::StructureChoice& choice) {
  files::PageTable table{"joint", "Parameters of the cell file", {"parameter", "value", "remarks"}, {}, ""};
  for (std::size_t k = 0; k < choice.model.unknowns.size(); ++k) {
    const auto i = static_cast<Eigen::Index>(k);
    const std::string name = choice.model.unknowns[k].name();
    table.rows.push_back({files::text_cell(name),
                          files::text_cell(value_text(name, choice.fit.value[i], choice.fit.std[i])),
                          files::text_cell(choice.fit.at_bound[i] != 0 ? "at its bound" : "")});
  }
  return table;
}

void add_charts(const std::string& name, const id::Data& data, const id::FitStatistics& f, files::PageContent& page) {
  files::PageChart voltage{
      name + ": voltage", {"measured, V", "simulated, V"}, data.time_s.copy(), {data.voltage_v.copy(), {}}};
  files::PageChart error{name + ": measured minus simulated voltage, mV", {"mV"}, data.time_s.copy(), {{}}};
  for (Eigen::Index k = 0; k < f.error_v.size(); ++k) {
    voltage.columns[1].push_back(data.voltage_v[static_cast<std::size_t>(k)] - f.error_v[k]);
    error.columns[0].push_back(1e3 * f.error_v[k]);
  }
  page.charts.push_back(std::move(voltage));
  page.charts.push_back(std::move(error));
}

// ---- pulses: measured and simulated

/// Rows that the chart of a pulse shows: its first minute, and of a shorter one also its decay.
struct Shown {
  double from_s, to_s;
};
Shown shown(const measurement::Pulse& p) {
  constexpr double most_s = 60, around_s = 5;
  const double to_s = p.duration_s > most_s ? most_s : 2 * p.duration_s + around_s;
  return {p.begin_s - around_s, p.begin_s + to_s};
}

double largest_error_v(const measurement::Pulse& p, const id::Data& data, const id::FitStatistics& f) {
  const Shown window = shown(p);
  double largest = 0;
  for (std::size_t k = 0; k < data.size(); ++k) {
    const double e = f.error_v[static_cast<Eigen::Index>(k)];
    if (data.time_s[k] >= window.from_s && data.time_s[k] <= window.to_s && std::isfinite(e))
      largest = std::max(largest, std::abs(e));
  }
  return largest;
}

files::PageChart pulse_chart(const measurement::Pulse& p, const id::Data& data, const id::FitStatistics& f) {
  files::PageChart chart{
      fmt::format("{} of {:.3g} A at {:.0f} % state of charge, {:.0f} s: voltage", p.charges() ? "Charge" : "Discharge",
                  std::abs(p.current_a), 100 * p.soc, p.duration_s),
      {"measured, V", "simulated, V"},
      {},
      {{}, {}},
      {},
      "time since the pulse began, s"};
  const Shown window = shown(p);
  for (std::size_t k = 0; k < data.size(); ++k) {
    if (data.time_s[k] < window.from_s || data.time_s[k] > window.to_s) continue;
    const double v = data.voltage_v[k];
    chart.time_s.push_back(data.time_s[k] - p.begin_s);
    chart.columns[0].push_back(v);
    chart.columns[1].push_back(v - f.error_v[static_cast<Eigen::Index>(k)]);
  }
  return chart;
}

/// A discharge and a charge in the middle of the state of charge, and the pulse with the largest error.
void add_pulses(const workflow::IdentifyResult& r, files::PageContent& page) {
  const id::Data& data = r.data.front();
  const id::FitStatistics& f = r.identification.estimation;
  measurement::Recording recording;
  recording.time_s = data.time_s;
  recording.current_a = data.current_a;
  recording.voltage_v = data.voltage_v;
  const auto& initial = r.identification.initial;
  const double soc = initial.empty() ? std::numeric_limits<double>::quiet_NaN() : initial.front().soc;
  const auto pulses = measurement::pulses_of(recording, data.capacity_ah, {data.time_s.front(), soc});
  std::vector<const measurement::Pulse*> chosen;
  const auto choose = [&](auto&& better, auto&& counts) {
    const measurement::Pulse* best = nullptr;
    for (const measurement::Pulse& p : pulses) {
      if (counts(p) && (best == nullptr || better(p, *best))) best = &p;
    }
    if (best != nullptr && std::find(chosen.begin(), chosen.end(), best) == chosen.end()) chosen.push_back(best);
  };
  const auto nearer = [](const auto& a, const auto& b) { return std::abs(a.soc - 0.5) < std::abs(b.soc - 0.5); };
  choose(nearer, [](const auto& p) { return !p.charges(); });
  choose(nearer, [](const auto& p) { return p.charges(); });
  choose([&](const auto& a, const auto& b) { return largest_error_v(a, data, f) > largest_error_v(b, data, f); },
         [](const auto&) { return true; });
  for (const measurement::Pulse* p : chosen) page.charts.push_back(pulse_chart(*p, data, f));
}

// ---- the first sentences

/// R0, R1, C1 at the node nearest to the middle.
std::string middle_values(const id::Identification& found) {
  std::string text;
  for (const char* name : {"r0_ohm", "r1_ohm", "c1_f"}) {
    const id::Parameter* middle = nullptr;
    for (const id::Parameter& p : found.parameters) {
      if (p.name == name && (middle == nullptr || std::abs(p.soc - 0.5) < std::abs(middle->soc - 0.5))) middle = &p;
    }
    if (middle == nullptr) continue;
    text += fmt::format("{}{} is {}", text.empty() ? "" : ", ", label_of(*middle),
                        value_text(middle->name, middle->value, middle->std));
  }
  return text.empty() ? text : text + ". ";
}

/// Where the model is off most.
std::string largest_residual(const workflow::IdentifyResult& r) {
  const id::Data& data = r.data.front();
  const id::FitStatistics& f = r.identification.estimation;
  double largest = 0, at_s = 0, soc = 0, counted = 0;
  for (std::size_t k = 0; k < data.size(); ++k) {
    if (k > 0 && std::isfinite(data.current_a[k]))
      counted += data.current_a[k] * (data.time_s[k] - data.time_s[k - 1]) / (3'600 * data.capacity_ah);
    const double e = std::abs(f.error_v[static_cast<Eigen::Index>(k)]);
    if (!(e > largest)) continue;
    largest = e;
    at_s = data.time_s[k] - data.time_s.front();
    soc = counted;
  }
  const auto whole_s = static_cast<long>(at_s);
  std::string text = fmt::format("The largest residual is {:.1f} mV, {:.1f} times the RMS, at {}:{:02}:{:02}",
                                 1e3 * largest, largest / f.rmse_v, whole_s / 3'600, whole_s / 60 % 60, whole_s % 60);
  if (!r.identification.initial.empty())
    text += fmt::format(" and {:.0f} % state of charge", 100 * (r.identification.initial.front().soc + soc));
  return text + ".";
}

std::string joint_statement(const workflow::JointResult& joint) {
  const id::CandidateResult& winner = joint.choice.candidates[joint.choice.chosen];
  std::string text =
      fmt::format("One circuit for all recordings, {}: {:.2f} mV RMS, and {:.2f} mV with a {} left out. ", winner.name,
                  1e3 * winner.fitted_rmse_v, 1e3 * winner.left_out_v, joint.choice.left_out);
  for (const id::LeftOutError& e : joint.held_out)
    text += fmt::format("Held out {}: {:.2f} mV RMS. ", file_name(e.name), 1e3 * e.rmse_v);
  return text + "The charts over time show the circuit that this fit began with. ";
}

std::string statement_of(const workflow::IdentifyResult& r) {
  const id::Identification& found = r.identification;
  std::string text = r.joint ? joint_statement(*r.joint) : "";
  text += fmt::format("The simulated voltage is off by {:.2f} mV RMS over {} readings, fit {:.1f} %. ",
                      1e3 * found.estimation.rmse_v, found.estimation.samples, found.estimation.fit_percent);
  for (const auto& [path, fit] : r.validations)
    text += fmt::format("On {}, which was not used, by {:.2f} mV. ", file_name(path), 1e3 * fit.rmse_v);
  return text + (r.joint ? "" : middle_values(found)) + largest_residual(r);
}

}  // namespace

std::string identify_report(const workflow::IdentifyResult& r, const std::vector<workflow::RecordedPulses>& pulses) {
  const id::Identification& found = r.identification;
  std::string from;
  for (const workflow::RecordedPulses& p : pulses) from += (from.empty() ? "" : ", ") + file_name(p.recording);
  files::PageContent page{"Cell " + (r.cell.empty() ? "without a cell file" : r.cell) + ", identified from " + from,
                          statement_of(r),
                          {},
                          {},
                          {}};
  for (const measurement::Warning& w : r.warnings) page.warnings.push_back(w.text);
  if (r.cell_file) page.charts = cell_charts(*r.cell_file);
  add_charts("Identification data", r.data.front(), found.estimation, page);
  add_pulses(r, page);
  for (std::size_t k = 0; k < r.validations.size(); ++k)
    add_charts(file_name(r.validations[k].first), r.data[k + 1], r.validations[k].second, page);
  if (r.joint) page.tables.push_back(joint_table(r.joint->choice));
  page.tables.push_back(parameter_table(found));
  if (r.joint) page.tables.back().title = "Parameters that this fit began with";
  for (files::PageTable& table : std::vector{pulse_table(pulses), correlation_table(found), fit_table(r)})
    page.tables.push_back(std::move(table));
  return page_with_charts_first(page);
}

}  // namespace bms::reports
