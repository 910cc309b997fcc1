// greybox_bms.Cell: a cell file.
#include <algorithm>

#include <fmt/format.h>

#include "files/bad_input.hpp"
#include "files/text_file.hpp"
#include "model/ocv_voltage.hpp"
#include "python/bindings.hpp"
#include "workflow/cell_size.hpp"

namespace bms::python {

namespace {

using files::CellFile;

template <class Column>
py::array array_of(const Column& column) {
  return owned(std::vector<double>(column.value.begin(), column.value.begin() + static_cast<long>(column.size)));
}

py::array ocv_v(const CellFile& cell, const Array& soc) {
  std::vector<double> volts;
  for (const double s : numbers(soc, "soc")) volts.push_back(model::ocv_voltage(cell.parameters.ocv, s));
  return owned(std::move(volts));
}

py::dict limits_of(const CellFile& cell) {
  const model::Limits& l = cell.parameters.limits;
  py::dict limits;
  limits["voltage_min_v"] = l.voltage_min_v;
  limits["voltage_max_v"] = l.voltage_max_v;
  limits["charge_current_max_a"] = l.charge_current_max_a;
  limits["discharge_current_max_a"] = l.discharge_current_max_a;
  limits["temperature_min_c"] = l.temperature_min_c;
  limits["temperature_max_c"] = l.temperature_max_c;
  return limits;
}

py::dict mechanisms_of(const CellFile& cell) {
  py::dict mechanisms;
  for (const model::MechanismSetting& m : cell.mechanisms) {
    const model::MechanismInfo& info = model::catalogue[m.index];
    py::dict values;
    for (std::size_t k = 0; k < info.parameters; ++k) values[py::str(std::string(info.parameter[k].name))] = m.value[k];
    mechanisms[py::str(std::string(info.id))] = values;
  }
  return mechanisms;
}

template <class Column>
void fill(const char* name, const std::vector<double>& values, std::size_t size, Column& column) {
  if (values.size() != size)
    throw py::value_error(fmt::format("{} has {} values, expected {}", name, values.size(), size));
  column = {};
  for (const double value : values) column.push_back(value);
}

/// What a cell is made of when it does not come from a cell file.
struct Tables {
  std::string name, chemistry, source;
  double capacity_ah = 0, reference_temperature_c = 25;
  std::vector<double> ocv_soc, ocv_v, rc_soc, r0_ohm, r1_ohm, c1_f;
  double voltage_min_v = 0, voltage_max_v = 0;
};

void set_ocv(const Tables& t, model::OcvTable<double>& ocv) {
  if (t.ocv_soc.size() < 2 || t.ocv_soc.size() > model::max_ocv_edges)
    throw py::value_error(
        fmt::format("ocv_soc has {} values, expected 2 to {}", t.ocv_soc.size(), model::max_ocv_edges));
  ocv = {};
  fill("ocv_soc", t.ocv_soc, t.ocv_soc.size(), ocv.soc);
  if (t.ocv_v.size() != t.ocv_soc.size())
    throw py::value_error(fmt::format("ocv_v has {} values, expected {}", t.ocv_v.size(), t.ocv_soc.size()));
  for (std::size_t k = 0; k + 1 < t.ocv_soc.size(); ++k) {
    const double slope_v = (t.ocv_v[k + 1] - t.ocv_v[k]) / (t.ocv_soc[k + 1] - t.ocv_soc[k]);
    ocv.b0_v.push_back(t.ocv_v[k] - slope_v * t.ocv_soc[k]);
    ocv.b1_v.push_back(slope_v);
  }
}

void set_rc(const Tables& t, model::RcTable<double>& rc) {
  if (t.rc_soc.empty() || t.rc_soc.size() > model::max_rc_nodes)
    throw py::value_error(fmt::format("rc_soc has {} values, expected 1 to {}", t.rc_soc.size(), model::max_rc_nodes));
  rc = {};
  fill("rc_soc", t.rc_soc, t.rc_soc.size(), rc.soc);
  fill("r0_ohm", t.r0_ohm, t.rc_soc.size(), rc.r0_ohm);
  fill("r1_ohm", t.r1_ohm, t.rc_soc.size(), rc.r1_ohm);
  fill("c1_f", t.c1_f, t.rc_soc.size(), rc.c1_f);
}

/// Everything that the tables do not say is that of `like`, scaled to the capacity; mechanisms are left out.
CellFile cell_of(const Tables& t, const CellFile& like) {
  CellFile cell = like;
  cell.mechanisms.clear();
  cell.at_temperature.clear();
  cell.sources.clear();
  cell.pulses = {};
  workflow::scale_to(t.capacity_ah, cell);
  cell.name = t.name;
  if (!t.chemistry.empty()) cell.chemistry = t.chemistry;
  cell.source = t.source;
  model::CellParameters<>& p = cell.parameters;
  p.range = {};
  p.noise.errors_are_states = false;
  p.noise.current_at_rest_a = 0;
  p.noise.current_gain = 0;
  p.capacity_ah = t.capacity_ah;
  p.reference_temperature_c = t.reference_temperature_c;
  p.limits.voltage_min_v = t.voltage_min_v;
  p.limits.voltage_max_v = t.voltage_max_v;
  set_ocv(t, p.ocv);
  set_rc(t, p.rc);
  return files::parse_cell(files::cell_text(cell), t.name);
}

void bind_tables(py::class_<CellFile>& c) {
  c.def_static(
      "from_tables",
      [](const std::string& name, double capacity_ah, std::vector<double> ocv_soc, std::vector<double> ocv,
         std::vector<double> rc_soc, std::vector<double> r0_ohm, std::vector<double> r1_ohm, std::vector<double> c1_f,
         double voltage_min_v, double voltage_max_v, const CellFile& like, const std::string& chemistry,
         double reference_temperature_c, const std::string& source) {
        return cell_of(
            {name, chemistry, source, capacity_ah, reference_temperature_c, std::move(ocv_soc), std::move(ocv),
             std::move(rc_soc), std::move(r0_ohm), std::move(r1_ohm), std::move(c1_f), voltage_min_v, voltage_max_v},
            like);
      },
      py::arg("name"), py::kw_only(), py::arg("capacity_ah"), py::arg("ocv_soc"), py::arg("ocv_v"), py::arg("rc_soc"),
      py::arg("r0_ohm"), py::arg("r1_ohm"), py::arg("c1_f"), py::arg("voltage_min_v"), py::arg("voltage_max_v"),
      py::arg("like"), py::arg("chemistry") = "", py::arg("reference_temperature_c") = 25.0,
      py::arg("source") = "tables",
      "Cell of tables. ocv_v [V] at ocv_soc (0 to 1, 2 to 64 values, rising); r0_ohm, r1_ohm [ohm] and c1_f [F] at "
      "rc_soc. Noise, tolerances, currents and temperatures are those of `like`, scaled to capacity_ah [A h]. Raises "
      "InputError if a value is out of the range of a cell file.");
}

void bind_values(py::class_<CellFile>& c) {
  const auto number = [&](const char* name, const char* help, auto get) {
    c.def_property_readonly(
        name, [get](const CellFile& cell) { return get(cell.parameters); }, help);
  };
  number("capacity_ah", "Capacity [A h].", [](const auto& p) { return p.capacity_ah; });
  number("reference_temperature_c", "Temperature of the tables [degrees C].",
         [](const auto& p) { return p.reference_temperature_c; });
  number("ocv_soc", "Edges of the OCV: shape (n,), 0 to 1.", [](const auto& p) { return array_of(p.ocv.soc); });
  c.def_property_readonly(
      "ocv_v",
      [](const CellFile& cell) {
        const auto soc = array_of(cell.parameters.ocv.soc);
        return ocv_v(cell, py::cast<Array>(soc));
      },
      "OCV [V] at ocv_soc: shape (n,).");
  number("rc_soc", "Nodes of R0, R1, C1: shape (m,), 0 to 1.", [](const auto& p) { return array_of(p.rc.soc); });
  number("r0_ohm", "R0 [ohm] at rc_soc: shape (m,).", [](const auto& p) { return array_of(p.rc.r0_ohm); });
  number("r1_ohm", "R1 [ohm] at rc_soc: shape (m,).", [](const auto& p) { return array_of(p.rc.r1_ohm); });
  number("c1_f", "C1 [F] at rc_soc: shape (m,).", [](const auto& p) { return array_of(p.rc.c1_f); });
  number("r0_std_ohm", "Standard deviation of R0 [ohm], or empty.",
         [](const auto& p) { return array_of(p.rc.r0_std_ohm); });
  number("r1_std_ohm", "Standard deviation of R1 [ohm], or empty.",
         [](const auto& p) { return array_of(p.rc.r1_std_ohm); });
  number("c1_std_f", "Standard deviation of C1 [F], or empty.", [](const auto& p) { return array_of(p.rc.c1_std_f); });
}

}  // namespace

void bind_cell(py::module_& module) {
  py::class_<CellFile> c(module, "Cell", "A cell: capacity, limits, OCV, R0, R1, C1, noise, mechanisms.");
  c.def_static("load", &files::read_cell, py::arg("name_or_path"),
               "Reads a cell file, or a built-in cell by its name. Raises InputError.");
  c.def_static("parse", &files::parse_cell, py::arg("text"), py::arg("path") = "cell",
               "Cell of the text of a cell file; path is for messages. Raises InputError.");
  c.def_static(
      "built_in",
      [] {
        std::vector<std::string> names;
        for (const files::BuiltInCell& cell : files::built_in_cells()) names.push_back(cell.name);
        return names;
      },
      "Names of the built-in cells.");
  bind_tables(c);
  c.def(
      "save", [](const CellFile& cell, const std::string& path) { files::write_file(path, files::cell_text(cell)); },
      py::arg("path"), "Writes the cell file.");
  c.def(
      "scaled",
      [](const CellFile& cell, double capacity_ah) {
        CellFile other = cell;
        workflow::scale_to(capacity_ah, other);
        return files::parse_cell(files::cell_text(other), other.name);
      },
      py::arg("capacity_ah"), "The same cell with another capacity [A h]: cells in parallel.");
  c.def("ocv_at", &ocv_v, py::arg("soc"), "OCV [V] at each soc. soc: shape (n,), 0 to 1. Returns shape (n,).");
  c.def_property_readonly("text", &files::cell_text, "Text of the cell file (TOML).");
  c.def_readonly("name", &CellFile::name, "Name of the cell.");
  c.def_readonly("chemistry", &CellFile::chemistry, "For example LFP.");
  c.def_readonly("source", &CellFile::source, "Where its values come from.");
  c.def_readonly("path", &CellFile::path, "As given to load().");
  c.def_readonly("hash", &CellFile::hash, "First 32 bits of the SHA-256 of the file.");
  bind_values(c);
  c.def_property_readonly("limits", &limits_of, "Limits of use: voltages [V], currents [A], temperatures [degrees C].");
  c.def_property_readonly("mechanisms", &mechanisms_of, "{mechanism: {parameter: value}}, units as in a cell file.");
  c.def("__repr__", [](const CellFile& cell) {
    return fmt::format("<greybox_bms.Cell {}: {}, {:g} Ah>", cell.name, cell.chemistry, cell.parameters.capacity_ah);
  });
}

}  // namespace bms::python
