#include "study/study_data.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "experiments/experiment.hpp"
#include "plant/truth_cell.hpp"
#include "replay/gaussian_noise.hpp"

namespace bms::study {

namespace {

constexpr double nominal_capacity_ah = 6, ambient_c = 20;
constexpr double window_margin_soc = 0.001;
constexpr double plant_step_s = 1;  // of Runge-Kutta 4, against time constants of 10 s and more
constexpr double ocv_rest_s = 600;

void add(StudyData& part, double time_s, double current_a, double voltage_v, double soc) {
  part.data.time_s.edit().push_back(time_s);
  part.data.current_a.edit().push_back(current_a);
  part.data.voltage_v.edit().push_back(voltage_v);
  part.soc_min = std::min(part.soc_min, soc);
  part.soc_max = std::max(part.soc_max, soc);
}

plant::MonotoneCurve scaled(const plant::MonotoneCurve& curve, double factor) {
  constexpr int nodes = 20;
  std::vector<plant::Point> points;
  for (int k = 0; k <= nodes; ++k) {
    const double soc = static_cast<double>(k) / nodes;
    points.push_back({soc, factor * curve.at(soc)});
  }
  return plant::MonotoneCurve(points);
}

plant::CellParameters plant_of(const Bench& bench) {
  plant::CellParameters p;
  p.step_s = plant_step_s;
  const auto scale = [](plant::MonotoneCurve& curve, double factor) {
    if (factor != 1) curve = scaled(curve, factor);
  };
  scale(p.circuit.r0_ohm, bench.r0_factor);
  scale(p.circuit.r1_ohm, bench.r1_factor);
  scale(p.circuit.c1_f, bench.c1_factor);
  return p;
}

/// The voltages that the equations of the paper leave out, exact for a constant current.
class LeftOutVoltage {
 public:
  LeftOutVoltage(const LeftOut& what, double branch) : what_(what), branch_(branch) {}

  void run(double current_a, double duration_s) {
    const double moved = what_.decay * std::abs(current_a) * duration_s / (3'600 * nominal_capacity_ah);
    const double target = current_a > 0 ? 1 : -1;
    branch_ = target + (branch_ - target) * std::exp(-moved);
    const double steady_v = what_.slow_ohm * current_a;
    slow_v_ = steady_v + (slow_v_ - steady_v) * std::exp(-duration_s / what_.slow_s);
  }
  double voltage_v() const { return what_.half_gap_v * branch_ + slow_v_; }

 private:
  LeftOut what_;
  double branch_, slow_v_ = 0;
};

using Profile = std::vector<experiments::ProfileRow>;

std::vector<PlantRuns::Row> plant_run(const Profile& profile, double soc_from, const Bench& bench, double stop_soc) {
  plant::Cell cell(plant_of(bench), {.soc = soc_from, .v_rc_v = 0, .temperature_c = ambient_c});
  std::vector<PlantRuns::Row> rows;
  double before_s = 0;
  for (const experiments::ProfileRow& row : profile) {
    if (row.time_s > before_s) cell.run(row.current_a, ambient_c, row.time_s - before_s);
    before_s = row.time_s;
    if (cell.soc() < stop_soc) break;
    rows.push_back({row.time_s, row.current_a, cell.soc(), cell.voltage_v()});
  }
  return rows;
}

/// What the instruments of the bench read of a run.
StudyData measured(const std::string& name, const std::vector<PlantRuns::Row>& run, double soc_from, double branch,
                   const Bench& bench, std::uint64_t seed) {
  LeftOutVoltage left_out(bench.left_out, branch);
  replay::GaussianNoise noise(seed);
  StudyData part{name, {}, soc_from, 1, 0};
  part.data.capacity_ah = nominal_capacity_ah;
  double before_s = 0;
  for (const PlantRuns::Row& row : run) {
    if (row.time_s > before_s) left_out.run(row.current_a, row.time_s - before_s);
    before_s = row.time_s;
    const double current_a = row.current_a + bench.current_offset_a + bench.current_noise_a * noise.next();
    const double voltage_v = row.voltage_v + left_out.voltage_v() + bench.voltage_noise_v * noise.next();
    add(part, row.time_s, current_a, voltage_v, row.soc);
  }
  return part;
}

}  // namespace

StudyData run_on_bench(const std::string& experiment, double soc_from, const Bench& bench, std::uint64_t seed,
                       double stop_soc, PlantRuns* runs) {
  const bool ocv = experiment.starts_with("ocv"), with_rests = experiment.starts_with("rest");
  experiments::ExperimentOptions options;
  const double pulse_c_rate = with_rests ? bench.short_c_rate : bench.long_c_rate;
  options.high_c_rate = ocv ? bench.ocv_c_rate : pulse_c_rate;
  options.low_c_rate = bench.low_share * options.high_c_rate;
  options.step_s = ocv ? bench.ocv_step_s : bench.pulse_step_s;
  PlantRuns once;
  const PlantRuns::Run run = (runs != nullptr ? *runs : once)
                                 .of(experiment,
                                     {options.high_c_rate, options.low_c_rate, options.step_s, soc_from, stop_soc,
                                      bench.r0_factor, bench.r1_factor, bench.c1_factor},
                                     [&] {
                                       const auto profile = experiments::experiment(experiment, options).value();
                                       return plant_run(profile, soc_from, bench, stop_soc);
                                     });
  // an OCV test begins full: on the charge branch
  return measured(experiment, *run, soc_from, ocv ? 1 : bench.start_branch, bench, seed);
}

StudyData run_ocv_test(int steps, const Bench& bench, std::uint64_t seed, bool and_back, PlantRuns* runs) {
  const auto profile = [&] {
    Profile rows = {{0, 0}};
    const auto hold = [&](double duration_s, double current_a) {
      const double from_s = rows.back().time_s;
      const auto samples = static_cast<int>(std::round(duration_s / bench.ocv_step_s));
      for (int k = 1; k <= samples; ++k) rows.push_back({from_s + k * bench.ocv_step_s, current_a});
    };
    const double current_a = bench.ocv_c_rate * nominal_capacity_ah;
    hold(ocv_rest_s, 0);
    for (const double direction : {-1.0, 1.0}) {
      if (direction > 0 && !and_back) break;
      for (int k = 0; k < steps; ++k) {
        hold(3'600 / bench.ocv_c_rate / steps, direction * current_a);
        hold(ocv_rest_s, 0);
      }
    }
    return rows;
  };
  const std::string name = "OCV test with 10 min rest";
  PlantRuns once;
  const PlantRuns::Run run = (runs != nullptr ? *runs : once)
                                 .of(name,
                                     {static_cast<double>(steps), and_back ? 1.0 : 0.0, bench.ocv_c_rate,
                                      bench.ocv_step_s, bench.r0_factor, bench.r1_factor, bench.c1_factor},
                                     [&] { return plant_run(profile(), 1, bench, -1); });
  return measured(name, *run, 1, 1, bench, seed);
}

StudyData run_currents(const std::string& name, const std::vector<double>& current_a, double soc_from,
                       const Bench& bench, std::uint64_t seed) {
  Profile profile = {{0, 0}};
  for (const double i : current_a) profile.push_back({profile.back().time_s + 1, i});
  return measured(name, plant_run(profile, soc_from, bench, -1), soc_from, bench.start_branch, bench, seed);
}

StudyData run_two_levels(const std::string& name, const TwoLevels& levels, double soc_from, const Bench& bench,
                         std::uint64_t seed, PlantRuns& runs) {
  constexpr double lead_s = 60;
  const auto profile = [&] {
    // charge until a time, so that the current of a second is its mean
    const double period_s = levels.first_s + levels.second_s,
                 period_as = levels.first_a * levels.first_s + levels.second_a * levels.second_s;
    const auto charge_as = [&](double time_s) {
      const double t = std::clamp(time_s - lead_s, 0.0, levels.duration_s), whole = std::floor(t / period_s);
      const double left_s = t - whole * period_s, first_s = std::min(left_s, levels.first_s);
      return whole * period_as + levels.first_a * first_s + levels.second_a * (left_s - first_s);
    };
    Profile rows = {{0, 0}};
    for (double t = 1; t <= levels.duration_s + 2 * lead_s; ++t) rows.push_back({t, charge_as(t) - charge_as(t - 1)});
    return rows;
  };
  const PlantRuns::Run run = runs.of(name,
                                     {levels.first_a, levels.first_s, levels.second_a, levels.second_s,
                                      levels.duration_s, soc_from, bench.r0_factor, bench.r1_factor, bench.c1_factor},
                                     [&] { return plant_run(profile(), soc_from, bench, 0.01); });
  return measured(name, *run, soc_from, bench.start_branch, bench, seed);
}

StudyData window(const StudyData& whole, const std::string& name, double high_soc, double low_soc) {
  StudyData part{name, {}, high_soc, 1, 0};
  const identification::Data& data = whole.data;
  part.data.capacity_ah = data.capacity_ah;
  double soc = whole.soc_from;
  for (std::size_t k = 0; k < data.size(); ++k) {
    if (k > 0) soc += data.current_a[k] * (data.time_s[k] - data.time_s[k - 1]) / (3'600 * data.capacity_ah);
    if (soc > high_soc + window_margin_soc) continue;
    if (soc < low_soc - window_margin_soc) break;
    if (part.data.size() == 0) part.soc_from = soc;
    add(part, data.time_s[k], data.current_a[k], data.voltage_v[k], soc);
  }
  return part;
}

double true_ocv_v(double soc) {
  static const plant::MonotoneCurve curve = plant::table9_ocv_v();
  return curve.at(soc);
}

}  // namespace bms::study
