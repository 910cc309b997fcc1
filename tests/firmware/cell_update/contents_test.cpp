// Cell constants from the tool's writer to the tables of an application: the same bits as in its build, and each
// refusal with its reason.
#include "cell_update/contents.hpp"

#include <gtest/gtest.h>

#include <cstring>
#include <functional>
#include <limits>

#include "boot/refusal.hpp"
#include "files/bad_input.hpp"
#include "model/extended.hpp"
#include "update/cell_payload.hpp"

namespace bms::cell_update {
namespace {

using boot::Refusal;
using Plain = Contents<float, room_for_intervals, model::LawSet<float>>;
using Extended = Contents<float, room_for_intervals,
                          model::Laws<float, model::SlowPolarisation, model::BranchTemperature, model::OcvHysteresis,
                                      model::TemperatureResistance, model::EntropicOcv>>;

files::CellFile changed(const std::string& name, const std::function<void(files::CellFile&)>& change) {
  files::CellFile cell = files::read_cell(name);
  change(cell);
  return files::parse_cell(files::cell_text(cell), "changed.toml");
}
/// A model that was improved without another limit.
files::CellFile better() {
  return changed("table9", [](files::CellFile& cell) {
    for (std::size_t k = 0; k < cell.parameters.rc.r0_ohm.size; ++k) cell.parameters.rc.r0_ohm[k] *= 1.07;
    cell.parameters.ocv.b0_v[0] -= 0.001;
    cell.parameters.tolerance.resistance_fraction = 0.05;
  });
}

std::string payload_of(const files::CellFile& cell, const files::CellFile& built) {
  return update::cell_payloads(cell, built).front().bytes;
}
template <class Of>
Refusal read(Of& contents, const std::string& payload, const files::CellFile& built) {
  return contents.read({reinterpret_cast<const std::uint8_t*>(payload.data()), payload.size()},
                       of_build(built.parameters));
}
template <class T>
bool same_bits(const T& a, const T& b) {
  return std::memcmp(&a, &b, sizeof a) == 0;
}

/// Every member but the padding.
template <class Tables>
void expect_same(const Tables& a, const Tables& b) {
  ASSERT_EQ(a.size, b.size);
  for (std::size_t k = 0; k < a.size; ++k) {
    EXPECT_TRUE(same_bits(a.interval[k], b.interval[k])) << k;
    EXPECT_TRUE(same_bits(a.edge[k], b.edge[k])) << k;
  }
  EXPECT_EQ(a.edge[a.size], b.edge[b.size]);
  EXPECT_EQ(a.charge.capacity_uaus, b.charge.capacity_uaus);
  EXPECT_EQ(a.charge.soc_per_count, b.charge.soc_per_count);
  EXPECT_EQ(a.noise.resistance_error, b.noise.resistance_error);
  EXPECT_EQ(a.noise.walk_soc2_per_s, b.noise.walk_soc2_per_s);
  EXPECT_EQ(a.noise.at_rest.still_ua, b.noise.at_rest.still_ua);
  EXPECT_TRUE(same_bits(a.limits, b.limits));
  EXPECT_TRUE(same_bits(a.plausible, b.plausible));
}

TEST(CellConstants, GiveTheTablesOfABuildWithTheSameCellFile) {
  const files::CellFile built = files::read_cell("table9"), cell = better();
  Plain contents;
  ASSERT_EQ(read(contents, payload_of(cell, built), built), Refusal::none);
  const auto tables = contents.tables();
  expect_same(tables, model::prepare<float, room_for_intervals>(cell.parameters));
  const auto before = model::prepare<float, room_for_intervals>(built.parameters);
  EXPECT_NE(tables.interval[3].r0_ohm, before.interval[3].r0_ohm);
}

TEST(CellConstants, EveryBuiltInCellIsReadInTheApplicationOfItsModel) {
  int plain = 0;
  for (const files::BuiltInCell& built_in : files::built_in_cells()) {
    const files::CellFile cell = files::read_cell(built_in.name);
    if (cell.parameters.noise.errors_are_states) continue;
    Plain contents;
    EXPECT_EQ(read(contents, payload_of(cell, cell), cell), Refusal::none) << built_in.name;
    expect_same(contents.tables(), model::prepare<float, room_for_intervals>(cell.parameters));
    ++plain;
  }
  EXPECT_GE(plain, 4);
}

TEST(CellConstants, BringTheValuesOfTheMechanisms) {
  const files::CellFile built = files::read_cell("a123_26650_extended"),
                        cell = changed("a123_26650_extended", [](files::CellFile&c) {
                          for (auto& m : c.mechanisms) {
                            if (model::catalogue[m.index].id == "ocv_hysteresis") m.value[0] *= 0.9;
                          }
                        });
  Extended contents;
  ASSERT_EQ(read(contents, payload_of(cell, built), built), Refusal::none);
  const auto tables = contents.tables();
  expect_same<model::Cell<float, room_for_intervals>>(tables,
                                                      model::prepare<float, room_for_intervals>(cell.parameters));
  const auto chosen = model::chosen<float>(cell.mechanisms, cell.parameters.capacity_ah);
  auto laws = tables.laws;
  auto wanted = chosen;
  constexpr std::size_t hysteresis = model::mechanism_index("ocv_hysteresis"),
                        slow = model::mechanism_index("slow_polarisation");
  EXPECT_TRUE(same_bits(laws.slot<2>().half_gap_v, wanted.slot<hysteresis>()->half_gap_v));
  EXPECT_TRUE(same_bits(laws.slot<2>().per_mas, wanted.slot<hysteresis>()->per_mas));
  EXPECT_NE(laws.slot<2>().half_gap_v,
            model::chosen<float>(built.mechanisms, built.parameters.capacity_ah).slot<hysteresis>()->half_gap_v);
  EXPECT_TRUE(same_bits(laws.slot<0>(), *wanted.slot<slow>()));
}

// ---- what an application refuses, whoever has signed it ----

struct BadConstants {
  const char* what;
  std::function<void(model::CellParameters<>&)> change;
  Refusal refusal;
};
const BadConstants bad_constants[] = {
    {"a higher voltage", [](auto& p) { p.limits.voltage_max_v += 0.01; }, Refusal::other_limits},
    {"a lower minimum", [](auto& p) { p.limits.voltage_min_v -= 0.1; }, Refusal::other_limits},
    {"a larger charge current", [](auto& p) { p.limits.charge_current_max_a *= 2; }, Refusal::other_limits},
    {"a larger discharge current", [](auto& p) { p.limits.discharge_current_max_a += 1; }, Refusal::other_limits},
    {"charging in the cold", [](auto& p) { p.limits.temperature_min_c -= 10; }, Refusal::other_limits},
    {"a higher temperature", [](auto& p) { p.limits.temperature_max_c += 5; }, Refusal::other_limits},
    {"tighter limits", [](auto& p) { p.limits.voltage_max_v -= 0.05; }, Refusal::other_limits},
    {"another capacity", [](auto& p) { p.capacity_ah *= 1.1; }, Refusal::other_limits},
    {"a limit that is NaN", [](auto& p) { p.limits.voltage_max_v = std::numeric_limits<double>::quiet_NaN(); },
     Refusal::other_limits},
    {"errors as states", [](auto& p) { p.noise.errors_are_states = true; }, Refusal::other_model},
    {"a resistance of 1 ohm", [](auto& p) { p.rc.r0_ohm[2] = 1; }, Refusal::cell_out_of_range},
    {"a resistance that is NaN", [](auto& p) { p.rc.r1_ohm[2] = std::numeric_limits<double>::quiet_NaN(); },
     Refusal::cell_out_of_range},
    {"an OCV that falls", [](auto& p) { p.ocv.b1_v[4] = -0.1; }, Refusal::cell_out_of_range},
    {"an OCV with a step", [](auto& p) { p.ocv.b0_v[4] += 0.02; }, Refusal::cell_out_of_range},
    {"no noise", [](auto& p) { p.noise.voltage_v = 0; }, Refusal::cell_out_of_range},
    {"a column less", [](auto& p) { p.rc.c1_f.size = 9; }, Refusal::cell_out_of_range},
    {"infinite reference temperature",
     [](auto& p) { p.reference_temperature_c = std::numeric_limits<double>::infinity(); }, Refusal::cell_out_of_range},
};

/// The tool's writer with values that the tool would not accept.
std::string forged(const std::function<void(model::CellParameters<>&)>& change) {
  files::CellFile cell = files::read_cell("table9");
  change(cell.parameters);
  files::CellFile same = cell;
  if (cell.parameters.limits.voltage_max_v != cell.parameters.limits.voltage_max_v) {  // not equal to itself
    same = cell = files::read_cell("table9");
    std::string payload = payload_of(cell, same);
    const double nan = std::numeric_limits<double>::quiet_NaN();
    std::memcpy(payload.data() + fields_at + 3 * sizeof(double), &nan, sizeof nan);
    return payload;
  }
  return payload_of(cell, same);
}

TEST(CellConstants, EachRefusalHasItsReason) {
  const files::CellFile built = files::read_cell("table9");
  Plain contents;
  for (const BadConstants& bad : bad_constants)
    EXPECT_EQ(read(contents, forged(bad.change), built), bad.refusal) << bad.what;
}

TEST(CellConstants, OfAnotherModelAreRefused) {
  const files::CellFile plain = files::read_cell("a123_26650"), extended = files::read_cell("a123_26650_extended");
  Extended of_extended;
  ASSERT_EQ(read(of_extended, payload_of(extended, extended), extended), Refusal::none);
  files::CellFile like_extended = plain;
  like_extended.parameters.noise.errors_are_states = true;
  like_extended.parameters.limits = extended.parameters.limits;
  like_extended.parameters.capacity_ah = extended.parameters.capacity_ah;
  EXPECT_EQ(read(of_extended, payload_of(like_extended, like_extended), extended), Refusal::other_model);
  files::CellFile fewer = extended;
  fewer.mechanisms.pop_back();
  EXPECT_EQ(read(of_extended, payload_of(fewer, fewer), extended), Refusal::other_model);
  files::CellFile other = extended;
  other.mechanisms.back() = model::default_setting(model::mechanism_index("charge_transfer"), extended.parameters);
  other.mechanisms.back().value[0] = 1;
  ASSERT_EQ(files::on_board(other.mechanisms).size(), 5U);
  EXPECT_EQ(read(of_extended, payload_of(other, other), extended), Refusal::other_model);
  Contents<float, 11, model::LawSet<float>> small;
  const files::CellFile table9 = files::read_cell("table9");
  EXPECT_EQ(read(small, payload_of(table9, table9), table9), Refusal::other_model) << "12 intervals";
}

TEST(CellConstants, AMechanismOutsideItsBoundsIsRefused) {
  const files::CellFile extended = files::read_cell("a123_26650_extended");
  Extended contents;
  for (const double bad : {0.08, -1e-9, std::numeric_limits<double>::quiet_NaN()}) {
    files::CellFile cell = extended;
    for (auto& m : cell.mechanisms) {
      if (model::catalogue[m.index].id == "ocv_hysteresis") m.value[0] = bad;
    }
    EXPECT_EQ(read(contents, payload_of(cell, cell), extended), Refusal::cell_out_of_range) << bad;
  }
}

TEST(CellConstants, OfEveryOtherLengthAreRefusedAndNothingIsReadBeyond) {
  const files::CellFile built = files::read_cell("table9");
  const std::string payload = payload_of(better(), built);
  Plain contents;
  for (std::size_t n = 0; n < payload.size(); ++n) {
    const std::vector<std::uint8_t> exact(payload.begin(), payload.begin() + static_cast<long>(n));
    EXPECT_EQ(contents.read(exact, of_build(built.parameters)), Refusal::unknown_cell_format) << n;
  }
  EXPECT_EQ(read(contents, payload + '\0', built), Refusal::unknown_cell_format);
  for (const std::size_t at : {0U, 4U}) {
    std::string other = payload;
    other[at] ^= 2;
    EXPECT_EQ(read(contents, other, built), Refusal::unknown_cell_format) << at;
  }
  std::string long_column = payload;
  long_column[fields_at + 8 * sizeof(double)] = 65;  // after capacity, reference temperature and six limits: ocv.soc
  EXPECT_EQ(read(contents, long_column, built), Refusal::unknown_cell_format);
}

TEST(CellConstants, AnyChangedByteIsRefusedOrGivesTablesInRange) {
  const files::CellFile built = files::read_cell("table9");
  const std::string payload = payload_of(better(), built);
  int accepted = 0;
  for (std::size_t at = 0; at < payload.size(); ++at) {
    for (int bit = 0; bit < 8; ++bit) {
      std::string other = payload;
      other[at] = static_cast<char>(other[at] ^ 1 << bit);
      Plain contents;
      if (read(contents, other, built) != Refusal::none) continue;
      ++accepted;
      const auto tables = contents.tables();
      EXPECT_EQ(tables.limits.voltage_max_v, 3.65F);
      EXPECT_EQ(tables.charge.capacity_uaus, 21'600'000'000'000'000);
    }
  }
  EXPECT_GT(accepted, 1'000) << "low bits of the values";
}

// ---- what the tool refuses before it signs ----

std::string refused(const files::CellFile& cell, const files::CellFile& built) {
  try {
    update::cell_payloads(cell, built);
  } catch (const files::BadInput& error) {
    return error.what();
  }
  return "";
}

TEST(CellPayload, IsForBothSlotsAndSaysWhoseItIs) {
  const files::CellFile built = files::read_cell("table9"), cell = better();
  const auto payloads = update::cell_payloads(cell, built);
  ASSERT_EQ(payloads.size(), 2U);
  for (const std::size_t slot : {0U, 1U}) {
    const boot::Header& h = payloads[slot].header;
    EXPECT_EQ(h.kind, boot::Kind::cell);
    EXPECT_EQ(h.slot, slot);
    EXPECT_EQ(h.cell_hash, cell.hash);
    EXPECT_EQ(h.built_for_cell_hash, built.hash);
    EXPECT_LE(payloads[slot].bytes.size(), boot::block_bytes);
  }
  EXPECT_EQ(payloads[0].bytes, payloads[1].bytes);
}

TEST(CellPayload, NamesWhatNeedsNewFirmware) {
  const files::CellFile built = files::read_cell("table9");
  const auto with = [&](const std::function<void(files::CellFile&)>& change) {
    return refused(changed("table9", change), built);
  };
  EXPECT_NE(with([](auto& c) { c.parameters.limits.voltage_max_v = 3.7; }).find("limits.voltage_max_v is 3.7"),
            std::string::npos);
  EXPECT_NE(with([](auto& c) { c.parameters.capacity_ah = 6.1; }).find("capacity_ah is 6.1"), std::string::npos);
  EXPECT_NE(with([](auto& c) { c.parameters.noise.errors_are_states = true; }).find("errors_are_states"),
            std::string::npos);
  EXPECT_NE(with([](auto& c) {
              auto m = model::default_setting(model::mechanism_index("slow_polarisation"), c.parameters);
              m.value[0] = 0.003;
              files::put_mechanism(c, m);
            }).find("has the mechanisms slow_polarisation"),
            std::string::npos);
  EXPECT_EQ(refused(better(), built), "");
}

}  // namespace
}  // namespace bms::cell_update
