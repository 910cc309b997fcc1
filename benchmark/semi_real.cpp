// The semi-real benchmark: real recordings split into a part from which a cell file is identified and a healthy part
// that is left out. The left-out part is diagnosed as it is (a null), and with a fault of known size put into it.
//
// Exit code: 0 done; 2 bad usage or a file that cannot be read; 3 internal error
#include <chrono>
#include <cmath>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "benchmark/injected_faults.hpp"
#include "files/bad_input.hpp"
#include "files/text_file.hpp"
#include "files/toml_table.hpp"
#include "measurement/statistics.hpp"
#include "workflow/diagnose_recordings.hpp"
#include "workflow/identify_cell.hpp"

namespace {

using bms::benchmark::injected_faults;
using bms::benchmark::InjectedFault;
using bms::diagnosis::Finding;
using bms::measurement::Recording;

struct Options {
  std::string data = "../shared/data", list = "benchmark/semi_real.toml", only, json;
  bool nulls_only = false;
};

struct RealSet {
  std::string name, start, calibration, test;
  std::vector<std::string> ocv;
};

/// One diagnosis.
struct Result {
  std::string set, fault;  ///< fault empty: a null
  double size = 0;
  std::string verdict, found;
  bool detected = false, first_right = false;
  std::optional<double> sigmas;  ///< of the found size from the true one
  double error_v = 0, remaining_v = 0, wall_s = 0, hours = 0;
};

std::vector<RealSet> read_sets(const Options& o) {
  std::vector<RealSet> sets;
  bms::files::TomlTable top = bms::files::TomlTable::parse(bms::files::read_file(o.list), o.list, "a list of sets");
  for (bms::files::TomlTable& t : top.tables("set")) {
    RealSet s{t.text("name"), t.text("start"), t.text("calibration"), "", t.texts("ocv")};
    if (t.has("test")) s.test = t.text("test");
    t.finish();
    if (s.name.find(o.only) != std::string::npos) sets.push_back(std::move(s));
  }
  top.finish();
  return sets;
}

/// Rows of a recording from `first` on.
Recording part(const Recording& r, std::size_t first, std::size_t count) {
  Recording p = r;
  for (auto column : {&Recording::time_s, &Recording::current_a, &Recording::voltage_v, &Recording::temperature_c,
                      &Recording::soc_ref, &Recording::current_ref_a, &Recording::voltage_ref_v}) {
    if (!(r.*column).empty()) p.*column = (r.*column).part(first, count);
  }
  return p;
}

std::string csv_of(const Recording& r) {
  std::string text = "time_s,current_a,voltage_v";
  if (!r.temperature_c.empty()) text += ",temperature_c";
  if (!r.soc_ref.empty()) text += ",soc_ref";
  text += "\n";
  for (std::size_t k = 0; k < r.rows(); ++k) {
    text += fmt::format("{},{},{}", r.time_s[k], r.current_a[k], r.voltage_v[k]);
    if (!r.temperature_c.empty()) text += fmt::format(",{}", r.temperature_c[k]);
    if (!r.soc_ref.empty()) text += fmt::format(",{}", r.soc_ref[k]);
    text += "\n";
  }
  return text;
}

struct Prepared {
  bms::files::CellFile cell;
  Recording test;
};

/// The identified cell and the recording that is left out.
Prepared prepare(const Options& o, const RealSet& set) {
  const auto path = [&](const std::string& name) { return (std::filesystem::path(o.data) / name).string(); };
  bms::workflow::IdentifyOptions options;
  options.start = set.start;
  for (const std::string& slow : set.ocv) options.ocv.push_back(path(slow));
  Prepared p;
  const Recording whole = bms::files::read_recording(path(set.calibration));
  const std::filesystem::path half = std::filesystem::temp_directory_path() / "semi_real_calibration.csv";
  if (set.test.empty()) {
    bms::files::write_file(half.string(), csv_of(part(whole, 0, whole.rows() / 2)));
    options.recordings = {half.string()};
    p.test = part(whole, whole.rows() / 2, whole.rows());
  } else {
    options.recordings = {path(set.calibration)};
    p.test = bms::files::read_recording(path(set.test));
  }
  options.name = "calibrated";
  p.cell = *bms::workflow::identify_cell(options).cell_file;
  std::filesystem::remove(half);
  return p;
}

/// Standard deviations between the found size and the true one, if the fault itself was named.
std::optional<double> sigmas_of(const Finding& f, const InjectedFault& fault, double size, double capacity_ah) {
  if (bms::model::catalogue[f.setting.index].id != fault.id || fault.first_parameter == nullptr) return std::nullopt;
  if (!(f.setting.deviation[0] > 0)) return std::nullopt;
  return (std::abs(f.setting.value[0]) - fault.first_parameter(size, capacity_ah)) / f.setting.deviation[0];
}

Result diagnose(const RealSet& set, const Prepared& p, const Recording& recording, const InjectedFault* fault,
                double size) {
  const auto begin = std::chrono::steady_clock::now();
  bms::workflow::DiagnoseInput input{p.cell, {}, {}, {}};
  const double start = recording.soc_ref.empty() ? 0.5 : recording.soc_ref.front();
  input.recordings.push_back(
      bms::workflow::prepared(recording, set.name, p.cell, bms::workflow::given_start(p.cell, start)));
  bms::diagnosis::PreparedRecording record = input.recordings.front().record;
  const bms::diagnosis::Diagnosis d = bms::diagnosis::diagnose(p.cell.parameters, p.cell.mechanisms, {record});
  Result r;
  r.set = set.name;
  r.fault = fault == nullptr ? "" : std::string(fault->id);
  r.size = size;
  r.verdict = bms::diagnosis::name_of(d.verdict);
  r.wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  r.hours = recording.duration_s() / 3'600;
  r.detected = d.verdict != bms::diagnosis::Verdict::no_mismatch;
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
  if (fault == nullptr || d.findings.empty() || !bms::diagnosis::names(d.verdict)) return r;
  const Finding& first = d.findings.front();
  r.first_right = bms::model::catalogue[first.setting.index].id == fault->id;
  for (const std::size_t e : first.equivalent_to) r.first_right |= bms::model::catalogue[e].id == fault->id;
  r.sigmas = sigmas_of(first, *fault, size, p.cell.parameters.capacity_ah);
  return r;
}

std::string line_of(const Result& r) {
  return fmt::format("{:50} {:20} {:<7.3g} {:12} {:6.1f} -> {:6.1f} mV {:6.1f} s  {}\n", r.set,
                     r.fault.empty() ? "(healthy)" : r.fault, r.size, r.verdict, 1e3 * r.error_v, 1e3 * r.remaining_v,
                     r.wall_s, r.found);
}

/// "3 of 12".
std::string share(const std::vector<Result>& results, bool (*counts)(const Result&), bool (*yes)(const Result&)) {
  std::size_t of = 0, n = 0;
  for (const Result& r : results) {
    if (!counts(r)) continue;
    ++of;
    n += yes(r) ? 1 : 0;
  }
  return fmt::format("{} of {}", n, of);
}

std::string table_of(const std::vector<Result>& results) {
  const auto healthy = [](const Result& r) { return r.fault.empty(); };
  const auto faulty = [](const Result& r) { return !r.fault.empty(); };
  const auto named = [](const Result& r) { return r.verdict.starts_with("CAUSE") || r.verdict == "AMBIGUOUS"; };
  double hours = 0, slowest_s = 0;
  for (const Result& r : results) {
    hours += r.fault.empty() ? r.hours : 0;
    slowest_s = std::max(slowest_s, r.wall_s);
  }
  std::string text = "\n| figure | value |\n|---|---|\n";
  text +=
      fmt::format("| healthy, left out: a cause is named | {} in {:.1f} h |\n", share(results, healthy, named), hours);
  text += "| healthy, left out: UNKNOWN or a data fault | " +
          share(results, healthy,
                [](const Result& r) {
                  return r.verdict == "UNKNOWN" || r.verdict == "DATA_FAULT" || r.verdict == "NOT_TESTABLE";
                }) +
          " |\n";
  text += "| faults: detected | " + share(results, faulty, [](const Result& r) { return r.detected; }) + " |\n";
  text +=
      "| faults: first name right | " + share(results, faulty, [](const Result& r) { return r.first_right; }) + " |\n";
  text += "| size within two of its standard deviations | " +
          share(
              results, [](const Result& r) { return r.sigmas.has_value(); },
              [](const Result& r) { return std::abs(*r.sigmas) <= 2; }) +
          " |\n";
  return text + fmt::format("| slowest diagnosis | {:.0f} s |\n", slowest_s);
}

std::string json_of(const std::vector<Result>& results) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const Result& r : results) {
    list.push_back({{"set", r.set},
                    {"fault", r.fault},
                    {"size", r.size},
                    {"verdict", r.verdict},
                    {"found", r.found},
                    {"first_right", r.first_right},
                    {"sigmas", r.sigmas ? nlohmann::ordered_json(*r.sigmas) : nlohmann::ordered_json()},
                    {"error_v", r.error_v},
                    {"remaining_v", r.remaining_v},
                    {"wall_s", r.wall_s}});
  }
  return list.dump(1) + "\n";
}

void run(const Options& o) {
  std::vector<Result> results;
  const auto add = [&](Result r) {
    fmt::print("{}", line_of(r));
    std::fflush(stdout);
    results.push_back(std::move(r));
  };
  for (const RealSet& set : read_sets(o)) {
    const Prepared p = prepare(o, set);
    add(diagnose(set, p, p.test, nullptr, 0));
    if (o.nulls_only) continue;
    for (const InjectedFault& fault : injected_faults) {
      for (const double size : fault.size) {
        Recording r = p.test;
        fault.put(r, size, p.cell.parameters.capacity_ah);
        add(diagnose(set, p, r, &fault, size));
      }
    }
  }
  fmt::print("{}", table_of(results));
  if (!o.json.empty()) bms::files::write_file(o.json, json_of(results));
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
  app.add_flag("--nulls-only", o.nulls_only, "put in no faults");
  try {
    app.parse(argc, argv);
    run(o);
    return 0;
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return app.exit(error);
    fmt::print(stderr, "semi_real: {} (see --help)\n", error.what());
    return 2;
  } catch (const bms::files::BadInput& error) {
    fmt::print(stderr, "{}\n", error.what());
    return 2;
  } catch (const std::exception& error) {
    fmt::print(stderr, "semi_real: {}\n", error.what());
    return 3;
  }
}
