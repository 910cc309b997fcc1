// The semi-real benchmark: real recordings split into a part from which a cell file is identified and a healthy part
// that is left out. The left-out part is diagnosed as it is (a null), and with a fault of known size put into it.
//
// Exit code: 0 done; 2 bad usage or a file that cannot be read; 3 internal error
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include "diagnosis/prediction_interval.hpp"
#include "files/run_program.hpp"
#include "files/text_file.hpp"
#include "files/toml_table.hpp"
#include "measurement/statistics.hpp"
#include "proof/faults_put_in.hpp"
#include "proof/real_cell.hpp"
#include "proof/semi_real_tables.hpp"
#include "workflow/diagnose_recordings.hpp"

namespace {

using bms::proof::injected_faults;
using bms::proof::InjectedFault;
using bms::proof::Prepared;
using bms::proof::RealSet;
using Result = bms::proof::SemiRealResult;
using bms::diagnosis::Finding;
using bms::measurement::Recording;

struct Options {
  std::string data = "../shared/data", list = "evidence/proof/semi_real.toml", only, json;
  std::vector<std::string> faults;  ///< empty: all
  std::vector<double> times_limit;  ///< sizes, in stated detection limits; empty: those of the fault
  std::vector<double> volts;        ///< sizes, by the RMS error that they make [V]; the same with any healthy data
  double false_alarm_rate = 0.01;
  bool nulls_only = false, without_healthy = false, bands_only = false, one_recording = false;
};

/// The band of the prediction on the recording that is left out.
bms::diagnosis::Coverage band_of(const RealSet& set, const Prepared& p) {
  const bms::workflow::StartSoc start = bms::workflow::start_of(p.test, p.cell);
  return bms::workflow::coverage_of(p.cell, bms::workflow::prepared(p.test, set.name, p.cell, start).record);
}

void print_band(const RealSet& set, const bms::diagnosis::Coverage& band) {
  fmt::print("| {} | {} | {:.1f} % | {:.1f} mV | {:.1f} mV |\n", set.cell, set.name, 100 * band.share(),
             1e3 * band.error_v(), 1e3 * band.half_width_v());
  std::fflush(stdout);
}

/// Standard deviations between the found size and the true one, if the fault itself was named.
std::optional<double> sigmas_of(const Finding& f, const InjectedFault& fault, double size, double capacity_ah) {
  if (bms::model::catalogue[f.setting.index].id != fault.id || fault.first_parameter == nullptr) return std::nullopt;
  if (!(f.setting.deviation[0] > 0)) return std::nullopt;
  return (std::abs(f.setting.value[0]) - fault.first_parameter(size, capacity_ah)) / f.setting.deviation[0];
}

bms::diagnosis::Diagnosis diagnose(const Options& o, const Prepared& p,
                                   const bms::diagnosis::PreparedRecording& record) {
  bms::diagnosis::Options options;
  options.healthy = p.cell.healthy;
  options.false_alarm_rate = o.false_alarm_rate;
  return bms::diagnosis::diagnose(p.cell.parameters, p.cell.mechanisms, {record}, options);
}

std::string id_of(std::size_t mechanism) {
  return mechanism == bms::diagnosis::no_mechanism ? bms::healthy_data::unknown_cause
                                                   : std::string(bms::model::catalogue[mechanism].id);
}

std::string withheld_of(const bms::diagnosis::Diagnosis& d) {
  std::string text;
  for (const bms::diagnosis::Withheld& w : d.withheld)
    text += fmt::format("{}{} p {:.2g}, gain {:.3g}, healthy {:.3g}{}", text.empty() ? "" : "; ", id_of(w.mechanism),
                        w.healthy.false_alarm, w.gain, w.healthy.healthy_gain, w.healthy.hours_needed ? "+" : "");
  return text;
}

Result diagnose(const Options& o, const RealSet& set, const Prepared& p, const Recording& recording,
                const InjectedFault* fault, double size, std::map<std::string, double>& limits) {
  const auto begin = std::chrono::steady_clock::now();
  const bms::diagnosis::PreparedRecording record =
      bms::workflow::prepared(recording, set.name, p.cell, bms::workflow::start_of(recording, p.cell)).record;
  const bms::diagnosis::Diagnosis d = diagnose(o, p, record);
  Result r;
  r.set = set.name;
  r.cell = set.cell;
  r.fault = fault == nullptr ? "" : std::string(fault->id);
  r.held_out = set.held_out;
  r.size = size;
  r.within_bounds = fault == nullptr || is_within_bounds(*fault, size, p.cell.parameters.capacity_ah);
  if (fault == nullptr) {
    for (const bms::diagnosis::DetectionLimit& l : d.limits) limits[id_of(l.mechanism)] = l.value;
  } else if (fault->first_parameter != nullptr && limits.contains(std::string(fault->id))) {
    r.over_limit = fault->first_parameter(size, p.cell.parameters.capacity_ah) / limits.at(std::string(fault->id));
  }
  r.withheld = withheld_of(d);
  r.covered = d.healthy ? d.healthy->covered.share : 1;
  r.healthy_blocks = d.healthy ? d.healthy->blocks : 0;
  for (const bms::healthy_data::HealthyBlock& b : p.cell.healthy.blocks)
    r.healthy_error_v = std::max(r.healthy_error_v, b.error_v);
  r.named = bms::diagnosis::names(d.verdict);
  r.verdict = bms::diagnosis::name_of(d.verdict);
  r.wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  r.hours = recording.duration_s() / 3'600;
  r.detected = r.named || d.verdict == bms::diagnosis::Verdict::unknown;
  r.remaining_v = d.unexplained_rmse_v;
  bms::measurement::MeanSquare error;
  for (std::size_t k = 0; !d.views.empty() && k < record.size(); ++k) {
    const double e = record.voltage_v[k] - d.views.front().base_v[k];
    if (std::isfinite(e)) error.add(e);
  }
  r.error_v = error.root();
  for (const Finding& f : d.findings) {
    r.found += r.found.empty() ? "" : " + ";
    r.found += fmt::format("{} {:.3g} +- {:.2g}", bms::model::catalogue[f.setting.index].id, f.setting.value[0],
                           f.setting.deviation[0]);
    for (const std::size_t e : f.equivalent_to) r.found += "~" + std::string(bms::model::catalogue[e].id);
  }
  if (d.findings.empty() || !bms::diagnosis::names(d.verdict)) return r;
  const Finding& first = d.findings.front();
  r.probability = first.probability;
  if (fault == nullptr) return r;
  r.first_right = r.is_the_fault = bms::model::catalogue[first.setting.index].id == fault->id;
  for (const std::size_t e : first.equivalent_to) r.first_right |= bms::model::catalogue[e].id == fault->id;
  r.sigmas = sigmas_of(first, *fault, size, p.cell.parameters.capacity_ah);
  return r;
}

/// Measured less simulated voltage of the cell file as it is [V].
std::vector<double> errors_v(const RealSet& set, const Prepared& p, const Recording& r) {
  const bms::diagnosis::PreparedRecording record =
      bms::workflow::prepared(r, set.name, p.cell, bms::workflow::start_of(r, p.cell)).record;
  std::vector<double> e = bms::diagnosis::predict(p.cell.parameters, p.cell.mechanisms, record);
  for (std::size_t k = 0; k < e.size(); ++k) e[k] = record.voltage_v[k] - e[k];
  return e;
}

/// RMS by which a fault of this size changes the error [V].
double moved_v(const RealSet& set, const Prepared& p, const InjectedFault& fault, double size) {
  Recording faulty = p.test;
  fault.put(faulty, size, p.cell.parameters.capacity_ah);
  const std::vector<double> healthy_v = errors_v(set, p, p.test), faulty_v = errors_v(set, p, faulty);
  bms::measurement::MeanSquare moved;
  for (std::size_t k = 0; k < healthy_v.size(); ++k) {
    const double by_v = faulty_v[k] - healthy_v[k];
    if (std::isfinite(by_v)) moved.add(by_v);
  }
  return moved.root();
}

/// Size of a fault that changes the error by so much; nothing if none does.
std::optional<double> size_that_moves(const RealSet& set, const Prepared& p, const InjectedFault& fault, double volts) {
  constexpr int steps = 8;
  double size = fault.size.front();
  for (int k = 0; k < steps; ++k) {
    const double now_v = moved_v(set, p, fault, size);
    if (!(now_v > 0)) return std::nullopt;
    size *= volts / now_v;
  }
  return size;
}

/// Sizes of a fault to put in; none if they are to be multiples of a limit that the healthy recording does not state.
std::vector<double> sizes_of(const Options& o, const InjectedFault& fault, double capacity_ah,
                             const std::map<std::string, double>& limits) {
  if (!o.volts.empty()) return {};
  if (o.times_limit.empty()) return {fault.size.begin(), fault.size.end()};
  const auto limit = limits.find(std::string(fault.id));
  std::vector<double> sizes;
  for (const double times : o.times_limit) {
    if (fault.first_parameter != nullptr && limit != limits.end())
      sizes.push_back(times * limit->second / fault.first_parameter(1, capacity_ah));
  }
  return sizes;
}

/// The sets of the list that are asked for and whose recordings are there.
std::vector<RealSet> sets_of(const Options& o, bms::proof::Present& present) {
  bms::files::TomlTable list = bms::files::TomlTable::parse(bms::files::read_file(o.list), o.list, "a list of sets");
  std::vector<RealSet> sets = bms::proof::read_sets(list);
  list.finish();
  std::erase_if(sets, [&](const RealSet& s) {
    return s.name.find(o.only) == std::string::npos || !present.has(s.name, files_of(s));
  });
  fmt::print(stderr, "{}", present.skipped_text("sets"));
  if (o.one_recording) {
    for (RealSet& s : sets) s.calibration.resize(1);
  }
  return sets;
}

void run(const Options& o) {
  std::vector<Result> results;
  bms::proof::NotRun not_run;
  const auto add = [&](Result r) {
    fmt::print("{}", line_of(r));
    std::fflush(stdout);
    results.push_back(std::move(r));
  };
  const auto wanted = [&](std::string_view id) {
    return o.faults.empty() || std::find(o.faults.begin(), o.faults.end(), id) != o.faults.end();
  };
  if (o.bands_only)
    fmt::print("| cell | set | within the 95 % band | error, RMS | band, RMS |\n|---|---|---|---|---|\n");
  bms::proof::Present present(o.data);
  const std::vector<RealSet> sets = sets_of(o, present);
  not_run.skipped = present.skipped();
  for (const RealSet& set : sets) {
    fmt::print(stderr, "set {} of {}: {}\n", &set - sets.data() + 1, sets.size(), set.name);
    Prepared p;
    try {
      p = prepare(o.data, set, !o.without_healthy);
    } catch (const std::runtime_error& error) {  // no cell file, no case
      fmt::print("{:40} no cell file: {}\n", set.name, error.what());
      ++not_run.without_cell_file;
      continue;
    }
    const bms::diagnosis::Coverage band = band_of(set, p);
    if (o.bands_only) {
      print_band(set, band);
      continue;
    }
    std::map<std::string, double> limits;
    Result null = diagnose(o, set, p, p.test, nullptr, 0, limits);
    null.band_within = band.share();
    null.band_over_error = band.half_width_v() / band.error_v();
    add(std::move(null));
    if (o.nulls_only) continue;
    for (const InjectedFault& fault : injected_faults) {
      if (!wanted(fault.id)) continue;
      std::vector<double> sizes = sizes_of(o, fault, p.cell.parameters.capacity_ah, limits);
      for (const double v : o.volts) {
        if (const auto size = size_that_moves(set, p, fault, v)) sizes.push_back(*size);
      }
      for (const double size : sizes) {
        Recording r = p.test;
        fault.put(r, size, p.cell.parameters.capacity_ah);
        add(diagnose(o, set, p, r, &fault, size, limits));
      }
    }
  }
  if (o.bands_only) return;
  fmt::print("{}", table_of(results));
  if (!o.json.empty()) bms::files::write_file(o.json, json_of(results, not_run));
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"Diagnose healthy real recordings that were left out, and the same with faults of known size"};
  app.name("semi_real");
  app.footer("Example: semi_real --data ../shared/data --nulls-only");
  Options o;
  app.add_option("--data", o.data, "folder with the recordings")->capture_default_str()->type_name("FOLDER");
  app.add_option("--list", o.list, "sets of recordings")->capture_default_str()->type_name("FILE");
  app.add_option("--only", o.only, "run only sets whose name contains TEXT")->type_name("TEXT");
  app.add_option("--json", o.json, "write every result to FILE")->type_name("FILE");
  app.add_option("--faults", o.faults, "kinds of fault to put in, for example channel_skew; all if not given")
      ->type_name("ID");
  app.add_option("--times-limit", o.times_limit,
                 "sizes of the faults, as multiples of the detection limit that the healthy recording states")
      ->type_name("X");
  app.add_option("--volts", o.volts, "sizes of the faults, by the RMS error that they make")->type_name("V");
  app.add_option("--false-alarm-rate", o.false_alarm_rate, "as of bms diagnose")->capture_default_str();
  app.add_flag("--without-healthy", o.without_healthy, "learn nothing from the healthy recordings");
  app.add_flag("--one-recording", o.one_recording,
               "identify the cell from the first of its recordings, and learn from that alone");
  app.add_flag("--bands", o.bands_only, "diagnose nothing: how many readings lie within the band of the prediction");
  app.add_flag("--nulls-only", o.nulls_only, "put in no faults");
  return bms::files::run_program(app, argc, argv, [&] { run(o); });
}
