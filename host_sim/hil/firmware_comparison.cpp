#include "hil/firmware_comparison.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <string_view>

#include <fmt/format.h>

#include "can/codec.hpp"
#include "monitor/bus_state.hpp"

namespace bms::hil {

namespace {

/// Signals that differ between any two firmwares and mean nothing for the truck.
constexpr std::array<std::string_view, 3> of_the_image = {"Board.StackFree", "Board.LongestSample",
                                                          "LastFaultAddress.ProgramCounter"};
constexpr std::array<std::string_view, 1> messages_of_the_image = {"Identity"};
constexpr double current_margin_a = 0.03, current_margin = 0.002;  ///< rounding of the messages

bool equal(double a, double b) { return a == b || (std::isnan(a) && std::isnan(b)); }

bool is_of_the_image(const monitor::MessageInfo& message, const monitor::SignalInfo& signal) {
  const std::string name = fmt::format("{}.{}", message.name, signal.name);
  return std::ranges::find(messages_of_the_image, message.name) != messages_of_the_image.end() ||
         std::ranges::find(of_the_image, name) != of_the_image.end();
}

std::string value_text(const monitor::SignalInfo& signal, double value) {
  if (std::isnan(value)) return "not known";
  for (const can::ValueName& name : signal.names) {
    if (static_cast<double>(name.raw) == value) return name.text;
  }
  return fmt::format("{:.{}f}{}{}", value, signal.digits, *signal.unit == 0 ? "" : " ", signal.unit);
}

/// One firmware: its frames so far.
class Side {
 public:
  explicit Side(const FirmwareRun& run)
      : sent_(run.sent),
        discharge_(signal("AllowedCurrent", "Discharge")),
        charge_(signal("AllowedCurrent", "Charge")),
        current_(signal("PackElectrical", "Current")) {}

  bool at_end() const { return next_ == sent_.size(); }
  double next_s() const { return at_end() ? INFINITY : sent_[next_].time_s; }

  /// Receives the frames of this time and adds their messages to `touched`.
  void receive_until(double time_s, std::vector<std::size_t>& touched) {
    for (; !at_end() && sent_[next_].time_s <= time_s; ++next_) {
      const auto at_us = std::llround(1e6 * sent_[next_].time_s);
      const std::size_t message = bus_.receive(monitor::to_bus_frame(sent_[next_].frame, at_us));
      if (message < monitor::messages().size()) touched.push_back(message);
    }
  }

  /// Of a message that was not received yet: NaN.
  double value(std::size_t message, std::size_t signal) const {
    const auto& values = bus_.states()[message].values;
    return bus_.states()[message].frames == 0 || signal >= values.size() ? NAN : values[signal];
  }

  void count_above_allowed(double step_s, double& seconds) const {
    const double current_a = value(current_);
    const double allowed_a = value(current_a < 0 ? discharge_ : charge_);
    if (std::abs(current_a) > (1 + current_margin) * allowed_a + current_margin_a) seconds += step_s;
  }

 private:
  using Place = std::pair<std::size_t, std::size_t>;

  static Place signal(const char* message, std::string_view name) {
    const std::size_t m = monitor::BusState::find(message);
    const auto& all = monitor::messages()[m].signals;
    const auto at = std::ranges::find_if(all, [&](const monitor::SignalInfo& s) { return s.name == name; });
    return {m, static_cast<std::size_t>(at - all.begin())};
  }
  double value(const Place& place) const { return value(place.first, place.second); }

  const std::vector<SentFrame>& sent_;
  monitor::BusState bus_;
  std::size_t next_ = 0;
  Place discharge_, charge_, current_;
};

class Comparing {
 public:
  Comparing(const FirmwareRun& before, const FirmwareRun& after) : before_(before), after_(after) {}

  FirmwareComparison run() {
    double last_s = 0;
    while (!before_.at_end() || !after_.at_end()) {
      const double time_s = std::min(before_.next_s(), after_.next_s());
      touched_.clear();
      before_.receive_until(time_s, touched_);
      after_.receive_until(time_s, touched_);
      std::sort(touched_.begin(), touched_.end());
      touched_.erase(std::unique(touched_.begin(), touched_.end()), touched_.end());
      compare_at(time_s);
      before_.count_above_allowed(time_s - last_s, result_.above_allowed_before_s);
      after_.count_above_allowed(time_s - last_s, result_.above_allowed_after_s);
      last_s = time_s;
    }
    for (auto& [place, difference] : differences_) result_.signals.push_back(std::move(difference));
    return std::move(result_);
  }

 private:
  void compare_at(double time_s) {
    ++result_.samples;
    bool differs = false;
    for (const std::size_t m : touched_) {
      const monitor::MessageInfo& message = monitor::messages()[m];
      for (std::size_t s = 0; s < message.signals.size(); ++s) {
        const double before = before_.value(m, s), after = after_.value(m, s);
        if (equal(before, after) || is_of_the_image(message, message.signals[s])) continue;
        differs = true;
        add(m, s, time_s, before, after);
      }
    }
    if (differs) ++result_.differences;
  }

  void add(std::size_t m, std::size_t s, double time_s, double before, double after) {
    const monitor::MessageInfo& message = monitor::messages()[m];
    const monitor::SignalInfo& signal = message.signals[s];
    SignalDifference& d = differences_[{m, s}];
    if (d.samples++ == 0) {
      d = {message.name,
           signal.name,
           signal.unit,
           1,
           time_s,
           time_s,
           0,
           time_s,
           before,
           after,
           value_text(signal, before),
           value_text(signal, after)};
      if (!result_.first) {
        result_.first = {time_s, d.message == "EstimateHash"
                                     ? std::string("an estimate differs in at least one bit")
                                     : fmt::format("{}.{}: {}, with the new firmware {}", d.message, d.signal,
                                                   d.before_text, d.after_text)};
      }
    }
    d.last_s = time_s;
    if (const double by = std::abs(after - before); by > d.largest) {
      d.largest = by;
      d.largest_s = time_s;
    }
  }

  Side before_, after_;
  std::map<std::pair<std::size_t, std::size_t>, SignalDifference> differences_;
  std::vector<std::size_t> touched_;
  FirmwareComparison result_;
};

/// The intervals of one fault, in their order.
std::vector<FaultEvent> events_of(const std::vector<FaultEvent>& all, const std::string& name) {
  std::vector<FaultEvent> events;
  std::copy_if(all.begin(), all.end(), std::back_inserter(events), [&](const FaultEvent& f) { return f.name == name; });
  return events;
}

std::vector<FaultDifference> compare_faults(const std::vector<FaultEvent>& before,
                                            const std::vector<FaultEvent>& after) {
  std::vector<std::string> names;
  for (const auto* events : {&before, &after}) {
    for (const FaultEvent& f : *events) {
      if (std::ranges::find(names, f.name) == names.end()) names.push_back(f.name);
    }
  }
  std::vector<FaultDifference> differences;
  for (const std::string& name : names) {
    const auto old_events = events_of(before, name), new_events = events_of(after, name);
    for (std::size_t k = 0; k < std::max(old_events.size(), new_events.size()); ++k) {
      FaultDifference d{name, {}, {}};
      if (k < old_events.size()) d.before = old_events[k];
      if (k < new_events.size()) d.after = new_events[k];
      const bool same = d.before && d.after && d.before->raised_at_s == d.after->raised_at_s &&
                        d.before->cleared_at_s == d.after->cleared_at_s;
      if (!same) differences.push_back(std::move(d));
    }
  }
  const auto raised_s = [](const FaultDifference& d) { return (d.before ? d.before : d.after)->raised_at_s; };
  std::ranges::stable_sort(differences, {}, raised_s);
  return differences;
}

}  // namespace

FirmwareRun run_firmware(BoardLink& link, const SessionPlan& plan, const std::function<void(double)>& progress) {
  FirmwareRun run;
  run.session = run_session(
      link, plan,
      [&](double time_s, const can::Frame& frame) {
        run.sent.push_back({time_s, frame});
      },
      progress);
  return run;
}

FirmwareComparison compare(const FirmwareRun& before, const FirmwareRun& after) {
  FirmwareComparison result = Comparing(before, after).run();
  result.faults = compare_faults(before.session.faults, after.session.faults);
  return result;
}

}  // namespace bms::hil
