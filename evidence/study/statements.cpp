#include "study/statements.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>

#include <fmt/format.h>

#include "study/paper_tables.hpp"

namespace bms::study {

namespace {

constexpr std::size_t tf = 0, oe = 1, hw = hammerstein_wiener_model, grey = grey_box_model;

using Models = std::array<ModelObservation, models>;
using OfModels = std::function<Verdict(const Models&)>;
using OfCross = std::function<Verdict(const CrossObservation&)>;
using Judge = std::function<Verdict(const Observations&)>;

/// Judged only if all four models have a result.
Judge with_models(OfModels judge) {
  return [judge = std::move(judge)](const Observations& run) -> Verdict {
    Models all;
    for (std::size_t k = 0; k < models; ++k) {
      if (!run.model[k])
        return {std::nullopt, fmt::format("the {} has no result: {}", model_names[k], run.no_model[k])};
      all[k] = *run.model[k];
    }
    return judge(all);
  };
}

Judge with_cross(OfCross judge) {
  return [judge = std::move(judge)](const Observations& run) -> Verdict {
    if (!run.cross) return {std::nullopt, run.not_run};
    return judge(*run.cross);
  };
}

std::string four(const char* what, const Models& m, double ModelObservation::*value, double scale = 1) {
  return fmt::format("{}: {:.2f}, {:.2f}, {:.2f} and {:.2f}", what, scale * m[tf].*value, scale * m[oe].*value,
                     scale * m[hw].*value, scale * m[grey].*value);
}

bool highest(const Models& m, std::size_t model, double ModelObservation::*value) {
  for (std::size_t k = 0; k < models; ++k) {
    if (k != model && m[k].*value > m[model].*value) return false;
  }
  return true;
}

/// Nearly the best of the optimisers of a model.
Judge best_optimiser(std::size_t model, std::size_t method) {
  return [=](const Observations& run) -> Verdict {
    constexpr double same_points = 0.05;
    double best = -INFINITY;
    for (const auto& row : run.table4) {
      if (row[model]) best = std::max(best, *row[model]);
    }
    const auto own = run.table4[method][model];
    if (!own) return {std::nullopt, fmt::format("no result: {}", run.no_model[model])};
    return {*own >= best - same_points, fmt::format("{:.2f} %, the best {:.2f} %", *own, best)};
  };
}

Verdict steepest_descent_fails(const Observations& run) {
  const auto a = run.table4[steepest_descent][tf], b = run.table4[steepest_descent][oe];
  if (!a || !b) return {std::nullopt, "no result: " + run.no_model[a ? oe : tf]};
  return {*a < 0 && *b < 0, fmt::format("{:.2f} and {:.2f} %", *a, *b)};
}

Verdict any_optimiser(const Observations& run) {
  constexpr double well = 90;
  double least = INFINITY;
  for (const auto& row : run.table4) {
    if (!row[grey]) return {std::nullopt, "no result: " + run.no_model[grey]};
    least = std::min(least, *row[grey]);
  }
  return {least >= well, fmt::format("lowest fit {:.2f} %", least)};
}

bool close(double a, double b, double c, double factor) {
  const auto [least, most] = std::minmax({a, b, c});
  return least > 0 && most <= factor * least;
}

Verdict parameters_close(const Models& m) {
  constexpr double factor = 2;
  const bool holds = close(m[tf].r0_ohm, m[oe].r0_ohm, m[hw].r0_ohm, factor) &&
                     close(m[tf].r1_ohm, m[oe].r1_ohm, m[hw].r1_ohm, factor) &&
                     close(m[tf].c1_f, m[oe].c1_f, m[hw].c1_f, factor);
  return {holds,
          fmt::format("R0 {:.4f}, {:.4f}, {:.4f} ohm, R1 {:.4f}, {:.4f}, {:.4f} ohm, C1 {:.0f}, {:.0f}, {:.0f} F",
                      m[tf].r0_ohm, m[oe].r0_ohm, m[hw].r0_ohm, m[tf].r1_ohm, m[oe].r1_ohm, m[hw].r1_ohm, m[tf].c1_f,
                      m[oe].c1_f, m[hw].c1_f)};
}

Verdict in_bounds(const Models& m) {
  std::string outside;
  for (std::size_t k = 0; k < models; ++k) {
    if (!within_bounds(m[k]) || m[k].at_bound)
      outside += fmt::format("{}{}", outside.empty() ? "" : ", ", model_names[k]);
  }
  return {outside.empty(), outside.empty() ? "all are" : "not within: " + outside};
}

/// Mean over the other experiments, by row or by column.
std::array<double, paper_experiments> means_over_others(const CrossObservation& c, bool rows) {
  std::array<double, paper_experiments> mean{};
  for (std::size_t k = 0; k < paper_experiments; ++k) {
    for (std::size_t other = 0; other < paper_experiments; ++other) {
      if (other != k) mean[k] += (rows ? c.fit[k][other] : c.fit[other][k]) / (paper_experiments - 1);
    }
  }
  return mean;
}

Verdict diagonal_best(const CrossObservation& c) {
  constexpr int most_of_seven = 5;
  int best = 0;
  for (std::size_t column = 0; column < paper_experiments; ++column) {
    bool highest_here = true;
    for (std::size_t row = 0; row < paper_experiments; ++row)
      highest_here = highest_here && c.fit[row][column] <= c.fit[column][column];
    best += highest_here ? 1 : 0;
  }
  return {best >= most_of_seven, fmt::format("in {} of 7 columns", best)};
}

Verdict three_best(const CrossObservation& c) {
  const auto mean = means_over_others(c, true);
  auto sorted = mean;
  std::sort(sorted.rbegin(), sorted.rend());
  int among = 0;
  for (const std::size_t k : {1U, 3U, 5U}) among += mean[k] >= sorted[2] ? 1 : 0;
  return {among >= 2, fmt::format("{} of them", among)};
}

Verdict ocv_worst(const CrossObservation& c) {
  const auto rows = means_over_others(c, true), columns = means_over_others(c, false);
  const bool holds = rows[ocv_experiment] <= *std::min_element(rows.begin(), rows.end()) &&
                     columns[ocv_experiment] <= *std::min_element(columns.begin(), columns.end());
  return {holds, fmt::format("mean fits {:.1f} % as estimation, {:.1f} % as validation data", rows[ocv_experiment],
                             columns[ocv_experiment])};
}

Verdict burst_best(const CrossObservation& c) {
  const auto mean = means_over_others(c, true);
  const double best = *std::max_element(mean.begin(), mean.end());
  return {mean[burst_experiment] >= best, fmt::format("{:.2f} %, the best {:.2f} %", mean[burst_experiment], best)};
}

Verdict burst_86(const CrossObservation& c) {
  constexpr double fit = 86;
  constexpr int most_of_six = 4;
  int above = 0;
  for (std::size_t k = 0; k < paper_experiments; ++k)
    above += k != burst_experiment && c.fit[burst_experiment][k] > fit ? 1 : 0;
  return {above >= most_of_six, fmt::format("{} of 6", above)};
}

Verdict ocv_smallest_deviation(const CrossObservation& c) {
  int smallest = 0;
  for (std::size_t p = 0; p < 3; ++p) {
    bool holds = true;
    for (std::size_t k = 0; k < ocv_experiment; ++k)
      holds = holds && c.deviation[ocv_experiment][p] <= c.deviation[k][p];
    smallest += holds ? 1 : 0;
  }
  return {smallest == 3, fmt::format("of {} of the 3 parameters", smallest)};
}

Verdict ocv_largest_variance(const CrossObservation& c) {
  const double largest = *std::max_element(c.output_sd_v.begin(), c.output_sd_v.end());
  return {c.output_sd_v[ocv_experiment] >= largest,
          fmt::format("{:.2f} mV, the largest {:.2f} mV", 1e3 * c.output_sd_v[ocv_experiment], 1e3 * largest)};
}

Verdict c1_largest(const CrossObservation& c) {
  constexpr int most_of_seven = 5;
  int largest = 0;
  for (std::size_t k = 0; k < paper_experiments; ++k) {
    const auto relative = [&](std::size_t p) { return c.deviation[k][p] / c.value[k][p]; };
    largest += relative(2) >= relative(0) && relative(2) >= relative(1) ? 1 : 0;
  }
  return {largest >= most_of_seven, fmt::format("in {} of 7", largest)};
}

Verdict burst_unbiased(const CrossObservation& c) {
  constexpr double largest_v = 0.050;
  return {std::abs(c.burst_bias_v) <= c.burst_band_v && c.burst_largest_v <= largest_v,
          fmt::format("mean {:.2f} mV, band {:.2f} mV, largest {:.1f} mV", 1e3 * c.burst_bias_v, 1e3 * c.burst_band_v,
                      1e3 * c.burst_largest_v)};
}

Verdict soc_found(const Observations& run, bool from_test) {
  constexpr double wrong = 0.05;
  if (!run.initial_soc) return {std::nullopt, run.not_run};
  const InitialSocObservation& s = *run.initial_soc;
  const double found = from_test ? s.from_ocv_test : s.from_bursts, truth = from_test ? s.of_ocv_test : s.of_bursts;
  const bool is_right = std::abs(found - truth) < wrong;
  return {from_test ? is_right : !is_right, fmt::format("{:.1f} % for {:.1f} %", 100 * found, 100 * truth)};
}

Verdict of_ocv(const Observations& run, bool polynomial) {
  constexpr double properly_v = 0.003;
  if (!run.ocv) return {std::nullopt, run.not_run};
  const OcvObservation& o = *run.ocv;
  return {polynomial ? o.polynomial_v > o.pieces_v : o.pieces_v < properly_v,
          fmt::format("look-up {:.2f}, polynomial {:.2f}, pieces {:.2f} mV", 1e3 * o.look_up_v, 1e3 * o.polynomial_v,
                      1e3 * o.pieces_v)};
}

/// The four models, those with a delay replaced by those without.
Judge without_delay(OfModels judge) {
  return [judge = std::move(judge)](const Observations& run) -> Verdict {
    const WithoutDelay& w = run.without_delay;
    if (!w.output_error || !w.hammerstein_wiener) return {std::nullopt, w.why_not.empty() ? run.not_run : w.why_not};
    Observations instead = run;
    instead.model[oe] = w.output_error;
    instead.model[hw] = w.hammerstein_wiener;
    return with_models(judge)(instead);
  };
}

constexpr auto estimation_fit = &ModelObservation::estimation_fit, validation_fit = &ModelObservation::validation_fit,
               estimation_v = &ModelObservation::estimation_rmse_v, validation_v = &ModelObservation::validation_rmse_v;

Verdict hw_best(const Models& m) {
  return {highest(m, hw, estimation_fit), four("estimation fit, %", m, estimation_fit)};
}

Verdict linear_larger(const Models& m) {
  return {std::min(m[tf].*estimation_v, m[oe].*estimation_v) > std::max(m[hw].*estimation_v, m[grey].*estimation_v),
          four("estimation RMSE, mV", m, estimation_v, 1e3)};
}

void add_model_judges(std::map<std::string, Judge>& all) {
  const auto add = [&](const char* id, OfModels judge) { all.emplace(id, with_models(std::move(judge))); };
  add("grey_box_best_validation", [](const Models& m) -> Verdict {
    return {highest(m, grey, validation_fit), four("validation fit, %", m, validation_fit)};
  });
  add("hw_best_estimation", hw_best);
  add("oe_above_tf", [](const Models& m) -> Verdict {
    return {m[oe].estimation_fit > m[tf].estimation_fit && m[oe].validation_fit > m[tf].validation_fit,
            fmt::format("{:.2f} and {:.2f} % against {:.2f} and {:.2f} %", m[oe].estimation_fit, m[oe].validation_fit,
                        m[tf].estimation_fit, m[tf].validation_fit)};
  });
  add("tf_inaccurate", [](const Models& m) -> Verdict {
    constexpr double good = 80;
    return {m[tf].estimation_fit < good && m[tf].validation_fit < good,
            fmt::format("{:.2f} and {:.2f} %", m[tf].estimation_fit, m[tf].validation_fit)};
  });
  add("hw_loses_on_validation", [](const Models& m) -> Verdict {
    bool most = true;
    const auto loss = [&](std::size_t k) { return m[k].estimation_fit - m[k].validation_fit; };
    for (std::size_t k = 0; k < models; ++k) most = most && loss(k) <= loss(hw);
    return {most,
            fmt::format("losses {:.1f}, {:.1f}, {:.1f} and {:.1f} points", loss(tf), loss(oe), loss(hw), loss(grey))};
  });
  add("grey_box_close_to_hw", [](const Models& m) -> Verdict {
    constexpr double close_points = 5;
    const double difference = m[grey].estimation_fit - m[hw].estimation_fit;
    return {std::abs(difference) < close_points, fmt::format("{:+.2f} points", difference)};
  });
  add("validation_errors_larger", [](const Models& m) -> Verdict {
    bool larger = true;
    for (const ModelObservation& one : m) larger = larger && one.validation_rmse_v > one.estimation_rmse_v;
    return {larger, four("validation RMSE, mV", m, validation_v, 1e3)};
  });
  add("nonlinear_unbiased", [](const Models& m) -> Verdict {
    const auto unbiased = [&](std::size_t k) { return std::abs(m[k].bias_v) <= m[k].bias_band_v; };
    return {unbiased(hw) && unbiased(grey),
            fmt::format("means {:.2f} and {:.2f} mV", 1e3 * m[hw].bias_v, 1e3 * m[grey].bias_v)};
  });
  add("linear_larger_error", linear_larger);
  add("oe_and_grey_box_best", [](const Models& m) -> Verdict {
    return {std::max(m[oe].*validation_v, m[grey].*validation_v) < std::min(m[tf].*validation_v, m[hw].*validation_v),
            four("validation RMSE, mV", m, validation_v, 1e3)};
  });
  add("one_step_grey_box_best", [](const Models& m) -> Verdict {
    return {highest(m, grey, &ModelObservation::one_step_fit),
            four("one-step fit, %", m, &ModelObservation::one_step_fit)};
  });
  add("linear_parameters_close", parameters_close);
  add("parameters_in_bounds", in_bounds);
}

std::map<std::string, Judge> judges() {
  std::map<std::string, Judge> all;
  add_model_judges(all);
  all.emplace("hw_best_estimation_without_delay", without_delay(hw_best));
  all.emplace("linear_larger_error_without_delay", without_delay(linear_larger));
  all.emplace("nls_best_tf", best_optimiser(tf, trust_region));
  all.emplace("nls_best_oe", best_optimiser(oe, trust_region));
  all.emplace("lm_best_hw", best_optimiser(hw, levenberg_marquardt));
  all.emplace("nls_best_grey_box", best_optimiser(grey, trust_region));
  all.emplace("sd_fails_linear", steepest_descent_fails);
  all.emplace("grey_box_any_optimiser", any_optimiser);
  for (const auto& [id, judge] : std::initializer_list<std::pair<const char*, Verdict (*)(const CrossObservation&)>>{
           {"diagonal_best", diagonal_best},
           {"three_designs_best", three_best},
           {"ocv_test_worst", ocv_worst},
           {"burst_best", burst_best},
           {"burst_86", burst_86},
           {"ocv_smallest_deviation", ocv_smallest_deviation},
           {"ocv_largest_variance", ocv_largest_variance},
           {"c1_largest_deviation", c1_largest},
           {"burst_unbiased", burst_unbiased}})
    all.emplace(id, with_cross(judge));
  all.emplace("soc_found_from_ocv_test", [](const Observations& run) { return soc_found(run, true); });
  all.emplace("soc_not_found_from_bursts", [](const Observations& run) { return soc_found(run, false); });
  all.emplace("polynomial_less_accurate", [](const Observations& run) { return of_ocv(run, true); });
  all.emplace("pieces_sufficient", [](const Observations& run) { return of_ocv(run, false); });
  return all;
}

}  // namespace

const std::vector<Statement>& statements() {
  static const std::vector<Statement> all = [] {
    std::vector<Statement> list;
    for (const auto& row : text_table("statements").rows()) list.push_back({row[0], row[1], row[2], row[3]});
    return list;
  }();
  return all;
}

Verdict judge(const std::string& id, const Observations& run) {
  static const std::map<std::string, Judge> all = judges();
  return all.at(id)(run);
}

Share share_of(std::size_t holds, std::size_t judged) {
  constexpr double z = 1.959964;  // 95 %
  Share share{holds, judged, 0, 1};
  if (judged == 0) return share;
  const double n = static_cast<double>(judged), p = static_cast<double>(holds) / n;
  const double middle = (p + z * z / (2 * n)) / (1 + z * z / n);
  const double half = z * std::sqrt(p * (1 - p) / n + z * z / (4 * n * n)) / (1 + z * z / n);
  share.low = std::max(0.0, middle - half);
  share.high = std::min(1.0, middle + half);
  return share;
}

}  // namespace bms::study
