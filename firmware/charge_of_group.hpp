// What a charge in a group of batteries (firmware/parallel/) has instead of that of one battery: which one speaks to
// the charger, whether the charge goes on, and the current.
#pragma once

#include <cstdint>

namespace bms::firmware {

/// A battery alone.
template <bool in_group>
class ChargeOfGroup {
 public:
  static constexpr bool speaks() { return true; }  ///< to the charger

 protected:
  static constexpr bool group_wants(bool own) { return own; }
  static constexpr std::int32_t group_current_ua(std::int32_t own_ua) { return own_ua; }
};

template <>
class ChargeOfGroup<true> {
 public:
  /// With every sample. wanted: a connected battery wants the charge. current_ua: of the group, while it charges.
  constexpr void join(bool leads, bool wanted, std::int32_t current_ua) {
    leads_ = leads;
    wanted_ = wanted;
    current_ua_ = current_ua;
  }
  constexpr bool speaks() const { return leads_; }

 protected:
  constexpr bool group_wants(bool) const { return wanted_; }
  constexpr std::int32_t group_current_ua(std::int32_t) const { return current_ua_; }

 private:
  bool leads_ = false, wanted_ = true;
  std::int32_t current_ua_ = 0;
};

}  // namespace bms::firmware
