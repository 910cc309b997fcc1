// "A mechanism is one file and its place in the catalogue" (model/README.md), held by adding one. This test and the
// diagnosis that it links are compiled with a catalogue that also holds OcvBump (tests/CMakeLists.txt); it has no file
// of knowledge in inference/diagnosis/mechanisms/.
#include <cmath>

#include <gmock/gmock.h>

#include "diagnosis/diagnose.hpp"
#include "diagnosis/texts.hpp"
#include "plant/random.hpp"
#include "plant/truth_cell.hpp"

namespace bms::diagnosis {
namespace {

constexpr std::size_t bump = model::mechanism_index("ocv_bump");
static_assert(bump < model::mechanism_count);

/// A cell file for the plant's cell, read off its curves.
model::CellParameters<> cell_of_plant() {
  const plant::MonotoneCurve ocv = plant::table9_ocv_v();
  const plant::CircuitCurves circuit = plant::table9_circuit();
  model::CellParameters<> cell;
  cell.capacity_ah = 6;
  cell.limits = {2.0, 3.65, 6, 6, -20, 60};
  for (int k = 0; k <= 40; ++k) {
    const double soc = k / 40.0, next = (k + 1) / 40.0, slope = (ocv.at(next) - ocv.at(soc)) / (next - soc);
    cell.ocv.soc.push_back(soc);
    if (k == 40) break;
    cell.ocv.b1_v.push_back(slope);
    cell.ocv.b0_v.push_back(ocv.at(soc) - slope * soc);
  }
  for (int k = 1; k <= 10; ++k) {
    const double soc = k / 10.0;
    cell.rc.soc.push_back(soc);
    cell.rc.r0_ohm.push_back(circuit.r0_ohm.at(soc));
    cell.rc.r1_ohm.push_back(circuit.r1_ohm.at(soc));
    cell.rc.c1_f.push_back(circuit.c1_f.at(soc));
  }
  cell.noise.voltage_v = 0.001;
  cell.noise.current_a = 0.01;
  cell.noise.current_offset_a = 0.02;
  cell.noise.current_offset_correlation_s = 3'600;
  cell.tolerance = {.ocv_v = 0.0015, .resistance_fraction = 0.02, .initial_soc = 0.005, .drift_v = 0.001};
  return cell;
}

/// Two hours of pulses with rests around half charge, by a cell whose OCV has a bump there.
PreparedRecording recording_with_bump(double height_v) {
  plant::Random random(7);
  plant::Cell cell({}, {.soc = 0.62, .v_rc_v = 0, .temperature_c = 25});
  PreparedRecording r;
  r.initial_soc = 0.62;
  for (int k = 0; k < 7'200; ++k) {
    const double sign = k / 1'200 % 2 == 0 ? -1 : 1, current_a = k % 90 < 60 ? sign * 6 : 0;
    cell.run(current_a, 25, 1);
    const double apart = std::abs(cell.soc() - 0.5);
    r.time_s.edit().push_back(k);
    r.current_a.edit().push_back(current_a + 0.01 * random.normal());
    r.voltage_v.edit().push_back(cell.voltage_v() + height_v * std::max(0.0, 1 - 20 * apart) + 0.001 * random.normal());
  }
  return r;
}

TEST(AddedMechanism, IsDiagnosedByItsFileAndItsPlaceInTheCatalogueAlone) {
  Diagnosis d = diagnose(cell_of_plant(), {}, {recording_with_bump(0.04)});
  ASSERT_EQ(d.findings.size(), 1U);
  EXPECT_EQ(d.findings.front().setting.index, bump);
  EXPECT_NEAR(d.findings.front().setting.value[0], 0.04, 0.006);
  EXPECT_THAT(claim(d.findings.front().setting), testing::StartsWith("ocv_bump acts, with height_v = "));
}

TEST(AddedMechanism, IsNotFoundWhereItIsNot) {
  const Diagnosis d = diagnose(cell_of_plant(), {}, {recording_with_bump(0)});
  EXPECT_EQ(d.verdict, Verdict::no_mismatch);
}

}  // namespace
}  // namespace bms::diagnosis
