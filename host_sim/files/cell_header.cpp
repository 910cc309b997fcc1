#include "files/cell_header.hpp"

#include <cstddef>
#include <utility>

#include <fmt/format.h>

#include "model/cell_fields.hpp"

namespace bms::files {

namespace {

std::string literal(double value) {
  std::string text = fmt::format("{}", value);
  if (text.find_first_of(".e") == std::string::npos) text += ".0";
  return text;
}

/// Writes designated initialisers of model::CellParameters. Its members have the names of the keys in the file.
class Initialiser {
 public:
  void table(const std::string& key) {
    text_ += (std::exchange(inside_, true) ? "},\n" : "\n") + ("    ." + key + " = {");
  }
  bool optional_table(const std::string& key, bool known) {
    if (known) table(key);
    return known;
  }
  void number(const std::string& key, double value) { text_ += "." + key + " = " + literal(value) + ", "; }
  void optional_number(const std::string& key, double value, double /*omitted*/ = 0) { number(key, value); }
  void optional_flag(const std::string& key, bool value) {
    text_ += "." + key + " = " + (value ? "true" : "false") + ", ";
  }
  template <class Column>
  void column(const std::string& key, const Column& column) {
    std::string values;
    for (std::size_t k = 0; k < column.size; ++k) values += (k == 0 ? "" : ", ") + literal(column[k]);
    text_ += "\n        ." + key + " = {{" + values + "}, " + std::to_string(column.size) + "}, ";
  }
  /// Columns that the firmware does not use stay empty, for example the sigmas of an identification.
  template <class Column>
  void optional_column(const std::string& key, const Column& values) {
    if (key == "half_gap_v") column(key, values);
  }

  std::string text() const { return text_ + "}"; }

 private:
  std::string text_;
  bool inside_ = false;
};

/// The code that depends on the mechanisms: the estimator's model and the constants of the cell.
std::string extension(const CellFile& file) {
  const auto acting = on_board(file.mechanisms);
  if (acting.empty()) {
    return fmt::format(R"(/// The estimator's model.
template <class S>
using Model = model::ExtendedRc<0, 0, {}>::Of<S>;

template <class S>
inline constexpr auto cell = model::prepare<S, model::interval_count(parameters)>(parameters);
)",
                       file.parameters.noise.errors_are_states);
  }
  std::string types, values;
  for (const model::MechanismSetting& m : acting) {
    const model::MechanismInfo& info = model::catalogue[m.index];
    std::string list;
    for (std::size_t k = 0; k < info.parameters; ++k) list += (k == 0 ? "" : ", ") + literal(m.value[k]);
    const std::string type = fmt::format("model::MechanismAt<model::mechanism_index(\"{}\")>", info.id);
    types += ", " + type;
    values +=
        fmt::format("{}\n        typename {}::template Law<S>(std::array<double, {}>{{{}}}, parameters.capacity_ah)",
                    values.empty() ? "" : ",", type, info.parameters, list);
  }
  return fmt::format(R"(template <class S>
using Laws = model::Laws<S{types}>;

/// The estimator's model.
template <class S>
using Model =
    typename model::ExtendedRc<Laws<float>::most_voltage_states, Laws<float>::most_states, {errors}>::template Of<S>;

template <class S>
inline constexpr model::ExtendedCell<S, model::interval_count(parameters), Laws<S>> cell{{
    model::prepare<S, model::interval_count(parameters)>(parameters), Laws<S>({values})}};
)",
                     fmt::arg("types", types), fmt::arg("errors", file.parameters.noise.errors_are_states),
                     fmt::arg("values", values));
}

/// For the protections of a firmware; a header for the library has no use for them.
std::string pulse_ratings(const model::PulseRatings& p) {
  const auto rating = [](const model::PulseRating& r) {
    return fmt::format("{{.for_10s_a = {}, .for_30s_a = {}}}", literal(r.for_10s_a), literal(r.for_30s_a));
  };
  return fmt::format(R"(
inline constexpr model::PulseRatings pulses{{
    .temperature_min_c = {}, .charge = {}, .discharge = {}}};

static_assert(model::first_fault(pulses, parameters.limits).what == nullptr, "a pulse rating is out of range");
)",
                     literal(p.temperature_min_c), rating(p.charge), rating(p.discharge));
}

std::string initialiser(const CellFile& file) {
  Initialiser values;
  visit_cell(values, file.parameters);
  return values.text();
}

/// The model, as a header of this project or as the one header that is named.
std::string include_lines(const CellFile& file, const std::string& include) {
  if (!include.empty()) return "#include " + include;
  return fmt::format(
      "#include \"model/{}.hpp\"\n#include \"model/extended_rc.hpp\"\n#include \"model/pulse_ratings.hpp\"",
      on_board(file.mechanisms).empty() ? "cell" : "extended");
}

}  // namespace

std::string parameters_header(std::span<char* const> names) {
  std::string constants;
  for (const char* name : names) {
    constants += fmt::format("\n/// Cell file '{0}'.\ninline constexpr model::CellParameters<double> {0}{{{1}}};\n",
                             name, initialiser(read_cell(name)));
  }
  return fmt::format(R"(// Made at build time from the built-in cell files; do not edit.
#pragma once

#include "model/cell_parameters.hpp"

namespace bms::built_in_cells {{
{}
}}  // namespace bms::built_in_cells
)",
                     constants);
}

std::string cell_header(const CellFile& file, const std::string& include) {
  return fmt::format(
      R"(// Generated from the cell file '{name}'. Do not edit.
#pragma once

#include <cstdint>

{include}

namespace bms::generated {{

inline constexpr char cell_name[] = "{name}";
inline constexpr std::uint32_t cell_hash = 0x{hash:08x};  // first 32 bits of the SHA-256 of the file

inline constexpr model::CellParameters<double> parameters{{{values}}};

static_assert(model::first_fault(parameters).what == nullptr, "a parameter of the cell file is out of range");
{pulses}
{extension}
}}  // namespace bms::generated
)",
      fmt::arg("include", include_lines(file, include)), fmt::arg("extension", extension(file)),
      fmt::arg("pulses", include.empty() ? pulse_ratings(file.pulses) : ""), fmt::arg("name", file.name),
      fmt::arg("hash", file.hash), fmt::arg("values", initialiser(file)));
}

}  // namespace bms::files
