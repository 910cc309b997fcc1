#include "benchmark/pack_run.hpp"

#include <cstdio>

#include <fmt/format.h>

#include "benchmark/truth/case_files.hpp"
#include "files/cell_file.hpp"

namespace bms::benchmark {

namespace {

measurement::Recording recording_of(const truth::PackSeries& s) {
  measurement::Recording r;
  r.time_s = s.time_s;
  r.current_a = s.current_a;
  for (const auto& v : s.cell_v) r.cell_voltage_v.emplace_back(v);
  for (const auto& t : s.sensor_c) r.cell_temperature_c.emplace_back(t);
  if (!s.pack_v.empty()) r.pack_voltage_v = s.pack_v;
  return r;
}

const char* word_for(const PlantedOutcome& p) {
  if (p.named) return "right ";
  return p.listed ? "listed" : "missed";
}

}  // namespace

workflow::PackResult diagnose(const truth::PackCase& c, bool shared) {
  workflow::PackOptions options;
  options.shared = shared;
  options.initial_soc = c.given_initial_soc;
  const auto cell = files::parse_cell(truth::cell_toml(c.cell, "pack"), "pack");
  return workflow::diagnose_pack(cell, recording_of(c.recording), options);
}

PackOutcome run_pack(const truth::PackCase& c, bool shared) {
  const workflow::PackResult r = diagnose(c, shared);
  PackOutcome o = score_pack(c, r.diagnosis);
  o.wall_s = r.wall_s;
  return o;
}

void print(const PackOutcome& o) {
  fmt::print("{} ({} cells, {:.0f} h, {:.0f} s): {}\n", o.name, o.cells, o.hours, o.wall_s, o.verdict);
  for (const PlantedOutcome& p : o.planted)
    fmt::print("  {} {} {} {:.4g} (limit {:.4g}){}\n", word_for(p), p.fault.id,
               p.fault.cell ? fmt::format("{}", *p.fault.cell + 1) : "-", p.fault.size, p.limit,
               p.named ? fmt::format(", found {:.4g}, {:+.1f} sigma", p.found, p.pull) : "  " + p.instead);
  for (const std::string& text : o.wrong) fmt::print("  wrong {}\n", text);
  std::fflush(stdout);
}

}  // namespace bms::benchmark
