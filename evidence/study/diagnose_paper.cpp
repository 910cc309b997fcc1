#include "study/diagnose_paper.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <numeric>

#include <fmt/format.h>

#include "numerics/in_parallel.hpp"
#include "study/paper_fit.hpp"

namespace bms::study {

namespace {

constexpr double z = 1.959964;  // 95 %
using Clock = std::chrono::steady_clock;

std::vector<double> ranks(const std::vector<double>& values) {
  std::vector<std::size_t> order(values.size());
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return values[a] < values[b]; });
  std::vector<double> rank(values.size());
  for (std::size_t from = 0; from < order.size();) {
    std::size_t to = from;
    while (to < order.size() && values[order[to]] == values[order[from]]) ++to;
    for (std::size_t k = from; k < to; ++k) rank[order[k]] = static_cast<double>(from + to - 1) / 2;
    from = to;
  }
  return rank;
}

double median(std::vector<double> values) {
  if (values.empty()) return 0;
  std::sort(values.begin(), values.end());
  const std::size_t n = values.size();
  return n % 2 == 1 ? values[n / 2] : (values[n / 2 - 1] + values[n / 2]) / 2;
}

Table7Match match_of(const std::vector<Figure>& simulated, const std::vector<Figure>& published) {
  std::vector<double> a, b, off_a, off_b, gaps;
  for (std::size_t k = 0; k < paper_experiments * paper_experiments; ++k) {
    a.push_back(simulated[k].value);
    b.push_back(published[k].value);
    gaps.push_back(std::abs(a.back() - b.back()));
    if (k / paper_experiments == k % paper_experiments) continue;
    off_a.push_back(a.back());
    off_b.push_back(b.back());
  }
  return {rank_correlation(a, b), rank_correlation(off_a, off_b), median(gaps)};
}

/// A fitted candidate.
struct Fitted {
  Effects effects;
  Eigen::VectorXd x;
  std::vector<Figure> simulated;
  CandidateFit summary;
};

Fitted fitted(const model::CellParameters<>& cell, const Effects& effects, const PaperDiagnosisOptions& options) {
  const PaperFit fit(cell, effects, options.published);
  Fitted out{effects, {}, {}, {}};
  const std::vector<bool> all(fit.published().size(), true);
  out.x = fit.fit(fit.start(), all, options.iterations);
  out.simulated = fit.simulate(out.x);
  out.summary = {effects, fit.unknowns().size(), fit.score(out.simulated), 0, match_of(out.simulated, fit.published())};
  return out;
}

/// A part of the figures that a refit does not see, and the tables that it predicts.
struct Split {
  std::vector<std::string> tables;
  std::string from;
  std::vector<bool> used;
};

std::vector<Split> splits_of(const std::vector<Figure>& published) {
  std::vector<Split> all;
  const auto using_groups = [&](const auto& accepts) {
    std::vector<bool> used;
    for (const Figure& f : published) used.push_back(accepts(f.group));
    return used;
  };
  for (std::size_t g = 0; g < figure_group_names.size(); ++g) {
    const auto other = [&](FigureGroup group) { return static_cast<std::size_t>(group) != g; };
    all.push_back({{figure_group_names[g]}, "all other tables", using_groups(other)});
  }
  for (const std::size_t parity : {0U, 1U}) {
    Split half{{fmt::format("7, {} cells", parity == 0 ? "even" : "odd")}, "its other cells and all other figures", {}};
    for (std::size_t k = 0; k < published.size(); ++k)
      half.used.push_back(published[k].group != FigureGroup::table7 || k % 2 != parity);
    all.push_back(std::move(half));
  }
  Split off_diagonal{{"7, off the diagonal"}, "its diagonal and all other tables", {}};
  for (std::size_t k = 0; k < published.size(); ++k)
    off_diagonal.used.push_back(published[k].group != FigureGroup::table7 ||
                                k / paper_experiments == k % paper_experiments);
  all.push_back(std::move(off_diagonal));
  all.push_back({{"8", "6"}, "Table 7 alone", using_groups([](FigureGroup g) { return g == FigureGroup::table7; })});
  all.push_back({{"7"}, "Tables 6 and 8 alone", using_groups([](FigureGroup g) {
                   return g == FigureGroup::table8 || g == FigureGroup::table6;
                 })});
  return all;
}

/// Is this figure of the table, and not used by the fit?
bool judged_by(const std::string& table, const Split& split, const Figure& f, std::size_t k) {
  return !split.used[k] && table.substr(0, 1) == figure_group_names[static_cast<std::size_t>(f.group)];
}

HeldOut held_out(const std::vector<Figure>& simulated, const std::vector<Figure>& published, const std::string& table,
                 const Split& split) {
  const std::vector<double> d = differences(simulated, published);
  HeldOut out{table, split.from, std::nullopt, std::nullopt, 0};
  constexpr std::size_t table8_columns = 4;
  std::vector<std::vector<double>> a(table8_columns), b(table8_columns);
  std::vector<double> gaps;
  double squares = 0, count = 0;
  for (std::size_t k = 0; k < published.size(); ++k) {
    const Figure& f = published[k];
    if (!judged_by(table, split, f, k)) continue;
    squares += d[k] * d[k];
    ++count;
    if (f.is_fit) gaps.push_back(std::abs(simulated[k].value - f.value));
    const bool table8 = f.group == FigureGroup::table8;
    const std::size_t column = table8 ? (k - paper_experiments * paper_experiments) % table8_columns : 0;
    if (!table8 && f.group != FigureGroup::table7) continue;
    a[column].push_back(simulated[k].value);
    b[column].push_back(f.value);
  }
  double sum = 0, columns = 0;
  for (std::size_t c = 0; c < table8_columns; ++c) {
    if (a[c].empty()) continue;
    sum += rank_correlation(a[c], b[c]);
    ++columns;
  }
  if (columns > 0) out.rank_correlation = sum / columns;
  if (!gaps.empty()) out.median_gap_points = median(gaps);
  out.typical_ratio = std::exp(std::sqrt(squares / std::max(1.0, count)));
  return out;
}

/// What one candidate predicts of the figures that a refit did not see.
class Predictions {
 public:
  /// only_table7: rows of other tables stay empty.
  Predictions(const model::CellParameters<>& cell, const Effects& effects, const PaperDiagnosisOptions& options,
              bool only_table7)
      : fit_(cell, effects, options.published), options_(&options), splits_(splits_of(fit_.published())) {
    simulated_.resize(splits_.size());
    for (std::size_t k = 0; k < splits_.size(); ++k) {
      if (!only_table7 || splits_[k].tables.front().starts_with("7")) wanted_.push_back(k);
    }
    std::stable_partition(wanted_.begin(), wanted_.end(), [&](std::size_t k) { return without_table7(splits_[k]); });
  }

  /// The long ones first.
  std::size_t refits() const { return wanted_.size(); }
  /// Searches from the beginning: the optimum of all figures would know what is left out.
  void refit(std::size_t number) {
    const Split& split = splits_[wanted_[number]];
    const int points = without_table7(split) ? options_->screening_points : 0;
    simulated_[wanted_[number]] = fit_.simulate(fit_.searched(split.used, points, options_->iterations));
  }
  /// By table, predicted from all others.
  std::vector<std::vector<Figure>> tables_left_out() const {
    return {simulated_.begin(), simulated_.begin() + figure_group_names.size()};
  }
  std::vector<HeldOut> results() const {
    std::vector<HeldOut> out;
    for (std::size_t k = 0; k < splits_.size(); ++k) {
      for (const std::string& table : splits_[k].tables) {
        out.push_back(simulated_[k].empty() ? HeldOut{table, splits_[k].from, std::nullopt, std::nullopt, 0}
                                            : held_out(simulated_[k], fit_.published(), table, splits_[k]));
      }
    }
    return out;
  }

 private:
  static bool without_table7(const Split& split) { return !split.used.front() && !split.used[1]; }

  PaperFit fit_;
  const PaperDiagnosisOptions* options_;
  std::vector<Split> splits_;
  std::vector<std::vector<Figure>> simulated_;  ///< by split
  std::vector<std::size_t> wanted_;             ///< splits, in the order of the refits
};

std::vector<Contradiction> contradictions_of(const std::vector<Figure>& simulated,
                                             const std::vector<Figure>& published) {
  constexpr std::size_t shown = 8;
  const std::vector<double> d = differences(simulated, published);
  std::vector<std::size_t> order(d.size());
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return std::abs(d[a]) > std::abs(d[b]); });
  std::vector<Contradiction> out;
  for (std::size_t k = 0; k < shown; ++k) {
    const Figure& f = published[order[k]];
    const char* table = figure_group_names[static_cast<std::size_t>(f.group)];
    out.push_back({fmt::format("{} {}, {}", f.group == FigureGroup::appendix_a ? "Appendix" : "Table", table, f.name),
                   f.value, simulated[order[k]].value});
  }
  return out;
}

std::vector<EffectVerdict> verdicts_of(const std::vector<CandidateFit>& candidates) {
  constexpr double sure = 0.95;
  std::vector<EffectVerdict> verdicts;
  for (const auto& [effect, has] :
       {std::pair{"hysteresis", &Effects::hysteresis}, std::pair{"a slow polarisation", &Effects::slow_polarisation},
        std::pair{"another OCV than its model", &Effects::other_ocv}}) {
    double with = INFINITY, without = INFINITY;  // scores
    for (const CandidateFit& c : candidates) {
      double& least = c.effects.*has ? with : without;
      least = std::min(least, c.score);
    }
    if (!std::isfinite(with) || !std::isfinite(without)) continue;
    const double probability = 1 / (1 + std::exp(with - without));
    EffectVerdict verdict{effect, probability, std::nullopt};
    if (probability > sure) verdict.present = true;
    if (probability < 1 - sure) verdict.present = false;
    verdicts.push_back(verdict);
  }
  return verdicts;
}

/// What the figures ask for, and what they leave open.
std::string verdict_text(const std::vector<EffectVerdict>& verdicts) {
  std::string text;
  for (const EffectVerdict& v : verdicts) {
    const char* verb = "do not decide whether it has";
    if (v.present) verb = *v.present ? "ask for" : "do not ask for";
    text += fmt::format(" The figures {} {} (probability {:.2f}).", verb, v.effect, v.probability);
  }
  return text;
}

std::string statement_of(const PaperDiagnosis& d) {
  const CandidateFit& best = d.candidates.front();
  const bool reached = best.table7.rank_correlation >= 0.75 && best.table7.median_gap_points <= 6;
  std::string text = fmt::format(
      "The published figures agree best with a cell that has {}. Table 7 then has a rank correlation of {:.2f} and a "
      "median gap of {:.1f} points; the equations of the paper alone reach {:.2f} and {:.1f} points.",
      best.effects.name(), best.table7.rank_correlation, best.table7.median_gap_points, d.plain.table7.rank_correlation,
      d.plain.table7.median_gap_points);
  text += verdict_text(d.effects);
  if (!reached) text += " Part of the pattern remains unexplained.";
  for (std::size_t k = 0; k < d.held_out.size() && k < d.held_out_plain.size(); ++k) {
    if (d.held_out[k].table != figure_group_names.front()) continue;
    if (d.held_out[k].rank_correlation > d.held_out_plain[k].rank_correlation) continue;
    text += fmt::format(" From {}, it predicts Table 7 no better than these equations.", d.held_out[k].from);
  }
  return text;
}

}  // namespace

std::string Effects::name() const {
  std::string text;
  const auto add = [&](bool has, const char* what) {
    if (has) text += (text.empty() ? "" : " and ") + std::string(what);
  };
  add(hysteresis, "hysteresis");
  add(slow_polarisation, "a slow polarisation");
  add(other_ocv, "another OCV than its model (Tables 1 and 9 differ)");
  if (text.empty()) text = "no effect beyond the equations of the paper";
  return text + (whole_ocv ? "; models that know the OCV over the whole range" : "");
}

double rank_correlation(const std::vector<double>& a, const std::vector<double>& b) {
  const std::vector<double> x = ranks(a), y = ranks(b);
  const auto n = static_cast<double>(x.size());
  const double middle = (n - 1) / 2;
  double xy = 0, xx = 0, yy = 0;
  for (std::size_t k = 0; k < x.size(); ++k) {
    xy += (x[k] - middle) * (y[k] - middle);
    xx += (x[k] - middle) * (x[k] - middle);
    yy += (y[k] - middle) * (y[k] - middle);
  }
  return xx > 0 && yy > 0 ? xy / std::sqrt(xx * yy) : 0;
}

std::vector<Effects> all_effects() {
  constexpr Effects none, hysteresis{true, false, false, false}, slow{false, true, false, false},
      both{true, true, false, false}, slow_and_ocv{false, true, true, false};
  return {both, slow_and_ocv, slow, hysteresis, none, {true, true, false, true}, {false, false, false, true}};
}

namespace {

bool is_plain(const Effects& e) { return !e.hysteresis && !e.slow_polarisation && !e.other_ocv && !e.whole_ocv; }

void set_candidates(const std::vector<Fitted>& best_first, PaperDiagnosis& d) {
  const double least = best_first.front().summary.score;
  double sum = 0;
  for (const Fitted& f : best_first) sum += std::exp(least - f.summary.score);
  for (const Fitted& f : best_first) {
    d.candidates.push_back(f.summary);
    d.candidates.back().weight = std::exp(least - f.summary.score) / sum;
    if (is_plain(f.effects)) d.plain = d.candidates.back();
  }
}

void set_physics(const PaperFit& fit, const Eigen::VectorXd& x, PaperDiagnosis& d) {
  const Eigen::VectorXd deviation = fit.deviation(x, std::vector<bool>(fit.published().size(), true));
  for (std::size_t k = 0; k < fit.unknowns().size(); ++k) {
    const auto at = static_cast<Eigen::Index>(k);
    const PaperUnknown& u = fit.unknowns()[k];
    d.physics.push_back({u.id, std::exp(x[at]), std::max(u.low, std::exp(x[at] - z * deviation[at])),
                         std::min(u.high, std::exp(x[at] + z * deviation[at])), u.unit});
  }
}

}  // namespace

PaperDiagnosis diagnose_paper(const model::CellParameters<>& cell, const PaperDiagnosisOptions& options) {
  const auto begin = Clock::now();
  const auto plain = std::find_if(options.candidates.begin(), options.candidates.end(), is_plain);
  if (plain == options.candidates.end()) throw std::invalid_argument("no candidate without effects");
  Predictions of_plain(cell, *plain, options, true);
  std::vector<Fitted> all(options.candidates.size());
  // the refits of the plain candidate do not wait for the best one
  const std::size_t early = options.hold_out ? of_plain.refits() : 0;
  numerics::in_parallel(early + all.size(), [&](std::size_t k) {
    if (k < early) {
      of_plain.refit(k);
    } else {
      all[k - early] = fitted(cell, options.candidates[k - early], options);
    }
  });
  std::sort(all.begin(), all.end(), [](const Fitted& a, const Fitted& b) { return a.summary.score < b.summary.score; });
  const Fitted& best = all.front();
  PaperDiagnosis d;
  set_candidates(all, d);
  d.effects = verdicts_of(d.candidates);
  const PaperFit fit(cell, best.effects, options.published);
  Predictions of_best(cell, best.effects, options, false);
  const std::size_t late = options.hold_out ? of_best.refits() : 0;
  numerics::in_parallel(late + 1, [&](std::size_t k) {
    if (k < late) {
      of_best.refit(k);
    } else {
      set_physics(fit, best.x, d);
    }
  });
  if (options.hold_out) {
    d.held_out = of_best.results();
    d.held_out_plain = of_plain.results();
  }
  d.simulated = best.simulated;
  d.contradictions = contradictions_of(best.simulated, fit.published());
  d.misfits = table_misfits(best.simulated, of_best.tables_left_out(), fit.published());
  d.statement = statement_of(d) + " " + reconciliation_text(d.misfits);
  d.seconds = std::chrono::duration<double>(Clock::now() - begin).count();
  return d;
}

}  // namespace bms::study
