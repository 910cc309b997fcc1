#include "hil/session.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>

#include "can_messages.hpp"  // generated from can/greybox_bms.dbc
#include "hal/sample_frames.hpp"
#include "monitor/bus_state.hpp"
#include "protection/contactors.hpp"

namespace bms::hil {

namespace {

constexpr double precharge_gives_up_s = 60, trace_every_s = 10, rest_c_rate = 0.02;
constexpr double shutdown_s = 20,
                 reclose_request_s = 12;  // after the drive nobody asks for 12 s, the contactors open; then they are
                                          // asked to close again, which tells whether one is welded

/// Current, temperature and, replayed, voltage at a time of the drive.
class LoadProfile {
 public:
  explicit LoadProfile(const measurement::Recording& r) : r_(r) {}

  /// Times must ascend.
  void go_to(double time_s) {
    while (row_ + 1 < r_.rows() && r_.time_s[row_] - r_.time_s.front() < time_s) ++row_;
  }
  double current_a() const {
    return std::isfinite(r_.current_a[row_]) ? r_.current_a[row_] : 0;
  }  // mean over the interval that ends at the row
  double temperature_c() const {
    return r_.temperature_c.empty() || !std::isfinite(r_.temperature_c[row_]) ? 25 : r_.temperature_c[row_];
  }
  double voltage_v(double time_s) const { return between(r_.voltage_v, time_s); }
  double soc_ref(double time_s) const { return r_.soc_ref.empty() ? std::nan("") : between(r_.soc_ref, time_s); }

 private:
  double between(const std::vector<double>& column, double time_s) const {
    if (row_ == 0) return column[0];
    const double from_s = r_.time_s[row_ - 1] - r_.time_s.front(), to_s = r_.time_s[row_] - r_.time_s.front();
    const double t = to_s > from_s ? std::clamp((time_s - from_s) / (to_s - from_s), 0.0, 1.0) : 1;
    return column[row_ - 1] + t * (column[row_] - column[row_ - 1]);
  }

  const measurement::Recording& r_;
  std::size_t row_ = 0;
};

/// What the board has said last. Frames that are not whole are none.
class ReceivedState {
 public:
  can::PackState pack;
  can::ContactorState contactors;
  can::AllowedCurrent allowed;
  bool pack_received = false, status_received = false;
  std::vector<FaultEvent> faults;

  void receive(double time_s, const can::Frame& frame) {
    if (bus_.receive(monitor::to_bus_frame(frame, std::llround(1e6 * time_s))) == monitor::messages().size()) return;
    switch (frame.id) {
      case can::PackState::id:
        pack = can::PackState::of(frame), pack_received = true;
        break;
      case can::ContactorState::id:
        contactors = can::ContactorState::of(frame);
        break;
      case can::AllowedCurrent::id:
        allowed = can::AllowedCurrent::of(frame);
        break;
      case can::Status::id:
        status_received = true;
        break;
      case can::Faults::id:
        update_faults(time_s, can::Faults::of(frame));
        break;
      default:
        break;
    }
  }
  std::uint64_t lost() const { return sum(&monitor::MessageState::lost); }
  std::uint64_t crc_errors() const { return sum(&monitor::MessageState::crc_errors); }

 private:
  std::uint64_t sum(std::uint64_t monitor::MessageState::*count) const {
    std::uint64_t all = 0;
    for (const monitor::MessageState& state : bus_.states()) all += state.*count;
    return all;
  }

  void update_faults(double time_s, can::Faults message) {
    message.each([&](const char* name, const char*, auto& value, const can::SignalLayout& s) {
      if (s.bits != 1) return;
      const auto last =
          std::find_if(faults.rbegin(), faults.rend(), [&](const FaultEvent& f) { return f.name == name; });
      const bool raised = last != faults.rend() && !last->cleared_at_s;
      if (value != 0 && !raised) faults.push_back({name, time_s, {}});
      if (value == 0 && raised) last->cleared_at_s = time_s;
    });
  }

  monitor::BusState bus_;
};

can::Frame request(std::uint32_t what, std::uint8_t counter) {
  can::Command command;
  command.code = can::Command::code_request;
  command.argument = what;
  return command.frame(counter);
}

template <std::size_t Cells>
std::vector<can::Frame> frames_for(const measurement::PackSample<max_cells>& all, double dc_link_v,
                                   std::uint16_t counter) {
  measurement::PackSample<Cells> s;
  s.time_us = all.time_us;
  s.current_ua = all.current_ua;
  s.pack_uv = Cells == 1 ? all.cell_uv[0] : all.pack_uv;
  std::copy_n(all.cell_uv.begin(), Cells, s.cell_uv.begin());
  s.temperature_cdegc = all.temperature_cdegc;
  const auto frames = hal::frames_of(s, static_cast<std::int32_t>(std::lround(1e6 * dc_link_v)), counter);
  return {frames.begin(), frames.end()};
}

/// What the load or the charger takes.
double load_current_a(const ReceivedState& received, double wanted_a, bool obeys) {
  const bool ready = received.contactors.state == can::ContactorState::state_drive ||
                     received.contactors.state == can::ContactorState::state_charge;
  if (!ready) return 0;
  if (!obeys) return wanted_a;
  const auto at_most = [](float limit_a) { return std::isfinite(limit_a) ? static_cast<double>(limit_a) : 0; };
  return std::clamp(wanted_a, -at_most(received.allowed.discharge), at_most(received.allowed.charge));
}

}  // namespace

SessionResult run_session(BoardLink& link, const SessionPlan& plan,
                          const std::function<void(double, const can::Frame&)>& frame,
                          const std::function<void(double)>& progress) {
  const auto begin = std::chrono::steady_clock::now();
  SessionResult result;
  ReceivedState received;
  LoadProfile profile(plan.profile);
  SimulatedPack pack(plan.cell, plan.cells, plan.initial_soc, plan.spread);
  Injector injector(plan.injections, plan.spread.seed + 1);
  const double end_s = plan.profile.time_s.back() - plan.profile.time_s.front();
  const auto request_period =
      static_cast<std::uint64_t>(std::max(1L, std::lround(1 / plan.sample_period_s)));  // once a second
  double profile_s = 0, squares = 0;
  std::uint64_t judged = 0, inside = 0;
  std::vector<float> sigmas;
  std::uint8_t request_counter = 0;
  double dc_link_v = 0, replayed_dc_link_v = 0;

  const auto exchange_frames = [&](double time_s, const std::vector<can::Frame>& frames) {
    received.status_received = received.pack_received = false;
    for (const can::Frame& f : link.exchange(time_s, frames)) {
      ++result.frames;
      received.receive(time_s, f);
      if (frame) frame(time_s, f);
    }
  };
  if (plan.announced_soc) {
    exchange_frames(0, {hal::frame_of(measurement::StartingPoint{
                           static_cast<std::int32_t>(std::lround(1e9 * *plan.announced_soc)), 20'000'000})});
  }

  for (std::uint64_t k = 0; profile_s <= end_s + (plan.replayed ? 0 : shutdown_s); ++k) {
    const double time_s = static_cast<double>(k) * plan.sample_period_s;
    const ContactorCommand closed{received.contactors.main_plus != 0, received.contactors.main_minus != 0,
                                  received.contactors.precharge != 0};
    const bool driving = closed.main_plus && closed.main_minus;
    if (driving && !result.driving_after_s) result.driving_after_s = time_s;
    // a drive, or what was recorded of one, begins when the contactors are closed; nothing waits for ever
    const bool moves = result.driving_after_s || time_s > precharge_gives_up_s;
    if (moves && k > 0) profile_s += plan.sample_period_s;
    const bool shutting_down = profile_s > end_s;
    profile.go_to(profile_s);

    ContactorCommand real = closed;
    if (injector.active("precharge_open", time_s)) real.precharge = false;
    const bool welded = injector.active("welded", time_s), obeys = !injector.active("overcurrent", time_s);
    const double most_a = plan.cell.parameters.limits.discharge_current_max_a;
    pack.run(shutting_down ? 0
             : obeys       ? load_current_a(received, profile.current_a(), true)
                           : load_current_a(received, -1.6 * most_a, false),
             real, welded, profile.temperature_c(), k == 0 ? 0 : plan.sample_period_s);
    auto sample = pack.read(static_cast<std::uint64_t>(std::llround(1e6 * time_s)), profile.temperature_c());
    double truth = pack.soc();
    dc_link_v = pack.dc_link_v();
    if (plan.replayed) {
      const auto volts = static_cast<std::int32_t>(std::lround(1e6 * profile.voltage_v(profile_s)));
      const double recorded_a = moves ? profile.current_a() : 0;
      const bool conducts = real.conducts(welded);
      sample.current_ua = conducts ? static_cast<std::int32_t>(std::lround(1e6 * recorded_a)) : 0;
      if (!conducts && std::abs(recorded_a) > rest_c_rate * plan.cell.parameters.capacity_ah && !result.cut_off_at_s)
        result.cut_off_at_s = time_s;
      for (std::size_t c = 0; c < plan.cells; ++c) sample.cell_uv[c] = volts;
      sample.pack_uv = static_cast<std::int32_t>(plan.cells) * volts;
      truth = result.cut_off_at_s ? std::nan("") : profile.soc_ref(profile_s);
      replayed_dc_link_v =
          dc_link_voltage_after(replayed_dc_link_v, 1e-6 * sample.pack_uv, real, welded, plan.sample_period_s);
      dc_link_v = replayed_dc_link_v;
    }
    injector.apply(time_s, sample);

    std::vector<can::Frame> frames;
    if (k % request_period == 0)
      frames.push_back(request(static_cast<std::uint32_t>(shutting_down && profile_s <= end_s + reclose_request_s
                                                              ? protection::Request::none
                                                              : protection::Request::drive),
                               request_counter = can::next(request_counter)));
    const auto measured = plan.cells == 1 ? frames_for<1>(sample, dc_link_v, static_cast<std::uint16_t>(k))
                                          : frames_for<max_cells>(sample, dc_link_v, static_cast<std::uint16_t>(k));
    for (const can::Frame& f : injector.apply(time_s, measured)) frames.push_back(f);
    exchange_frames(time_s, frames);

    ++result.samples;
    if (!received.status_received) ++result.unanswered;
    if (received.pack_received && std::isfinite(received.pack.soc) && std::isfinite(truth)) {
      const double error = 0.01 * static_cast<double>(received.pack.soc) - truth,
                   sigma = 0.01 * static_cast<double>(received.pack.soc_sigma);
      ++result.soc_published;
      squares += error * error;
      ++judged;
      if (std::abs(error) <= 2 * sigma) ++inside;
      if (std::abs(error) > std::max(3 * sigma, 0.02)) ++result.soc_wrong;
      result.soc_max_error = std::max(result.soc_max_error, std::abs(error));
      sigmas.push_back(static_cast<float>(sigma));
    }
    if (result.trace.empty() || time_s - result.trace.back().time_s >= trace_every_s) {
      double lowest = std::numeric_limits<double>::infinity(), highest = 0;
      for (std::size_t c = 0; c < plan.cells; ++c) {
        lowest = std::min(lowest, 1e-6 * sample.cell_uv[c]);
        highest = std::max(highest, 1e-6 * sample.cell_uv[c]);
      }
      result.trace.push_back({time_s,
                              0.01 * static_cast<double>(received.pack.soc),
                              0.01 * static_cast<double>(received.pack.soc_sigma),
                              truth,
                              1e-6 * sample.current_ua,
                              lowest,
                              highest,
                              dc_link_v,
                              {}});
      if (progress) progress(end_s > 0 ? std::min(1.0, profile_s / end_s) : 1);
    }
    result.duration_s = time_s;
  }

  if (judged > 0) {
    result.soc_rmse = std::sqrt(squares / static_cast<double>(judged));
    result.within_2_sigma = static_cast<double>(inside) / static_cast<double>(judged);
    const auto middle = sigmas.begin() + static_cast<std::ptrdiff_t>(sigmas.size() / 2);
    std::nth_element(sigmas.begin(), middle, sigmas.end());
    result.median_sigma = static_cast<double>(*middle);
  }
  result.lost = received.lost();
  result.crc_errors = received.crc_errors();
  result.faults = received.faults;
  for (const Injection& i : injector.all()) {
    InjectionResult r{i, {}, true};
    if (!i.expected.empty() && i.from_s <= result.duration_s) {
      for (const FaultEvent& f : result.faults) {
        if (f.name == i.expected && f.raised_at_s >= i.from_s && !r.after_s) r.after_s = f.raised_at_s - i.from_s;
      }
      r.in_time = r.after_s && *r.after_s <= i.within_s;
    }
    result.injection_results.push_back(r);
  }
  const double wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  result.speedup = wall_s > 0 ? result.duration_s / wall_s : 0;
  return result;
}

}  // namespace bms::hil
