// Cell file -> constexpr header for firmware.
//
//   cell_header CELL OUT.hpp      CELL: a built-in name or a path
//
// Numbers are written with the digits that give back the very same double; the compiler then prepares the tables for the
// board's scalar by the same constexpr function that the host runs. Exit code 2 and one line when the cell is refused.
#include <cstdio>
#include <exception>
#include <string>
#include <utility>

#include <fmt/format.h>

#include "host_sim/bad_input.hpp"
#include "host_sim/cell_fields.hpp"
#include "host_sim/cell_file.hpp"
#include "host_sim/text_file.hpp"

namespace {

/// Designated initialisers of model::CellParameters: its members are called as the keys of the file.
class Initialiser {
 public:
  void table(const std::string& key) { text_ += (std::exchange(inside_, true) ? "},\n" : "\n") + ("    ." + key + " = {"); }
  void number(const std::string& key, double value) { text_ += "." + key + " = " + literal(value) + ", "; }
  void optional_number(const std::string& key, double value) { number(key, value); }
  template <class Column>
  void column(const std::string& key, const Column& column) {
    std::string values;
    for (std::size_t k = 0; k < column.size; ++k) values += (k == 0 ? "" : ", ") + literal(column[k]);
    text_ += "\n        ." + key + " = {{" + values + "}, " + std::to_string(column.size) + "}, ";
  }
  /// What the firmware does without stays empty.
  template <class Column>
  void optional_column(const std::string&, const Column&) {}

  std::string text() const { return text_ + "}"; }

 private:
  static std::string literal(double value) {
    std::string text = fmt::format("{}", value);
    if (text.find_first_of(".e") == std::string::npos) text += ".0";
    return text;
  }

  std::string text_;
  bool inside_ = false;
};

std::string header(const bms::CellFile& file) {
  Initialiser values;
  bms::visit_cell(values, file.parameters);
  return fmt::format(
      R"(// Made at build time from the cell file '{name}'; do not edit.
#pragma once

#include <cstdint>

#include "model/cell.hpp"

namespace bms::generated {{

inline constexpr char cell_name[] = "{name}";
inline constexpr std::uint32_t cell_hash = 0x{hash:08x};  // first 32 bits of the file's SHA-256

inline constexpr model::CellParameters<double> parameters{{{values}}};

static_assert(model::first_fault(parameters).what == nullptr, "a parameter of the cell file is out of range");

template <class S>
inline constexpr auto cell = model::prepare<S, model::interval_count(parameters)>(parameters);

}}  // namespace bms::generated
)",
      fmt::arg("name", file.name), fmt::arg("hash", file.hash), fmt::arg("values", values.text()));
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) {
    std::fputs("usage: cell_header CELL OUT.hpp\n", stderr);
    return 2;
  }
  try {
    bms::write_file(argv[2], header(bms::read_cell(argv[1])));
  } catch (const bms::BadInput& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 2;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "cell_header: %s\n", error.what());
    return 3;
  }
  return 0;
}
