#include "proof/experiment_file.hpp"

#include <algorithm>

#include <fmt/format.h>

namespace bms::proof {

namespace {

struct NamedProcedure {
  const char* name;
  ReadProcedure read;
};
constexpr NamedProcedure procedures[] = {
    {"hysteresis", read_hysteresis},         {"temperature", read_temperature},
    {"relaxation", read_relaxation},         {"charge_loss", read_charge_loss},
    {"no_charge_loss", read_no_charge_loss}, {"added_faults", read_added_faults},
    {"no_mismatch", read_no_mismatch},       {"holdouts", read_holdouts},
};

ReadProcedure read_procedure_name(files::TomlTable& file) {
  const std::string name = file.text("procedure");
  std::string known;
  for (const NamedProcedure& one : procedures) {
    if (one.name == name) return one.read;
    known += std::string(known.empty() ? "" : ", ") + one.name;
  }
  file.reject("procedure", "one of: " + known);
}

}  // namespace

Experiment parse_experiment(const std::string& text, const std::string& path) {
  files::TomlTable file = files::TomlTable::parse(text, path, "an experiment");
  Experiment e;
  e.id = file.text("id");
  e.title = file.text("title");
  e.method = file.text("method");
  e.recordings = file.texts("recordings");
  e.rows = file.number("rows");
  if (file.has("notes")) e.notes = file.texts("notes");
  const ReadProcedure read = read_procedure_name(file);
  files::TomlTable claims = file.table("claim");
  e.procedure = read(file, claims);
  claims.finish();
  file.finish();
  return e;
}

const std::vector<Experiment>& experiments() {
  static const std::vector<Experiment> all = [] {
    std::vector<Experiment> list;
    for (const ExperimentText& file : experiment_texts())
      list.push_back(parse_experiment(file.text, "evidence/proof/experiments/" + file.name + ".toml"));
    return list;
  }();
  return all;
}

IdentifiedCell read_identified_cell(files::TomlTable& file) {
  files::TomlTable table = file.table("cell");
  IdentifiedCell cell{table.text("name"), table.texts("ocv"), table.text("drive")};
  table.finish();
  return cell;
}

ProofLines errors_over_time(const workflow::RecordingComparison& c, const std::string& title) {
  constexpr std::size_t points = 3'000;
  ProofLines lines{title, {"cell file, mV", "extended, mV"}, {}, "h", {{}, {}}};
  const std::size_t every = std::max<std::size_t>(1, c.record.size() / points);
  for (std::size_t k = 0; k < c.record.size(); k += every) {
    lines.x.push_back((c.record.time_s[k] - c.record.time_s.front()) / 3'600);
    lines.columns[0].push_back(1e3 * (c.record.voltage_v[k] - c.base_v[k]));
    lines.columns[1].push_back(1e3 * (c.record.voltage_v[k] - c.extended_v[k]));
  }
  return lines;
}

}  // namespace bms::proof
