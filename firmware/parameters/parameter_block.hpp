// The parameters of this battery: read from flash at the start, changed as a whole by a workshop.
//
//   begin()    a new set, equal to the active one
//   set()      one value of the new set; refused if it is out of its range
//   apply()    the new set becomes the active one, in flash first. Refused unless its check code is right, its values
//              are possible together, and flash has room. A refused set is discarded.
//
// The active set changes in one step. A loss of power in between leaves the old or the new set, never a mixture: both
// copies hold all values, and the newer intact one counts. The settings hold the revision, so that a set whose copies
// are both lost is noticed: lost() until accept(), with the values of the build meanwhile.
//
// A value that is out of its range in this image (another cell file) is replaced by the nearest one of the range.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <utility>

#include "parameters/parameters_record.hpp"
#include "storage/persistence.hpp"

namespace bms::parameters {

/// ParameterValue of number 0, kind initial.
enum class BlockState : std::uint8_t { initial, stored, clamped, lost };

class ParameterBlock {
 public:
  // Keys of the settings (firmware/stored_state.hpp has the others).
  static constexpr std::uint16_t revision_key = 4;
  static constexpr std::uint16_t bus_key = 5;  ///< bus_setting() of the active set

  /// ranges: must outlive this object.
  constexpr explicit ParameterBlock(const Ranges& ranges) : ranges_(&ranges), active_(initial_values(ranges)) {}

  /// Call once, after the persistence has started.
  void start(storage::Persistence& persistence) {
    const auto first = load(persistence, ParametersRecord::kind), second = load(persistence, ParametersRecord::copy);
    const auto newest = first && (!second || newer(first->revision, second->revision)) ? first : second;
    const auto known = static_cast<std::uint16_t>(persistence.settings().get(revision_key).value_or(0));
    if (!newest || (known != 0 && newer(known, newest->revision))) {
      state_ = known != 0 ? BlockState::lost : BlockState::initial;
      revision_ = known;
      if (lost()) adopt_bus(persistence.settings().get(bus_key));
      return;
    }
    adopt(*newest);
    if (!first || !second || first->revision != second->revision) store(persistence);
    note(persistence);
  }

  const Ranges& ranges() const { return *ranges_; }
  const Values& active() const { return active_; }
  std::uint16_t revision() const { return revision_; }
  BlockState state() const { return state_; }
  bool lost() const { return state_ == BlockState::lost; }

  void begin() { staged_ = active_; }
  /// Returns false if the value is refused; then the new set is discarded.
  bool set(std::uint32_t number, std::int32_t value) {
    const bool good = staged_ && number >= 1 && number <= parameter_count &&
                      possible(static_cast<Parameter>(number), value, *ranges_);
    if (good)
      (*staged_)[number - 1] = value;
    else
      staged_.reset();
    return good;
  }
  /// Returns false if the set is refused; then nothing has changed.
  bool apply(std::uint32_t code, storage::Persistence& persistence) {
    const auto next = std::exchange(staged_, std::nullopt);
    if (!next || check_code(*next) != code || !possible(*next, *ranges_)) return false;
    if (*next == active_ && state_ != BlockState::lost) return true;
    if (!persistence.may_set()) return false;
    const std::uint16_t before = revision_;
    const Values values_before = std::exchange(active_, *next);
    revision_ = static_cast<std::uint16_t>(revision_ == 0xFFFF ? 1 : revision_ + 1);
    if (!store(persistence)) {
      active_ = values_before;
      revision_ = before;
      return false;
    }
    state_ = BlockState::stored;
    note(persistence);
    return true;
  }
  /// A workshop accepts the values of the build after a loss. Those of the bus stay.
  void accept(storage::Persistence& persistence) {
    if (!lost()) return;
    state_ = BlockState::stored;
    store(persistence);
    note(persistence);
  }

 private:
  static constexpr int known_inputs_shift = 16;

  static constexpr bool newer(std::uint16_t a, std::uint16_t b) { return static_cast<std::int16_t>(a - b) > 0; }

  /// What is known of the set outside its copies. The bus first: a loss of power in between leaves the old revision,
  /// with which the copies are not lost.
  void note(storage::Persistence& persistence) const {
    const auto& settings = persistence.settings();
    if (settings.get(bus_key) != bus_setting(active_)) persistence.set(bus_key, bus_setting(active_));
    if (settings.get(revision_key) != revision_) persistence.set(revision_key, revision_);
  }
  void adopt_bus(std::optional<std::int32_t> setting) {
    Values values = active_;
    if (!setting) return;
    set_bus(values, *setting);
    if (possible(values, *ranges_)) active_ = values;
  }

  static std::optional<ParametersRecord> load(storage::Persistence& persistence, storage::Kind kind) {
    std::array<std::uint8_t, storage::max_payload_bytes> bytes;
    ParametersRecord record;
    const auto found = persistence.load_block(kind, bytes);
    if (!found || !decode(*found, kind.layout, record)) return std::nullopt;
    return record;
  }
  /// Returns true if at least one copy is stored: the other one is written again at the next start.
  bool store(storage::Persistence& persistence) const {
    ParametersRecord record{.revision = revision_, .count = parameter_count, .values = active_};
    at(record.values, Parameter::inputs_fitted) |= at(*ranges_, Parameter::inputs_fitted).highest << known_inputs_shift;
    std::array<std::uint8_t, storage::max_payload_bytes> bytes;
    const storage::Bytes payload = encode(record, bytes);
    const bool first = persistence.store_block(ParametersRecord::kind, payload);
    return persistence.store_block(ParametersRecord::copy, payload) || first;
  }
  /// An input that the image of the record did not have is fitted as the build says: a set of an older image must not
  /// switch it off. The upper half of the stored value has the inputs of that image; in the first records it is empty,
  /// and those images had two.
  constexpr std::int32_t inputs_of(std::int32_t stored) const {
    const std::int32_t known = stored >> known_inputs_shift,
                       had = known != 0 ? known : auxiliary_contacts_fitted | second_current_fitted;
    return (stored & ((1 << known_inputs_shift) - 1)) | (at(*ranges_, Parameter::inputs_fitted).initial & ~had);
  }
  void adopt(const ParametersRecord& record) {
    revision_ = record.revision;
    state_ = BlockState::stored;
    Values values = initial_values(*ranges_);
    for (std::size_t k = 0; k < record.count; ++k) {
      const auto parameter = static_cast<Parameter>(k + 1);
      const std::int32_t value = parameter == Parameter::inputs_fitted ? inputs_of(record.values[k]) : record.values[k];
      values[k] =
          possible(parameter, value, *ranges_) ? value : std::clamp(value, (*ranges_)[k].lowest, (*ranges_)[k].highest);
      if (!possible(parameter, values[k], *ranges_)) values[k] = (*ranges_)[k].initial;
      if (values[k] != value) state_ = BlockState::clamped;
    }
    if (!possible_together(values)) {
      for (const Parameter p :
           {Parameter::can_base, Parameter::can_stop, Parameter::canopen_node, Parameter::canopen_charger})
        at(values, p) = at(*ranges_, p).initial;
      if constexpr (protection::with_group) {
        for (const Parameter p : {Parameter::group_node, Parameter::group_batteries}) at(values, p) = 0;
      }
      state_ = BlockState::clamped;
    }
    active_ = values;
  }

  const Ranges* ranges_;
  Values active_;
  std::optional<Values> staged_;
  std::uint16_t revision_ = 0;
  BlockState state_ = BlockState::initial;
};

}  // namespace bms::parameters
