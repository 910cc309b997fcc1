// What the sources of the Python module share: numbers between numpy and C++, and the parts of the module.
#pragma once

#include <map>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <pybind11/functional.h>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include "files/cell_file.hpp"
#include "measurement/recording.hpp"

namespace bms::python {

namespace py = pybind11;

/// A one-dimensional array of float64. An argument that already is one is not copied.
using Array = py::array_t<double, py::array::c_style | py::array::forcecast>;

/// The numbers of an argument, without a copy. Throws ValueError if it is not one-dimensional.
std::span<const double> numbers(const Array& array, const char* name);

/// The numbers of an argument as a column of a recording; empty without one.
measurement::Column column_of(const std::optional<Array>& array, const char* name);

/// An array that owns these values; nothing is copied.
template <class T>
py::array owned(std::vector<T> values) {
  auto* kept = new std::vector<T>(std::move(values));
  const py::capsule owner(kept, [](void* list) { delete static_cast<std::vector<T>*>(list); });
  return py::array_t<T>(static_cast<py::ssize_t>(kept->size()), kept->data(), owner);
}

/// A read-only view of a column, which stays valid without the recording.
py::array view_of(const measurement::Column& column);

/// Adds the recordings of a call to `by_name` and returns their names; two of the same name get different ones.
std::vector<std::string> add_recordings(const std::vector<measurement::Recording>& recordings,
                                        std::map<std::string, measurement::Recording>& by_name);

/// The JSON of a result as a dictionary.
py::dict dict_of(const std::string& json);

/// [(id, text)]
std::vector<std::pair<std::string, std::string>> pairs(const std::vector<measurement::Warning>& warnings);

void bind_cell(py::module_& module);
void bind_recording(py::module_& module);
void bind_replay(py::module_& module);
void bind_analysis(py::module_& module);

}  // namespace bms::python
