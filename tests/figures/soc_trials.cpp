#include "tests/figures/soc_trials.hpp"

#include <algorithm>
#include <cstdint>
#include <initializer_list>
#include <optional>
#include <vector>

#include <fmt/format.h>

#include "files/recording.hpp"
#include "measurement/statistics.hpp"

namespace bms {

namespace {

/// A change to a recording, and the initial state of charge that the estimator receives.
struct Trouble {
  std::string title;
  replay::SocPrior prior;
  double offset_a = 0, gain = 1, offset_v = 0;
  std::optional<double> from_soc;
};

measurement::Recording troubled(measurement::Recording r, const Trouble& t) {
  std::size_t first = 0;
  if (t.from_soc)
    first = static_cast<std::size_t>(
        std::find_if(r.soc_ref.begin(), r.soc_ref.end(), [&](double s) { return s < *t.from_soc; }) -
        r.soc_ref.begin());
  for (auto* column : {&r.time_s, &r.current_a, &r.voltage_v, &r.temperature_c, &r.soc_ref}) {
    *column = column->part(first, column->size());
  }
  const double start_s = r.time_s.front();
  for (double& s : r.time_s.edit()) s -= start_s;
  for (double& a : r.current_a.edit()) a = a * t.gain + t.offset_a;
  for (double& v : r.voltage_v.edit()) v += t.offset_v;
  return r;
}

struct Sums {
  std::size_t samples = 0;
  double inside = 0;
  std::vector<float> sigmas;
};

std::string row(const SocTrial& t, Sums& all) {
  replay::ReplayResult r;
  r.cell = t.cell;
  r.recording = t.recording;
  r.track = replay::run_on_host(t.cell, measurement::samples(r.recording), replay::starting_point(t.prior), r.scalar);
  replay::evaluate(r);
  std::vector<float> sigmas;
  for (const replay::EstimateRow& e : r.track.rows) sigmas.push_back(static_cast<float>(e.soc_sigma));
  all.samples += sigmas.size();
  all.inside += *r.soc.within_2_sigma * static_cast<double>(sigmas.size());
  all.sigmas.insert(all.sigmas.end(), sigmas.begin(), sigmas.end());
  return fmt::format(
      "| {} | {} | {:.2f} % | {:.2f} % | {:.2f} % | {:.1f} % | {:.2f} % | {:+.0f} +- {:.0f} mA |\n", t.name, t.trouble,
      100 * *r.soc.rmse, 100 * *r.soc.rmse_after_30min, 100 * *r.soc.max_error_after_30min, 100 * *r.soc.within_2_sigma,
      100 * measurement::upper_median(sigmas), 1e3 * *r.soc.current_offset_a, 1e3 * *r.soc.current_offset_sigma_a);
}

}  // namespace

void each_soc_trial(const std::filesystem::path& data, const std::function<void(const SocTrial&)>& f) {
  const replay::SocPrior right{1, 0.02};
  const std::vector<Trouble> with_sensor_errors = {
      {"initial SOC correct", right, 0, 1, 0, {}}, {"current + 30 mA", right, 0.03, 1, 0, {}},
      {"current - 30 mA", right, -0.03, 1, 0, {}}, {"current + 1 %", right, 0, 1.01, 0, {}},
      {"current - 1 %", right, 0, 0.99, 0, {}},    {"voltage + 5 mV", right, 0, 1, 0.005, {}},
      {"voltage - 5 mV", right, 0, 1, -0.005, {}}};
  const std::vector<Trouble> from_full = {{"initial SOC 30 % too low, sigma 30 %", {0.7, 0.3}, 0, 1, 0, {}}};
  const std::vector<Trouble> from_the_middle = {
      {"cut at 60 %, initial SOC 35 %, sigma 25 %", {0.35, 0.25}, 0, 1, 0, 0.6},
      {"cut at 60 %, initial SOC 85 %, sigma 25 %", {0.85, 0.25}, 0, 1, 0, 0.6}};
  const auto run = [&](const std::string& folder, const char* name,
                       std::initializer_list<const std::vector<Trouble>*> lists) {
    const files::CellFile cell = files::read_cell(folder + "_extended");
    const measurement::Recording r = files::read_recording((data / folder / (std::string(name) + ".csv")).string());
    for (const auto* list : lists) {
      for (const Trouble& t : *list) f({name, t.title, cell, troubled(r, t), t.prior});
    }
  };
  for (const char* name : {"udds_P25_A002", "fsae_P25_A004", "hwycol_P25_A004"})
    run("a123_26650", name, {&with_sensor_errors, &from_full});
  for (const char* name : {"dyn10_P05_A002", "dyn10_P15_A002", "dyn20_P25_A002", "dyn10_P45_A002"})
    run("a123_26650", name, {&with_sensor_errors, &from_the_middle});
  for (const char* name : {"dyn50_P25", "dyn45_P05", "dyn30_N05"})
    run("a123_esctoolbox", name, {&with_sensor_errors, &from_full, &from_the_middle});
}

std::string soc_trials(const std::filesystem::path& data) {
  std::string table =
      "| recording | trial | SOC RMSE | after 30 min | largest after 30 min | inside two sigma | median sigma | "
      "current offset, at the end |\n|---|---|---|---|---|---|---|---|\n";
  Sums all;
  each_soc_trial(data, [&](const SocTrial& t) { table += row(t, all); });
  return table + fmt::format("| all | | | | | {:.1f} % | {:.2f} % | |\n",
                             100 * all.inside / static_cast<double>(all.samples),
                             100 * measurement::upper_median(all.sigmas));
}

}  // namespace bms
