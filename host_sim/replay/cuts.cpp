#include "replay/cuts.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <numeric>
#include <thread>

#include <fmt/format.h>

#include "files/bad_input.hpp"
#include "measurement/normal_distribution.hpp"
#include "measurement/statistics.hpp"
#include "model/ocv_voltage.hpp"

namespace bms::replay {

namespace {

constexpr double nothing = std::numeric_limits<double>::quiet_NaN();
constexpr double last_cut_before_end_s = 1'800;  ///< the last cut still runs for this long
constexpr double stays_s = 1'800;
constexpr double least_sigma = 1e-9;  ///< of a quotient
constexpr double after_knee_s = 1'800, without_knee_s = 4 * 3'600;

/// Errors and standard deviations of one run.
struct Errors {
  std::vector<double> time_s, error, sigma;  ///< time from the cut
  std::vector<std::size_t> row;              ///< of the recording
};

Errors errors_of(const measurement::Recording& r, std::size_t first, const Estimates& rows) {
  Errors e;
  for (std::size_t k = 0; k < rows.size(); ++k) {
    const double reference = r.soc_ref[first + k];
    if (std::isnan(reference)) continue;
    e.time_s.push_back(r.time_s[first + k] - r.time_s[first]);
    const EstimateRow row = rows[k];
    e.error.push_back(row.soc - reference);
    e.sigma.push_back(row.soc_sigma);
    e.row.push_back(first + k);
  }
  return e;
}

std::vector<double> ratios(const Errors& e) {
  std::vector<double> ratio;
  for (std::size_t k = 0; k < e.error.size(); ++k)
    ratio.push_back(std::abs(e.error[k]) / std::max(e.sigma[k], least_sigma));
  return ratio;
}

std::optional<double> recovery_s(const Errors& e) {
  std::optional<double> since;
  for (std::size_t k = 0; k < e.error.size(); ++k) {
    if (std::abs(e.error[k]) > 2 * e.sigma[k])
      since.reset();
    else if (!since)
      since = e.time_s[k];
    if (since && e.time_s[k] - *since >= stays_s) break;
  }
  return since;
}

std::optional<double> first_knee_s(const measurement::Recording& r, std::size_t first,
                                   const std::vector<double>& knees) {
  constexpr double beyond = 0.02;
  const double from = r.soc_ref[first];
  for (std::size_t k = first; k < r.rows(); ++k) {
    const double to = r.soc_ref[k];
    for (const double knee : knees) {
      if ((from > knee && to < knee - beyond) || (from < knee && to > knee + beyond))
        return r.time_s[k] - r.time_s[first];
    }
  }
  return std::nullopt;
}

double rms_from(const Errors& e, double from_s) {
  double squares = 0, count = 0;
  for (std::size_t k = 0; k < e.error.size(); ++k) {
    if (e.time_s[k] < from_s) continue;
    squares += e.error[k] * e.error[k];
    count += 1;
  }
  return count > 0 ? std::sqrt(squares / count) : nothing;
}

CutRun figures_of(const Errors& e, const std::optional<double>& knee_s) {
  CutRun run;
  run.knee_s = knee_s;
  run.rmse_after_knee = knee_s ? rms_from(e, std::max(*knee_s, cut_from_s[1])) : nothing;
  run.rows = e.error.size();
  run.duration_s = e.time_s.empty() ? 0 : e.time_s.back();
  for (std::size_t i = 0; i < cut_from_s.size(); ++i) {
    double largest = nothing;
    for (std::size_t k = 0; k < e.error.size(); ++k) {
      if (e.time_s[k] >= cut_from_s[i]) largest = std::fmax(largest, std::abs(e.error[k]));
    }
    run.rmse[i] = rms_from(e, cut_from_s[i]);
    run.largest[i] = largest;
    const double sigmas = static_cast<double>(i + 1);
    std::size_t inside = 0;
    for (std::size_t k = 0; k < e.error.size(); ++k) inside += std::abs(e.error[k]) <= sigmas * e.sigma[k] ? 1 : 0;
    run.inside[i] = e.error.empty() ? nothing : static_cast<double>(inside) / static_cast<double>(e.error.size());
  }
  run.median_ratio = measurement::median(ratios(e));
  run.median_sigma = measurement::median(e.sigma);
  run.recovered_s = recovery_s(e);
  return run;
}

/// In units of sigma. Neighbouring cuts get quantiles that lie far apart, since the SOC falls from cut to cut.
double drawn_error(std::size_t cut, std::size_t cuts) {
  std::size_t stride = static_cast<std::size_t>(0.618 * static_cast<double>(cuts)) | 1;
  while (std::gcd(stride, cuts) != 1) ++stride;
  return measurement::normal_quantile((static_cast<double>(cut * stride % cuts) + 0.5) / static_cast<double>(cuts));
}

std::optional<SocPrior> prior_of(const CutStart& start, std::size_t cut, std::size_t cuts, double reference) {
  if (!start.known) return std::nullopt;
  const double sign = cut % 2 == 0 ? -1 : 1;
  double off = start.drawn ? start.sigma * drawn_error(cut, cuts) : sign * start.off;
  if (reference + off < 0 || reference + off > 1) off = -off;
  return SocPrior{std::clamp(reference + off, 0.0, 1.0), start.sigma};
}

/// Whether the run was inside two sigma again in time; nothing if it ended before the time was over.
std::optional<bool> recovered_in_time(const CutRun& run) {
  const double knee_s = run.knee_s ? *run.knee_s + after_knee_s : without_knee_s;
  if (run.recovered_s) return *run.recovered_s <= std::max(knee_s, without_knee_s);
  if (run.duration_s < std::min(knee_s, without_knee_s)) return std::nullopt;
  return false;
}

void sum_up(CutFigures& f, const std::vector<Errors>& errors) {
  std::vector<double> all_ratios, all_sigmas, after_knee;
  double rows = 0, recovered = 0, judged = 0;
  f.worst_inside = 1;
  for (std::size_t k = 0; k < f.runs.size(); ++k) {
    const CutRun& run = f.runs[k];
    const std::vector<double> r = ratios(errors[k]);
    all_ratios.insert(all_ratios.end(), r.begin(), r.end());
    all_sigmas.insert(all_sigmas.end(), errors[k].sigma.begin(), errors[k].sigma.end());
    for (std::size_t i = 0; i < 3; ++i) f.inside[i] += run.inside[i] * static_cast<double>(run.rows);
    rows += static_cast<double>(run.rows);
    f.worst_inside = std::min(f.worst_inside, run.inside[1]);
    for (std::size_t i = 0; i < cut_inside_limits.size(); ++i)
      f.cuts_below[i] += run.inside[1] < cut_inside_limits[i] ? 1 : 0;
    if (!std::isnan(run.rmse_after_knee)) after_knee.push_back(run.rmse_after_knee);
    if (const auto in_time = recovered_in_time(run)) {
      judged += 1;
      recovered += *in_time ? 1 : 0;
    }
  }
  for (std::size_t i = 0; i < 3; ++i) {
    f.inside[i] /= rows;
    std::vector<double> rmse;
    f.worst_rmse[i] = f.largest[i] = 0;
    for (const CutRun& run : f.runs) {
      if (std::isnan(run.rmse[i])) continue;
      rmse.push_back(run.rmse[i]);
      f.worst_rmse[i] = std::max(f.worst_rmse[i], run.rmse[i]);
      f.largest[i] = std::max(f.largest[i], run.largest[i]);
    }
    f.median_rmse[i] = measurement::median(rmse);
  }
  f.median_rmse_after_knee = measurement::median(after_knee);
  f.median_ratio = measurement::median(all_ratios);
  f.median_sigma = measurement::median(all_sigmas);
  f.recovered = judged > 0 ? recovered / judged : nothing;
}

/// Rows at which the recording is cut: equally spaced in time, each with a reference.
std::vector<std::size_t> cut_rows_of(const measurement::Recording& r, std::size_t cuts) {
  const double duration_s = r.duration_s(), start_s = r.time_s.front(),
               last_s = duration_s - std::min(last_cut_before_end_s, duration_s / 4);
  std::vector<std::size_t> rows;
  std::size_t row = 0;
  for (std::size_t k = 0; k < cuts; ++k) {
    const double at_s = start_s + last_s * static_cast<double>(k) / static_cast<double>(cuts);
    while (row + 1 < r.rows() && (r.time_s[row] < at_s || std::isnan(r.soc_ref[row]))) ++row;
    rows.push_back(row);
  }
  return rows;
}

}  // namespace

std::vector<double> ocv_knees(const model::CellParameters<>& p) {
  constexpr double side = 0.03, factor = 2.5;
  const auto ocv_v = [&](double soc) { return model::ocv_voltage(p.ocv, soc); };
  std::vector<double> knees;
  for (std::size_t k = 1; k + 1 < p.ocv.soc.size; ++k) {
    const double at = p.ocv.soc[k];
    if (at < side || at > 1 - side) continue;
    const double before = ocv_v(at) - ocv_v(at - side), after = ocv_v(at + side) - ocv_v(at);
    if (std::max(before, after) >= factor * std::min(before, after)) knees.push_back(at);
  }
  return knees;
}

CutResult run_cuts(const files::CellFile& cell, const measurement::Recording& recording, std::size_t cuts,
                   ScalarKind scalar) {
  if (recording.soc_ref.empty())
    throw files::BadInput(recording.path, 1, "no column soc_ref, expected a reference to judge the estimates by");
  const std::vector<measurement::Sample> all = measurement::samples(recording);
  const std::vector<std::size_t> first = cut_rows_of(recording, cuts);
  const std::vector<double> knees = ocv_knees(cell.parameters);
  std::vector<std::vector<Errors>> errors(cut_starts.size(), std::vector<Errors>(cuts));
  CutResult result{recording.path, cell.name, cuts, std::vector<CutFigures>(cut_starts.size())};
  for (std::size_t s = 0; s < cut_starts.size(); ++s) {
    result.starts[s].start = cut_starts[s];
    result.starts[s].runs.resize(cuts);
  }
  std::atomic<std::size_t> next{0};
  const auto work = [&] {
    for (std::size_t k = next++; k < cuts; k = next++) {
      const std::vector<measurement::Sample> rest(all.begin() + static_cast<std::ptrdiff_t>(first[k]), all.end());
      const std::optional<double> knee_s = first_knee_s(recording, first[k], knees);
      for (std::size_t s = 0; s < cut_starts.size(); ++s) {
        const auto prior = prior_of(cut_starts[s], k, cuts, recording.soc_ref[first[k]]);
        errors[s][k] =
            errors_of(recording, first[k], run_on_host(cell, rest, starting_point(prior), scalar, Timing::none).rows);
        CutRun& run = result.starts[s].runs[k];
        run = figures_of(errors[s][k], knee_s);
        run.from_s = recording.time_s[first[k]] - recording.time_s.front();
      }
    }
  };
  std::thread second(work);
  work();
  second.join();
  for (std::size_t s = 0; s < cut_starts.size(); ++s) {
    sum_up(result.starts[s], errors[s]);
    for (const Errors& e : errors[s]) {
      for (std::size_t k = 0; k < e.row.size(); ++k)
        add_to_groups(result.starts[s].calibration, recording, e.row[k], e.time_s[k], e.error[k],
                      std::max(e.sigma[k], least_sigma), cell.parameters.capacity_ah);
    }
  }
  return result;
}

std::string cut_heading() {
  return "| recording | start | median RMSE after 5, 30, 120 min, % | worst RMSE, % | largest error, % | after a knee, "
         "30 min, % | inside one, two, three sigma, % | worst cut, two sigma, % | cuts below 70, 90 % | median of "
         "error / sigma | median "
         "sigma, % | recovered in time, % |\n|---|---|---|---|---|---|---|---|---|---|---|---|\n";
}

std::string cut_rows(const CutResult& result) {
  const auto three = [](const std::array<double, 3>& v, const char* format) {
    std::string text;
    for (const double x : v) {
      text += text.empty() ? "" : ", ";
      text += std::isnan(x) ? "-" : fmt::format(fmt::runtime(format), 100 * x);
    }
    return text;
  };
  const std::string file = result.recording.substr(result.recording.find_last_of('/') + 1),
                    name = file.substr(0, file.find_last_of('.'));
  std::string rows;
  for (const CutFigures& f : result.starts) {
    rows += fmt::format(
        "| {} | {} | {} | {} | {} | {} | {} | {:.0f} | {}, {} of {} | {:.2f} | {:.2f} | {:.0f} |\n", name,
        f.start.title, three(f.median_rmse, "{:.2f}"), three(f.worst_rmse, "{:.1f}"), three(f.largest, "{:.1f}"),
        std::isnan(f.median_rmse_after_knee) ? "-" : fmt::format("{:.2f}", 100 * f.median_rmse_after_knee),
        three(f.inside, "{:.0f}"), 100 * f.worst_inside, f.cuts_below[0], f.cuts_below[1], f.runs.size(),
        f.median_ratio, 100 * f.median_sigma, 100 * f.recovered);
  }
  return rows;
}

std::string cut_summary(const std::vector<CutResult>& results) {
  std::string table =
      "| start | cuts | median RMSE after 5, 30, 120 min, % | inside one, two, three sigma, % | cuts below 70, 90 % | "
      "median of error / sigma | median sigma, % | recovered in time |\n|---|---|---|---|---|---|---|---|\n";
  for (std::size_t s = 0; s < cut_starts.size(); ++s) {
    std::array<std::vector<double>, 3> rmse, inside;
    std::vector<double> ratio, sigma;
    std::size_t judged = 0, recovered = 0;
    std::array<std::size_t, 2> below{};
    for (const CutResult& result : results) {
      for (const CutRun& run : result.starts[s].runs) {
        for (std::size_t i = 0; i < 3; ++i) {
          rmse[i].push_back(run.rmse[i]);
          inside[i].push_back(run.inside[i]);
        }
        ratio.push_back(run.median_ratio);
        sigma.push_back(run.median_sigma);
        const auto in_time = recovered_in_time(run);
        judged += in_time ? 1 : 0;
        recovered += in_time.value_or(false) ? 1 : 0;
        for (std::size_t i = 0; i < below.size(); ++i) below[i] += run.inside[1] < cut_inside_limits[i] ? 1 : 0;
      }
    }
    table += fmt::format(
        "| {} | {} | {:.2f}, {:.2f}, {:.2f} | {:.0f}, {:.0f}, {:.0f} | {}, {} | {:.2f} | {:.2f} | {} of {} |\n",
        cut_starts[s].title, ratio.size(), 100 * measurement::median(rmse[0]), 100 * measurement::median(rmse[1]),
        100 * measurement::median(rmse[2]), 100 * measurement::mean(inside[0]), 100 * measurement::mean(inside[1]),
        100 * measurement::mean(inside[2]), below[0], below[1], measurement::median(ratio),
        100 * measurement::median(sigma), recovered, judged);
  }
  return table;
}

}  // namespace bms::replay
