#include "study/paper_figures.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <Eigen/Dense>

#include "identification/goodness_of_fit.hpp"
#include "identification/rest_reading.hpp"
#include "study/paper_tables.hpp"

namespace bms::study {

namespace {

constexpr std::array<const char*, 3> circuit = {"r0_ohm", "r1_ohm", "c1_f"};
constexpr double read_soc = 0.8;
constexpr int scales = 3;

/// What a source of the figures has to give, published or simulated.
struct Source {
  std::array<std::array<double, paper_experiments>, paper_experiments> fit{};
  std::array<std::array<double, 4>, paper_experiments> deviation{};  ///< R0, R1, C1, output
  std::array<double, 3> ocv_circuit{}, appendix{};                   ///< R0, R1, C1
  double estimation_fit = 0, validation_fit = 0;
};

/// Designs with rests, bursts, OCV test.
int scale_of(std::size_t experiment) {
  constexpr std::size_t with_rests = 3;
  if (experiment == ocv_experiment) return scales;
  return experiment < with_rests ? 1 : 2;
}

std::vector<Figure> listed(const Source& s) {
  std::vector<Figure> all;
  for (std::size_t row = 0; row < paper_experiments; ++row) {
    for (std::size_t column = 0; column < paper_experiments; ++column) {
      all.push_back({FigureGroup::table7, fmt::format("{} on {}", experiment_names[row], experiment_names[column]),
                     s.fit[row][column], true, 0});
    }
  }
  for (std::size_t row = 0; row < paper_experiments; ++row) {
    for (std::size_t k = 0; k < 4; ++k) {
      const bool output = k == 3;
      all.push_back({FigureGroup::table8,
                     fmt::format("{} of {}", output ? "output" : circuit[k], experiment_names[row]),
                     s.deviation[row][k], false, output ? 0 : scale_of(row)});
    }
  }
  for (std::size_t k = 0; k < 3; ++k) all.push_back({FigureGroup::table6, circuit[k], s.ocv_circuit[k], false, 0});
  all.push_back({FigureGroup::table5, "estimation", s.estimation_fit, true, 0});
  all.push_back({FigureGroup::table5, "validation", s.validation_fit, true, 0});
  for (std::size_t k = 0; k < 3; ++k) all.push_back({FigureGroup::appendix_a, circuit[k], s.appendix[k], false, 0});
  return all;
}

/// The circuit by the points of Appendix A at the rest nearest to 80 %.
std::array<double, 3> appendix_of(const StudyData& test) {
  double soc = test.soc_from, nearest = 1;
  std::array<double, 3> found{};
  const id::RestReadings readings = id::read_rests(test.data);
  std::size_t k = 0;
  for (const id::RestReading& rest : readings.rests) {
    for (; k + 1 < test.data.size() && test.data.time_s[k + 1] <= rest.time_s; ++k)
      soc += test.data.current_a[k + 1] * (test.data.time_s[k + 1] - test.data.time_s[k]) /
             (3'600 * test.data.capacity_ah);
    if (std::abs(soc - read_soc) > nearest) continue;
    nearest = std::abs(soc - read_soc);
    found = {rest.points.r0_ohm, rest.points.r1_ohm, rest.points.c1_f};
  }
  return found;
}

TwoLevels levels_of(std::size_t experiment, const PulseDesigns& p) {
  constexpr double one_c_a = 6;
  constexpr std::array<double, 3> rest_s = {30, 18, 5}, high_s = {60, 30, 30}, low_s = {30, 30, 60};
  if (experiment < rest_s.size()) return {-one_c_a * p.pulse_c_rate, p.pulse_s, 0, rest_s[experiment], p.duration_s};
  const std::size_t k = experiment - rest_s.size();
  const double high_a = -one_c_a * p.high_c_rate;
  return {high_a, high_s[k], high_a * (1 - p.swing), low_s[k], p.duration_s};
}

/// The paper estimates both initial states of every data set (3.2.4, 4.2, title of Table 8).
id::DataSet with_free_states(const StudyData& part) {
  id::DataSet set = data_set(part);
  set.estimate_initial_soc = true;
  return set;
}

id::GreyBoxOptions one_node(double soc) {
  id::GreyBoxOptions options;
  options.soc_nodes = {soc};
  options.one_start = true;
  return options;
}

/// The grey box of one data set, from the paper's start with its limit of iterations.
struct FromData {
  id::Identification found;
  std::array<double, 3> unit_deviation{};  ///< of R0, R1, C1 for a white noise of 1 V in samples every second

  FromData(const model::CellParameters<>& given, const StudyData& part) {
    model::CellParameters<> start = given;
    for (std::size_t k = 0; k < start.rc.soc.size; ++k) {
      start.rc.r0_ohm[k] = paper_start.r0_ohm;
      start.rc.r1_ohm[k] = paper_start.r1_ohm;
      start.rc.c1_f[k] = paper_start.c1_f;
    }
    id::Stopping stopping;
    stopping.iterations = paper_iterations;
    stopping.cost = 1e-7;  // figures are printed with four digits
    stopping.step = 1e-5;
    found = id::identify_grey_box(start, {with_free_states(part)}, one_node(part.middle_soc()),
                                  id::Method::trust_region_reflective, stopping);
    set_deviation(part);
  }

  /// Fit to other data, whose initial states are fitted from those that its own model has.
  double fit_to(const StudyData& part, const id::InitialState& own) const {
    const id::GreyBox grey_box(found.cell, {with_free_states(part)}, one_node(found.cell.rc.soc[0]));
    const id::LeastSquares problem = grey_box.problem();
    constexpr int steps = 3;              // the voltage is linear in v_rc and, within a piece of the OCV, in SOC
    constexpr double same_points = 0.01;  // of a fit
    Eigen::VectorXd x = grey_box.start(), residuals;
    x.tail(2) = Eigen::Vector2d{own.v_rc_v, own.soc};
    Eigen::MatrixXd jacobian;
    if (!problem.evaluate(x, residuals, &jacobian)) return -INFINITY;
    const Eigen::MatrixXd by_states = jacobian.rightCols(2);
    const auto squares = (by_states.transpose() * by_states).completeOrthogonalDecomposition();
    double best = percent(part, residuals);
    for (int k = 0; k < steps; ++k) {
      const Eigen::Vector2d step = squares.solve(by_states.transpose() * residuals);
      x.tail(2) = (x.tail(2) - step).cwiseMax(problem.lower.tail(2)).cwiseMin(problem.upper.tail(2));
      if (!problem.evaluate(x, residuals, nullptr)) break;
      const double now = percent(part, residuals), before = best;
      best = std::max(best, now);
      if (now < before + same_points) break;
    }
    return best;
  }

 private:
  static double percent(const StudyData& part, const Eigen::VectorXd& residuals) {
    id::FitFigure fit;
    for (Eigen::Index row = 0; row < residuals.size(); ++row) {
      const double v = part.data.voltage_v[static_cast<std::size_t>(row)];
      fit.add(v, v + residuals[row]);
    }
    return fit.percent();
  }

  /// Parameters at a bound have a deviation here, too.
  void set_deviation(const StudyData& part) {
    const id::GreyBox grey_box(found.cell, {with_free_states(part)}, one_node(found.cell.rc.soc[0]));
    Eigen::VectorXd residuals;
    Eigen::MatrixXd jacobian;
    if (!grey_box.problem().evaluate(found.optimum.x, residuals, &jacobian)) return;
    const Eigen::VectorXd norm = jacobian.colwise().norm().cwiseMax(1e-300);
    const Eigen::MatrixXd scaled = jacobian * norm.cwiseInverse().asDiagonal();
    const Eigen::MatrixXd inverse = (scaled.transpose() * scaled).completeOrthogonalDecomposition().pseudoInverse();
    const double step_s = part.data.time_s[1] - part.data.time_s[0];
    for (Eigen::Index k = 0; k < 3; ++k)
      unit_deviation[static_cast<std::size_t>(k)] = std::sqrt(std::max(0.0, inverse(k, k)) / step_s) / norm[k];
  }
};

/// Finite and of a size that a logarithm can have.
double sane(double value) { return std::isfinite(value) ? std::max(value, 1e-9) : 1e-9; }

}  // namespace

std::vector<Figure> published_figures() {
  Source s;
  for (std::size_t row = 0; row < paper_experiments; ++row) {
    for (std::size_t k = 0; k < paper_experiments; ++k) s.fit[row][k] = paper_table(7).at(row, k);
    for (std::size_t k = 0; k < 4; ++k) s.deviation[row][k] = paper_table(8).at(row, k);
  }
  for (std::size_t k = 0; k < 3; ++k) s.ocv_circuit[k] = paper_table(6).at(grey_box_model, k);
  s.estimation_fit = paper_table(5).at(grey_box_model, 0);
  s.validation_fit = paper_table(5).at(grey_box_model, 1);
  s.appendix = {paper_start.r0_ohm, paper_start.r1_ohm, paper_start.c1_f};
  return listed(s);
}

std::vector<Figure> figures_of(const model::CellParameters<>& cell, const PaperCandidate& candidate, PlantRuns& runs) {
  constexpr double pulse_soc = 0.41, ocv_soc = 0.4;
  constexpr int ocv_steps = 10;
  Bench bench = candidate.bench;
  Source s;
  const StudyData test = run_ocv_test(ocv_steps, bench, candidate.seed, false, &runs);
  model::CellParameters<> given = cell;
  model::OcvTable<double>& ocv = given.ocv;
  ocv = id::even_pieces(points_of(id::rested_voltages(test.data, 1), id::OcvDirection::discharge));
  if (candidate.other_ocv) {
    for (std::size_t k = 0; k < ocv.b0_v.size; ++k) {
      ocv.b0_v[k] = paper_table(1).at(k, 0);
      ocv.b1_v[k] = paper_table(1).at(k, 1);
    }
  }
  const StudyData estimation = window(test, "", 0.8, 0.5), validation = window(test, "", 0.5, 0.2);
  const FromData from_test(given, estimation);
  for (std::size_t k = 0; k < 3; ++k) s.ocv_circuit[k] = from_test.found.parameters[k].value;
  s.estimation_fit = from_test.found.estimation.fit_percent;
  s.validation_fit = from_test.fit_to(validation, {validation.soc_from, 0, 0, true});
  s.appendix = appendix_of(test);

  std::vector<StudyData> parts;
  for (std::size_t k = 0; k < ocv_experiment; ++k)
    parts.push_back(run_two_levels(experiment_names[k], levels_of(k, candidate.pulses), pulse_soc, bench,
                                   candidate.seed + 1 + k, runs));
  const double from_soc = std::min(1.0, ocv_soc + candidate.ocv_half_window),
               to_soc = ocv_soc - candidate.ocv_half_window;
  bench.ocv_step_s *= 2;  // it lasts nine hours
  const StudyData hour =
      run_on_bench(experiment_names[ocv_experiment], 1, bench, candidate.seed + 1 + ocv_experiment, 0.01, &runs);
  parts.push_back(window(hour, "", from_soc, to_soc));
  if (!candidate.whole_ocv) {
    const std::size_t at_40 = model::cell_detail::ocv_piece(ocv, ocv_soc - 0.05);
    const double b0_v = ocv.b0_v[at_40], b1_v = ocv.b1_v[at_40];
    for (std::size_t k = 0; k < ocv.b0_v.size; ++k) {
      ocv.b0_v[k] = b0_v;
      ocv.b1_v[k] = b1_v;
    }
  }
  std::vector<FromData> identified;
  for (const StudyData& part : parts) identified.emplace_back(given, part);
  for (std::size_t row = 0; row < paper_experiments; ++row) {
    const FromData& from = identified[row];
    const id::FitStatistics& own = from.found.estimation;
    for (std::size_t k = 0; k < paper_experiments; ++k)
      s.fit[row][k] = k == row ? own.fit_percent : from.fit_to(parts[k], identified[k].found.initial.front());
    std::copy(from.unit_deviation.begin(), from.unit_deviation.end(), s.deviation[row].begin());
    s.deviation[row][3] = std::sqrt(own.output_variance_v2);
  }
  return listed(s);
}

std::vector<double> differences(const std::vector<Figure>& simulated, const std::vector<Figure>& published) {
  constexpr double most = 2;
  std::vector<double> d(published.size());
  std::array<double, scales + 1> shift{}, shifted{};
  const auto scale = [&](std::size_t k) { return static_cast<std::size_t>(published[k].scale); };
  for (std::size_t k = 0; k < d.size(); ++k) {
    const auto size = [&](const Figure& f) { return std::log(sane(f.is_fit ? 100 - f.value : f.value)); };
    d[k] = size(simulated[k]) - size(published[k]);
    shift[scale(k)] += d[k];
    ++shifted[scale(k)];
  }
  for (std::size_t k = 0; k < d.size(); ++k) {
    if (published[k].scale != 0) d[k] -= shift[scale(k)] / shifted[scale(k)];
    d[k] = std::clamp(d[k], -most, most);
  }
  return d;
}

}  // namespace bms::study
