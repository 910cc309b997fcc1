// identify() and diagnose().
#include <fmt/format.h>

#include "files/bad_input.hpp"
#include "python/bindings.hpp"
#include "reports/json_cell.hpp"
#include "workflow/diagnose_recordings.hpp"
#include "workflow/holdout_judgement.hpp"
#include "workflow/identify_cell.hpp"

namespace bms::python {

namespace {

using measurement::Recording;
using Recordings = std::vector<Recording>;

struct Identified {
  std::optional<files::CellFile> cell;
  std::string json;
  std::vector<measurement::Warning> warnings;
};

struct IdentifyInput {
  Recordings recordings, ocv, validate, hold_out;
};

Identified identify(const IdentifyInput& input, workflow::IdentifyOptions options) {
  const py::gil_scoped_release released;
  if (input.recordings.empty()) throw files::BadInput("identify", 1, "no recordings, expected at least one");
  options.reading.refuse_doubtful = true;
  auto& by_name = options.reading.in_memory;
  options.recordings = add_recordings(input.recordings, by_name);
  options.ocv = add_recordings(input.ocv, by_name);
  options.validate = add_recordings(input.validate, by_name);
  options.hold_out = add_recordings(input.hold_out, by_name);
  workflow::IdentifyResult result = workflow::identify_cell(options);
  Identified found{{}, reports::json_of(result), std::move(result.warnings)};
  // as if it had been written and read
  if (result.cell_file) found.cell = files::parse_cell(files::cell_text(*result.cell_file), options.name);
  return found;
}

Identified identify_of(const Recordings& recordings, const Recordings& ocv, const files::CellFile& start,
                       double capacity_ah, const std::string& initial_soc, const std::string& window,
                       const std::vector<double>& nodes, bool extend, bool ocv_from_rests, const std::string& chemistry,
                       const Recordings& validate, const Recordings& hold_out, const std::string& name) {
  workflow::IdentifyOptions options;
  options.start = start.path;
  options.start_cell = start;
  options.capacity_ah = capacity_ah;
  options.initial_soc = workflow::initial_soc_of(initial_soc);
  options.window = workflow::window_of("window", window);
  options.nodes = nodes;
  options.extend = extend;
  options.ocv_from_rests = ocv_from_rests;
  options.chemistry = chemistry;
  options.name = name;
  options.out = name;
  return identify({recordings, ocv, validate, hold_out}, std::move(options));
}

struct Diagnosed {
  files::CellFile cell;
  std::string verdict, statement, json;
  std::vector<measurement::Warning> warnings;
};

/// Calls Python between fits: for Ctrl-C, and with the progress.
diagnosis::Options search_options(const std::optional<py::function>& progress) {
  diagnosis::Options options;
  options.stopped = [] {
    const py::gil_scoped_acquire acquired;
    if (PyErr_CheckSignals() != 0) throw py::error_already_set();
    return false;
  };
  if (progress) {
    options.progress = [&call = *progress](double done, const std::string& what) {
      const py::gil_scoped_acquire acquired;
      call(done, what);
    };
  }
  return options;
}

Diagnosed diagnose(const files::CellFile& cell, const Recordings& recordings, const Recordings& holdouts,
                   const std::vector<double>& initial_soc, const std::optional<py::function>& progress) {
  for (const double soc : initial_soc) {
    if (!(soc >= 0 && soc <= 1)) throw py::value_error("initial_soc is not between 0 and 1");
  }
  const diagnosis::Options search = search_options(progress);
  const py::gil_scoped_release released;
  if (recordings.empty()) throw files::BadInput("diagnose", 1, "no recordings, expected at least one");
  workflow::DiagnoseOptions options;
  options.cell = cell.path;
  options.cell_file = cell;
  options.recordings = add_recordings(recordings, options.reading.in_memory);
  options.holdouts = add_recordings(holdouts, options.reading.in_memory);
  options.initial_soc = initial_soc;
  workflow::DiagnoseResult result = workflow::diagnose_recordings(workflow::read_diagnose_input(options), search);
  workflow::add_next_experiment(options, result);
  workflow::judge_holdouts(options, search, result);
  return {files::parse_cell(files::cell_text(result.extended_cell), result.extended_cell.name),
          diagnosis::name_of(result.diagnosis.verdict), result.diagnosis.statement, reports::json_of(result),
          result.warnings};
}

}  // namespace

void bind_analysis(py::module_& module) {
  py::class_<Identified>(module, "Identification", "The result of identify().")
      .def_readonly("cell", &Identified::cell, "The identified Cell; None if a parameter is out of range.")
      .def_property_readonly(
          "result", [](const Identified& i) { return dict_of(i.json); }, "The JSON of bms identify as a dictionary.")
      .def_property_readonly(
          "warnings", [](const Identified& i) { return pairs(i.warnings); }, "[(id, text)]");
  py::class_<Diagnosed>(module, "Diagnosis", "The result of diagnose().")
      .def_readonly("cell", &Diagnosed::cell, "The Cell with the findings.")
      .def_readonly("verdict", &Diagnosed::verdict, "For example NO_MISMATCH or CAUSE.")
      .def_readonly("statement", &Diagnosed::statement, "The verdict in words.")
      .def_property_readonly(
          "result", [](const Diagnosed& d) { return dict_of(d.json); }, "The JSON of bms diagnose as a dictionary.")
      .def_property_readonly(
          "warnings", [](const Diagnosed& d) { return pairs(d.warnings); }, "[(id, text)]");
  module.def("identify", &identify_of, py::arg("recordings"), py::kw_only(), py::arg("ocv"), py::arg("start"),
             py::arg("capacity_ah"), py::arg("initial_soc"), py::arg("window"), py::arg("nodes"), py::arg("extend"),
             py::arg("ocv_from_rests"), py::arg("chemistry"), py::arg("validate"), py::arg("hold_out"),
             py::arg("name"));
  module.def("diagnose", &diagnose, py::arg("cell"), py::arg("recordings"), py::kw_only(), py::arg("holdouts"),
             py::arg("initial_soc"), py::arg("progress"));
}

}  // namespace bms::python
