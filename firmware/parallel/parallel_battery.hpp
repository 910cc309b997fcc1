// Two to four batteries at one DC link, each with its own contactors and its own protection. They speak on a bus of
// their own: each sends a Presence every 100 ms. This is the logic of one of them; it has no bus and no clock.
//
//   leader    the only one that speaks with truck and charger: the lowest node that is able. It is elected only while
//             a Presence of every battery of the group arrives. It remains leader until it is not able or a lower one
//             leads
//   closing   one battery after the other, granted by the leader. The first one precharges the link: the fullest one
//             for driving, the emptiest one for charging. A further one closes only if its open-circuit voltage differs
//             from that of each connected one by at most connect_difference_uv, so the equalising current is bounded
//             whatever the load is. Both the leader and the battery that closes check this
//   current   the truck may draw what no battery exceeds its own limit with, as they share it now: the measured total
//             divided by the largest use of a limit. It rises slowly and falls at once. After each change of the
//             connected ones it begins with share_start of their number times the weakest limit
//   loss      a battery that receives nothing from its leader for leave_us opens, as nobody says its limits to the
//             truck. While nothing arrives from one battery, nothing closes
//
// A current > 0 charges. Integers only.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <utility>

namespace bms::parallel {

inline constexpr std::size_t most_batteries = 4;

enum class State : std::uint8_t {
  unable,     ///< a fault, or readings are missing: may not close
  open,       ///< able to close
  connected,  ///< both contactors are closed
};
enum class Request : std::uint8_t { none, drive, charge };

/// What a battery sends to the others.
struct Presence {
  std::uint8_t node = 0;  ///< 1 to 4; 0: nothing was received
  State state = State::unable;
  std::int32_t open_circuit_uv = 0;  ///< of the whole battery, by its estimator
  std::int32_t current_ua = 0;
  std::int32_t allowed_discharge_ua = 0, allowed_charge_ua = 0;  ///< at least 0
  std::uint8_t leader = 0, granted = 0;  ///< the node that it follows; as a leader: the battery that may close now
  bool charge_wanted = false;            ///< its charge by a charger is not over
};

struct Design {
  std::uint8_t node = 1, batteries = 2;  ///< nodes 1 to `batteries`
  std::int32_t connect_difference_uv = 500'000;
  std::int32_t rest_ua = 0;  ///< below it no current flows in a battery, so how they share it is not known
};

struct Decision {
  std::uint8_t leader = 0;  ///< 0: none
  bool leads = false;
  bool may_close = false;      ///< precharge and close, or stay closed
  bool must_open = false;      ///< in an orderly way, within a second
  bool leaderless = false;     ///< nothing has arrived from a leader for leave_us
  bool complete = false;       ///< a Presence of every battery of the group arrives, and of no other one
  bool charge_wanted = false;  ///< of a connected battery: any of the connected ones wants it
  std::size_t connected = 0;   ///< batteries, as far as they are present
  std::int64_t total_ua = 0;   ///< their current: that of the truck or charger
  /// Of the whole group, for truck and charger; of a leader.
  std::int32_t group_discharge_ua = 0, group_charge_ua = 0;
};

/// What all connected batteries together may carry in one direction.
class GroupLimit {
 public:
  static constexpr std::int64_t share_start = 60;  ///< per cent: resistances of the batteries within 1 to 2
  static constexpr std::int64_t margin = 95;       ///< per cent of the limit that the most used battery reaches
  static constexpr std::int64_t rise_s = 50;       ///< from nothing to the sum of all limits

  struct Use {
    std::int64_t carried_ua = 0, allowed_ua = 0;  ///< of one battery; a current in the other direction is below 0
  };

  /// connected: of them. changed: others than in the last call are connected. rest_ua: of one battery, as in Design.
  constexpr void update(const std::array<Use, most_batteries>& use, std::size_t connected, bool changed,
                        std::int32_t rest_ua, std::uint32_t step_us) {
    std::int64_t total_ua = 0, sum_ua = 0, weakest_ua = INT32_MAX;
    for (std::size_t k = 0; k < connected; ++k) {
      total_ua += use[k].carried_ua;
      sum_ua += use[k].allowed_ua;
      weakest_ua = std::min(weakest_ua, use[k].allowed_ua);
    }
    if (connected == 0) weakest_ua = 0;
    const std::int64_t before_ua = std::exchange(weakest_ua_, weakest_ua);
    if (connected < 2 || weakest_ua == 0) {
      limit_ua_ = weakest_ua;
      return;
    }
    const std::int64_t start = start_ua(connected, weakest_ua);
    // The limits of a battery that has just closed rise from 0 within seconds: what the group begins with follows them.
    if (changed || before_ua == 0)
      limit_ua_ = std::min(limit_ua_ > 0 ? limit_ua_ : INT32_MAX, start);
    else if (weakest_ua > before_ua)
      limit_ua_ = std::max(limit_ua_, std::min(limit_ua_ * weakest_ua / before_ua, start));
    std::int64_t target_ua = std::max(limit_ua_, start / 2);
    if (5 * total_ua >= limit_ua_ &&
        total_ua > static_cast<std::int64_t>(connected) * rest_ua) {  // enough current to see how they share it
      target_ua = sum_ua;
      for (std::size_t k = 0; k < connected; ++k) {
        if (use[k].carried_ua > 0)
          target_ua = std::min(target_ua, margin * total_ua / 100 * use[k].allowed_ua / use[k].carried_ua);
      }
    }
    const std::int64_t rise_ua = sum_ua * step_us / (rise_s * 1'000'000) + 1;
    limit_ua_ = std::min({target_ua, limit_ua_ + rise_ua, sum_ua});
  }
  constexpr std::int32_t limit_ua() const {
    return static_cast<std::int32_t>(std::min<std::int64_t>(limit_ua_, INT32_MAX));
  }

 private:
  static constexpr std::int64_t start_ua(std::size_t connected, std::int64_t weakest_ua) {
    return share_start * static_cast<std::int64_t>(connected) * weakest_ua / 100;
  }

  std::int64_t limit_ua_ = 0, weakest_ua_ = 0;
};

class ParallelBattery {
 public:
  static constexpr std::uint64_t present_us = 350'000;  ///< three messages
  static constexpr std::uint64_t leave_us = 1'000'000;
  static constexpr std::uint64_t grant_us = 5'000'000;  ///< a battery that does not close in this time waits as long

  constexpr explicit ParallelBattery(const Design& design) : design_(design) {}

  /// A Presence of another battery. Of its own node, or of one outside of the group, which a battery must have by
  /// mistake, nothing may close.
  constexpr void receive(const Presence& from, std::uint64_t time_us) {
    if (from.node == 0) return;
    if (from.node == design_.node || from.node > design_.batteries) {
      twin_us_ = time_us;
      twin_ = true;
      return;
    }
    Peer& peer = peers_[from.node - 1U];
    peer.last = from;
    peer.time_us = time_us;
    peer.known = true;
  }

  /// Call every 100 ms. own: state, voltage, current and limits of this battery; the rest is filled in. Then send own.
  constexpr const Decision& step(Presence& own, Request request, std::uint64_t time_us) {
    const std::uint32_t step_us = static_cast<std::uint32_t>(std::min<std::uint64_t>(time_us - time_us_, 1'000'000));
    time_us_ = time_us;
    own.node = design_.node;
    peers_[design_.node - 1U] = {own, time_us, true};
    elect(own);
    decision_.complete = complete();
    decision_.leads = decision_.leader == design_.node;
    own.leader = decision_.leader;
    own.granted = decision_.leads ? grant(request) : std::uint8_t{0};
    peers_[design_.node - 1U].last = own;
    decision_.may_close = may_close(own, request);
    decision_.leaderless = leaderless_us() > leave_us;
    decision_.must_open = own.state == State::connected && (decision_.leaderless || request == Request::none);
    limit(step_us);
    return decision_;
  }
  const Decision& decision() const { return decision_; }

 private:
  struct Peer {
    Presence last;
    std::uint64_t time_us = 0;
    bool known = false;
  };

  constexpr bool present(std::size_t k) const { return peers_[k].known && time_us_ - peers_[k].time_us <= present_us; }
  constexpr bool complete() const {
    for (std::size_t k = 0; k < design_.batteries; ++k) {
      if (!present(k)) return false;
    }
    return !twin_ || time_us_ - twin_us_ > grant_us;
  }
  constexpr bool able(std::size_t k) const { return present(k) && peers_[k].last.state != State::unable; }
  constexpr std::uint64_t leaderless_us() const { return time_us_ - led_us_; }

  constexpr void elect(const Presence& own) {
    std::uint8_t lowest = 0;
    for (std::size_t k = design_.batteries; k-- > 0;) {
      if (able(k)) lowest = static_cast<std::uint8_t>(k + 1);
    }
    if (complete()) {
      decision_.leader = lowest;
    } else if (decision_.leader != 0 && !able(decision_.leader - 1U)) {
      decision_.leader = 0;
    }
    if (decision_.leader == design_.node && own.state == State::unable) decision_.leader = 0;
    // a leader that itself follows another one does not count
    const bool led = decision_.leader != 0 && (decision_.leader == design_.node ||
                                               peers_[decision_.leader - 1U].last.leader == decision_.leader);
    if (led) led_us_ = peers_[decision_.leader - 1U].time_us;
  }

  constexpr std::int32_t difference_uv(std::size_t a, std::size_t b) const {
    const std::int32_t d = peers_[a].last.open_circuit_uv - peers_[b].last.open_circuit_uv;
    return d < 0 ? -d : d;
  }
  /// Returns the largest difference to a connected battery, or -1 if none is connected.
  constexpr std::int32_t largest_difference_uv(std::size_t k) const {
    std::int32_t largest = -1;
    for (std::size_t other = 0; other < design_.batteries; ++other) {
      if (other != k && present(other) && peers_[other].last.state == State::connected)
        largest = std::max(largest, difference_uv(k, other));
    }
    return largest;
  }

  /// The battery that may close now; 0: none.
  constexpr std::uint8_t grant(Request request) {
    if (request == Request::none || !complete()) return granted_ = 0;
    if (granted_ != 0) {
      const bool closed = peers_[granted_ - 1U].last.state == State::connected;
      const bool late = time_us_ - granted_us_ > grant_us;
      if (!closed && !late && peers_[granted_ - 1U].last.state == State::open) return granted_;
      if (!closed) waits_until_us_[granted_ - 1U] = time_us_ + grant_us;
      granted_us_ = time_us_;
      return granted_ = 0;  // a pause of one step between two grants
    }
    std::size_t best = most_batteries;
    for (std::size_t k = 0; k < design_.batteries; ++k) {
      if (peers_[k].last.state != State::open || time_us_ < waits_until_us_[k]) continue;
      const std::int32_t d = largest_difference_uv(k);
      if (d > design_.connect_difference_uv) continue;
      if (best == most_batteries || better(k, best, d < 0, request)) best = k;
    }
    if (best == most_batteries) return 0;
    granted_us_ = time_us_;
    return granted_ = static_cast<std::uint8_t>(best + 1);
  }
  constexpr bool better(std::size_t k, std::size_t than, bool first, Request request) const {
    if (!first) return largest_difference_uv(k) < largest_difference_uv(than);
    const bool fuller = peers_[k].last.open_circuit_uv > peers_[than].last.open_circuit_uv;
    return request == Request::drive ? fuller : !fuller;
  }

  constexpr bool may_close(const Presence& own, Request request) const {
    if (own.state == State::connected) return true;
    if (own.state != State::open || request == Request::none || !complete() || decision_.leader == 0) return false;
    if (peers_[decision_.leader - 1U].last.granted != design_.node) return false;
    return largest_difference_uv(design_.node - 1U) <= design_.connect_difference_uv;
  }

  constexpr void limit(std::uint32_t step_us) {
    std::array<GroupLimit::Use, most_batteries> discharge{}, charge{};
    std::size_t connected = 0;
    std::uint8_t which = 0;
    decision_.total_ua = 0;
    const Presence& own = peers_[design_.node - 1U].last;
    decision_.charge_wanted = own.charge_wanted;
    for (std::size_t k = 0; k < design_.batteries; ++k) {
      const Presence& p = peers_[k].last;
      if (!present(k) || p.state != State::connected) continue;
      decision_.total_ua += p.current_ua;
      if (own.state == State::connected) decision_.charge_wanted = decision_.charge_wanted || p.charge_wanted;
      discharge[connected] = {-std::int64_t{p.current_ua}, p.allowed_discharge_ua};
      charge[connected++] = {p.current_ua, p.allowed_charge_ua};
      which = static_cast<std::uint8_t>(which | 1U << k);
    }
    discharge_.update(discharge, connected, which != connected_, design_.rest_ua, step_us);
    charge_.update(charge, connected, which != connected_, design_.rest_ua, step_us);
    connected_ = which;
    decision_.connected = connected;
    decision_.group_discharge_ua = decision_.leads ? discharge_.limit_ua() : 0;
    decision_.group_charge_ua = decision_.leads ? charge_.limit_ua() : 0;
  }

  Design design_;
  Decision decision_;
  std::array<Peer, most_batteries> peers_{};
  std::array<std::uint64_t, most_batteries> waits_until_us_{};
  std::uint64_t time_us_ = 0, led_us_ = 0, granted_us_ = 0, twin_us_ = 0;
  bool twin_ = false;
  std::uint8_t granted_ = 0, connected_ = 0;
  GroupLimit discharge_, charge_;
};

}  // namespace bms::parallel
