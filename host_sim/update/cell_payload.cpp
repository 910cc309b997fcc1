#include "update/cell_payload.hpp"

#include <algorithm>
#include <bit>
#include <utility>

#include <fmt/format.h>

#include "boot/flash_map.hpp"
#include "cell_update/format.hpp"
#include "files/bad_input.hpp"
#include "model/cell_fields.hpp"

namespace bms::update {

namespace {

/// Visitor of model/cell_fields.hpp that writes.
class Writer {
 public:
  template <class Integer>
  void put(Integer value) {
    for (std::size_t k = 0; k < sizeof value; ++k) bytes_ += static_cast<char>(value >> (8 * k) & 0xFF);
  }
  void number(double value) { put(std::bit_cast<std::uint64_t>(value)); }

  void table(const char*) {}
  bool optional_table(const char*, bool) { return true; }
  void number(const char*, double value) { number(value); }
  void optional_number(const char*, double value, double = 0) { number(value); }
  void optional_flag(const char*, bool value) { put(static_cast<std::uint8_t>(value)); }
  template <class Column>
  void column(const char*, const Column& column) {
    put(static_cast<std::uint8_t>(column.size));
    for (std::size_t k = 0; k < column.size; ++k) number(column[k]);
  }
  template <class Column>
  void optional_column(const char* key, const Column& values) {
    column(key, values);
  }
  const std::string& bytes() const { return bytes_; }

 private:
  std::string bytes_;
};

/// What follows identified values in a file, and what no estimator uses.
model::CellParameters<> without_deviations(model::CellParameters<> p) {
  for (auto* column : {&p.rc.r0_std_ohm, &p.rc.r1_std_ohm, &p.rc.c1_std_f}) column->size = 0;
  return p;
}

std::string names(const std::vector<model::MechanismSetting>& mechanisms) {
  std::string text;
  for (const auto& m : mechanisms) text += (text.empty() ? "" : ", ") + std::string(model::catalogue[m.index].id);
  return text.empty() ? "none" : text;
}

/// Limits, capacity and pulse ratings: what the firmware protects by.
class ProtectedBy {
 public:
  std::vector<std::pair<std::string, double>> values;

  explicit ProtectedBy(const files::CellFile& file) {
    model::visit_cell(*this, file.parameters);
    values.emplace_back("pulses.temperature_min_c", file.pulses.temperature_min_c);
    for (const auto& [name, rating] : {std::pair("charge", file.pulses.charge), {"discharge", file.pulses.discharge}}) {
      values.emplace_back(fmt::format("pulses.{}_10s_a", name), rating.for_10s_a);
      values.emplace_back(fmt::format("pulses.{}_30s_a", name), rating.for_30s_a);
    }
  }

  void table(const char* key) { table_ = key; }
  bool optional_table(const char* key, bool known) {
    table_ = key;
    return known;
  }
  void number(const char* key, double value) {
    if (table_ == "limits") values.emplace_back("limits." + std::string(key), value);
    if (table_.empty() && key == std::string("capacity_ah")) values.emplace_back(key, value);
  }
  void optional_number(const char*, double, double = 0) {}
  void optional_flag(const char*, bool) {}
  template <class Column>
  void column(const char*, const Column&) {}
  template <class Column>
  void optional_column(const char*, const Column&) {}

 private:
  std::string table_;
};

void refuse_other_model(const files::CellFile& cell, const files::CellFile& built) {
  const auto refuse = [&](const std::string& what) {
    throw files::BadInput(cell.path, 1,
                          what +
                              ", expected a cell file that differs from it in its tables only; this one needs new "
                              "firmware (bms image sign)");
  };
  const ProtectedBy now(cell), before(built);
  for (std::size_t k = 0; k < now.values.size(); ++k) {
    if (now.values[k].second != before.values[k].second)
      refuse(fmt::format("{} is {}, of the firmware's cell file {}, and the firmware protects by it",
                         now.values[k].first, now.values[k].second, before.values[k].second));
  }
  if (cell.parameters.noise.errors_are_states != built.parameters.noise.errors_are_states)
    refuse("noise.errors_are_states differs from the firmware's cell file");
  const auto mechanisms = files::on_board(cell.mechanisms), others = files::on_board(built.mechanisms);
  const bool same =
      std::ranges::equal(mechanisms, others, {}, &model::MechanismSetting::index, &model::MechanismSetting::index);
  if (!same)
    refuse(fmt::format("has the mechanisms {}, the firmware's cell file has {}", names(mechanisms), names(others)));
  const std::size_t intervals = model::interval_count(cell.parameters),
                    room = std::max(cell_update::room_for_intervals, model::interval_count(built.parameters));
  if (intervals > room) refuse(fmt::format("has {} intervals of SOC, the firmware has room for {}", intervals, room));
}

}  // namespace

std::vector<Payload> cell_payloads(const files::CellFile& cell, const files::CellFile& built) {
  refuse_other_model(cell, built);
  const auto mechanisms = files::on_board(cell.mechanisms);
  Writer w;
  w.put(cell_update::magic);
  w.put(cell_update::format);
  w.put(static_cast<std::uint16_t>(mechanisms.size()));
  const auto parameters = without_deviations(cell.parameters);
  model::visit_cell(w, parameters);
  for (const model::MechanismSetting& m : mechanisms) {
    const model::MechanismInfo& info = model::catalogue[m.index];
    w.put(cell_update::id_hash(info.id));
    w.put(static_cast<std::uint8_t>(info.parameters));
    for (std::size_t k = 0; k < info.parameters; ++k) w.number(m.value[k]);
  }
  if (w.bytes().size() > boot::block_bytes)
    throw files::BadInput(
        cell.path, 1,
        fmt::format("has {} bytes of constants, expected at most {}", w.bytes().size(), boot::block_bytes));
  std::vector<Payload> out;
  for (const std::uint8_t slot : {std::uint8_t{0}, std::uint8_t{1}}) {
    Payload p;
    p.header.kind = boot::Kind::cell;
    p.header.slot = slot;
    p.header.address = boot::payload_address(boot::Kind::cell, slot);
    p.header.cell_hash = cell.hash;
    p.header.built_for_cell_hash = built.hash;
    p.bytes = w.bytes();
    out.push_back(std::move(p));
  }
  return out;
}

}  // namespace bms::update
