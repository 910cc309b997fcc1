// Cell file -> constexpr header for firmware.
//
//   cell_header CELL OUT.hpp      CELL: a built-in name or a path
//
// Numbers are written with the digits that give back the very same double; the compiler then prepares the tables for the
// board's scalar by the same constexpr function that the host runs. Exit code 2 and one line when the cell is refused.
#include <cstdio>
#include <exception>
#include <string>

#include <fmt/format.h>

#include "host_sim/bad_input.hpp"
#include "host_sim/cell_file.hpp"
#include "host_sim/text_file.hpp"

namespace {

std::string literal(double value) {
  std::string text = fmt::format("{}", value);
  if (text.find_first_of(".e") == std::string::npos) text += ".0";
  return text;
}

template <class Column>
std::string initialiser(const Column& column) {
  std::string values;
  for (std::size_t k = 0; k < column.size; ++k) values += (k == 0 ? "" : ", ") + literal(column[k]);
  return "{{" + values + "}, " + std::to_string(column.size) + "}";
}

std::string header(const bms::CellFile& file) {
  const bms::model::CellParameters<>& p = file.parameters;
  const auto& l = p.limits;
  const auto& n = p.noise;
  const auto& t = p.tolerance;
  return fmt::format(
      R"(// Made at build time from the cell file '{name}'; do not edit.
#pragma once

#include <cstdint>

#include "model/cell.hpp"

namespace bms::generated {{

inline constexpr char cell_name[] = "{name}";
inline constexpr std::uint32_t cell_hash = 0x{hash:08x};  // first 32 bits of the file's SHA-256

inline constexpr model::CellParameters<double> parameters{{
    .capacity_ah = {capacity},
    .limits = {{.voltage_min_v = {vmin}, .voltage_max_v = {vmax}, .charge_current_max_a = {imax}, .discharge_current_max_a = {imin}, .temperature_min_c = {tmin}, .temperature_max_c = {tmax}}},
    .ocv = {{.soc = {ocv_soc},
            .b0_v = {b0},
            .b1_v = {b1}}},
    .rc = {{.soc = {rc_soc},
           .r0_ohm = {r0},
           .r1_ohm = {r1},
           .c1_f = {c1}}},
    .noise = {{.voltage_v = {nv}, .model_v = {nm}, .model_correlation_s = {nmc}, .v_rc_v = {nrc}, .rest_v = {nr}, .current_a = {ni}, .current_offset_a = {nio}, .current_offset_correlation_s = {nioc}, .current_unknown_a = {niu}}},
    .tolerance = {{.ocv_v = {to}, .resistance_fraction = {tr}, .initial_soc = {ts}, .drift_v = {td}}}}};

static_assert(model::first_fault(parameters).what == nullptr, "a parameter of the cell file is out of range");

template <class S>
inline constexpr auto cell = model::prepare<S, model::interval_count(parameters)>(parameters);

}}  // namespace bms::generated
)",
      fmt::arg("name", file.name), fmt::arg("hash", file.hash), fmt::arg("capacity", literal(p.capacity_ah)),
      fmt::arg("vmin", literal(l.voltage_min_v)), fmt::arg("vmax", literal(l.voltage_max_v)), fmt::arg("imax", literal(l.charge_current_max_a)),
      fmt::arg("imin", literal(l.discharge_current_max_a)), fmt::arg("tmin", literal(l.temperature_min_c)), fmt::arg("tmax", literal(l.temperature_max_c)),
      fmt::arg("ocv_soc", initialiser(p.ocv.soc)), fmt::arg("b0", initialiser(p.ocv.b0_v)), fmt::arg("b1", initialiser(p.ocv.b1_v)),
      fmt::arg("rc_soc", initialiser(p.rc.soc)), fmt::arg("r0", initialiser(p.rc.r0_ohm)), fmt::arg("r1", initialiser(p.rc.r1_ohm)),
      fmt::arg("c1", initialiser(p.rc.c1_f)), fmt::arg("nv", literal(n.voltage_v)), fmt::arg("nm", literal(n.model_v)),
      fmt::arg("nmc", literal(n.model_correlation_s)), fmt::arg("nrc", literal(n.v_rc_v)), fmt::arg("nr", literal(n.rest_v)),
      fmt::arg("ni", literal(n.current_a)), fmt::arg("nio", literal(n.current_offset_a)), fmt::arg("nioc", literal(n.current_offset_correlation_s)),
      fmt::arg("niu", literal(n.current_unknown_a)), fmt::arg("to", literal(t.ocv_v)), fmt::arg("tr", literal(t.resistance_fraction)),
      fmt::arg("ts", literal(t.initial_soc)), fmt::arg("td", literal(t.drift_v)));
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
