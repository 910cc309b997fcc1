// The Python module greybox_bms._core. host_sim/python/greybox_bms/__init__.py is what users import.
#include "python/bindings.hpp"

#include <memory>

#include <fmt/format.h>

#include "files/bad_input.hpp"
#include "workflow/identify_cell.hpp"

namespace bms::python {

std::span<const double> numbers(const Array& array, const char* name) {
  if (array.ndim() != 1)
    throw py::value_error(fmt::format("{} has {} dimensions, expected one row of numbers", name, array.ndim()));
  return {array.data(), static_cast<std::size_t>(array.shape(0))};
}

measurement::Column column_of(const std::optional<Array>& array, const char* name) {
  if (!array) return {};
  const std::span<const double> values = numbers(*array, name);
  return std::vector<double>(values.begin(), values.end());
}

py::array view_of(const measurement::Column& column) {
  auto kept = std::make_unique<measurement::Column>(column);  // shares the numbers
  const double* const first = kept->data();
  const auto size = static_cast<py::ssize_t>(kept->size());
  const py::capsule owner(kept.release(), [](void* shared) { delete static_cast<measurement::Column*>(shared); });
  py::array_t<double> array(size, first, owner);
  array.attr("flags").attr("writeable") = false;
  return array;
}

std::vector<std::string> add_recordings(const std::vector<measurement::Recording>& recordings,
                                        std::map<std::string, measurement::Recording>& by_name) {
  std::vector<std::string> names;
  for (const measurement::Recording& recording : recordings) {
    const std::string given = recording.path.empty() ? "recording" : recording.path;
    std::string name = given;
    for (int k = 2; by_name.contains(name); ++k) name = fmt::format("{} ({})", given, k);
    by_name[name] = recording;
    by_name[name].path = name;
    by_name[name].warnings.clear();  // they are found again
    names.push_back(name);
  }
  return names;
}

py::dict dict_of(const std::string& json) { return py::module_::import("json").attr("loads")(json); }

std::vector<std::pair<std::string, std::string>> pairs(const std::vector<measurement::Warning>& warnings) {
  std::vector<std::pair<std::string, std::string>> all;
  for (const measurement::Warning& w : warnings) all.emplace_back(w.id, w.text);
  return all;
}

PYBIND11_MODULE(_core, module) {
  module.attr("__version__") = BMS_VERSION;
  py::register_exception<files::BadInput>(module, "InputError", PyExc_ValueError);
  py::register_exception<workflow::FailedFit>(module, "FitFailed", PyExc_RuntimeError);
  bind_cell(module);
  bind_recording(module);
  bind_replay(module);
  bind_analysis(module);
}

}  // namespace bms::python
