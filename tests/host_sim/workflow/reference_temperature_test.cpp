#include "workflow/reference_temperature.hpp"

#include <gtest/gtest.h>

namespace bms::workflow {
namespace {

model::MechanismSetting setting(const files::CellFile& cell, std::string_view id, std::size_t parameter, double value) {
  model::MechanismSetting s = model::default_setting(model::mechanism_index(id), cell.parameters);
  s.value[parameter] = value;
  return s;
}

/// table9 whose resistances follow the temperature.
files::CellFile warm_cell() {
  files::CellFile cell = files::read_cell("table9");
  model::MechanismSetting s = setting(cell, "temperature_resistance", 0, 50'000);
  s.value[1] = 40'000;
  s.value[3] = 0.3;
  files::put_mechanism(cell, s);
  return cell;
}

TEST(ReferenceTemperature, IdentifiedTablesChangeTheReferenceOfWhatBelongsToThem) {
  files::CellFile cell = warm_cell();
  files::put_mechanism(cell, setting(cell, "self_heating", 0, 2));
  files::put_mechanism(cell, setting(cell, "entropic_ocv", 0, 1e-4));
  cell.parameters.reference_temperature_c = 20;
  const auto reference = [&](std::size_t mechanism, std::size_t parameter) {
    return cell.mechanisms[mechanism].value[parameter];
  };
  state_reference(cell, false);
  EXPECT_EQ(reference(0, 3), 20) << "self_heating";
  EXPECT_EQ(reference(1, 2), 20) << "temperature_resistance";
  EXPECT_EQ(reference(2, 4), 25) << "the OCV is still that of 25 degrees C";
  state_reference(cell, true);
  EXPECT_EQ(reference(2, 4), 20);
}

TEST(ReferenceTemperature, IsThatOfRecordingsThatAreFarFromTheStatedOne) {
  EXPECT_EQ(reference_of(25, 4.2), 4.2);
  EXPECT_EQ(reference_of(25, 41), 41);
  EXPECT_EQ(reference_of(25, 29.9), 25) << "a recording that warms the cell";
}

}  // namespace
}  // namespace bms::workflow
