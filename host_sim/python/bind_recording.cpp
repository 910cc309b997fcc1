// greybox_bms.Recording: current, voltage and temperature over time.
#include <array>
#include <cmath>

#include <fmt/format.h>

#include "files/bad_input.hpp"
#include "files/recording.hpp"
#include "measurement/recording_checks.hpp"
#include "python/bindings.hpp"

namespace bms::python {

namespace {

using measurement::Recording;

void check_time(const Recording& r) {
  for (std::size_t k = 0; k < r.rows(); ++k) {
    if (!std::isfinite(r.time_s[k]) || (k > 0 && r.time_s[k] < r.time_s[k - 1]))
      throw files::BadInput(r.path, k + 1, "time_s decreases or is missing, expected times that increase");
  }
  if (r.rows() < 1 || !(r.duration_s() > 0)) throw files::BadInput(r.path, 1, "no time passes, expected more rows");
}

Recording recording_of(const Array& time_s, const Array& current_a, const std::optional<Array>& voltage_v,
                       const std::optional<Array>& temperature_c, const std::optional<Array>& soc_ref,
                       const std::string& name) {
  Recording r;
  r.path = name;
  r.time_s = column_of(time_s, "time_s");
  r.current_a = column_of(current_a, "current_a");
  r.voltage_v = column_of(voltage_v, "voltage_v");
  r.temperature_c = column_of(temperature_c, "temperature_c");
  r.soc_ref = column_of(soc_ref, "soc_ref");
  const std::array<std::pair<const char*, const measurement::Column*>, 4> columns = {
      {{"current_a", &r.current_a},
       {"voltage_v", &r.voltage_v},
       {"temperature_c", &r.temperature_c},
       {"soc_ref", &r.soc_ref}}};
  for (const auto& [column, values] : columns) {
    if (values->size() == r.rows() || (values->empty() && values != &r.current_a)) continue;
    throw py::value_error(fmt::format("{} has {} values, time_s has {}", column, values->size(), r.rows()));
  }
  check_time(r);
  measurement::check_recording(r);
  return r;
}

files::ReadOptions options_of(const std::vector<std::string>& map, const std::vector<std::string>& unit,
                              const std::string& format, std::optional<bool> discharge_positive) {
  files::ReadOptions options;
  options.map = map;
  options.unit = unit;
  options.format = format;
  options.refuse_doubtful = true;
  if (discharge_positive)
    options.sign = *discharge_positive ? files::CurrentSign::discharge_positive : files::CurrentSign::charge_positive;
  return options;
}

Recording load(const std::string& path, const std::vector<std::string>& map, const std::vector<std::string>& unit,
               const std::string& format, std::optional<bool> discharge_positive) {
  const py::gil_scoped_release released;
  return files::read_recording(path, files::VoltageColumn::optional, options_of(map, unit, format, discharge_positive));
}

}  // namespace

void bind_recording(py::module_& module) {
  py::class_<Recording> c(module, "Recording",
                          "Readings of a cell over time. Row k: current_a is the mean over the interval that ends at "
                          "time_s (> 0 charges), voltage_v is sampled at time_s. NaN is a missing reading.");
  c.def(py::init(&recording_of), py::arg("time_s"), py::arg("current_a"), py::arg("voltage_v") = py::none(),
        py::arg("temperature_c") = py::none(), py::arg("soc_ref") = py::none(), py::kw_only(),
        py::arg("name") = "recording",
        "Recording of arrays of shape (n,): time_s [s, does not decrease], current_a [A, > 0 charges], voltage_v [V], "
        "temperature_c [degrees C], soc_ref [0 to 1]. Raises InputError, ValueError.");
  c.def_static("load", &load, py::arg("path"), py::kw_only(), py::arg("map") = std::vector<std::string>{},
               py::arg("unit") = std::vector<std::string>{}, py::arg("format") = "",
               py::arg("discharge_positive") = py::none(),
               "Reads a file as `bms import` does: map ['current_a=COLUMN'], unit ['current_a=mA'], format 'arbin', "
               "discharge_positive True or False to confirm the sign of the current. Raises InputError.");
  const auto column = [&](const char* name, measurement::Column Recording::*member, const char* help) {
    c.def_property_readonly(
        name, [member](const Recording& r) { return view_of(r.*member); }, help);
  };
  column("time_s", &Recording::time_s, "Time [s]: shape (n,), a read-only view.");
  column("current_a", &Recording::current_a, "Current [A], > 0 charges: shape (n,), a read-only view.");
  column("voltage_v", &Recording::voltage_v, "Voltage [V]: shape (n,), or (0,) if it was not recorded.");
  column("temperature_c", &Recording::temperature_c, "Temperature [degrees C]: shape (n,), or (0,).");
  column("soc_ref", &Recording::soc_ref, "Reference state of charge, 0 to 1: shape (n,), or (0,).");
  c.def_readonly("name", &Recording::path, "Path or name, for messages.");
  c.def_readonly("read_as", &Recording::read_as, "How a file of another format was read.");
  c.def_property_readonly(
      "warnings", [](const Recording& r) { return pairs(r.warnings); }, "[(id, text)]: what looks wrong.");
  c.def_property_readonly("duration_s", &Recording::duration_s, "Time from the first to the last row [s].");
  c.def("__len__", &Recording::rows);
  c.def("__repr__", [](const Recording& r) {
    return fmt::format("<greybox_bms.Recording {}: {} rows, {:.6g} s>", r.path, r.rows(), r.duration_s());
  });
}

}  // namespace bms::python
