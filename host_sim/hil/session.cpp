#include "hil/session.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>

#include "can_messages.hpp"  // generated from firmware/can/greybox_bms.dbc
#include "hal/sample_frames.hpp"
#include "hil/load_profile.hpp"
#include "measurement/statistics.hpp"
#include "protection/contactors.hpp"

namespace bms::hil {

namespace {

constexpr double longest_wait_for_drive_s = 60;  // then the profile starts although the contactors are open
constexpr double trace_points = 2'000, shortest_trace_s = 1, longest_trace_s = 10;  ///< distance of two points
constexpr double rest_c_rate = 0.02;        // a recorded current below this is rest
constexpr double overcurrent_factor = 1.6;  // load of the injection `overcurrent`, by the discharge limit
constexpr double soc_tolerance = 0.02;      // a published SOC is wrong if it is off by more, and by three sigma
constexpr std::int32_t announced_soc_sigma_ppb = 20'000'000;
/// After the profile no drive is requested for `reclose_request_s`, so that the contactors open. Then it is requested
/// again until `shutdown_s`: the self-test before closing detects a welded contactor.
constexpr double shutdown_s = 20, reclose_request_s = 12;

std::int32_t micro(double value) { return static_cast<std::int32_t>(std::lround(1e6 * value)); }

/// Micro-units as volts or amperes; NaN if the reading is missing.
double value_of(std::int32_t micro_units) {
  return micro_units == measurement::no_reading ? std::nan("") : 1e-6 * micro_units;
}
std::int32_t reading_of(double value) { return std::isfinite(value) ? micro(value) : measurement::no_reading; }

can::Frame request(protection::Request what, std::uint8_t counter) {
  can::Command command;
  command.code = can::Command::code_request;
  command.argument = static_cast<std::uint32_t>(what);
  return command.frame(counter);
}

template <std::size_t Cells>
std::vector<can::Frame> frames_of_cells(const measurement::PackSample<max_cells>& all, const plant::LinkPoles& link,
                                        std::uint16_t counter) {
  measurement::PackSample<Cells> s;
  s.time_us = all.time_us;
  s.current_ua = all.current_ua;
  s.pack_uv = Cells == 1 ? all.cell_uv[0] : all.pack_uv;
  std::copy_n(all.cell_uv.begin(), Cells, s.cell_uv.begin());
  s.temperature_cdegc = all.temperature_cdegc;
  const auto frames = hal::frames_of(s, micro(link.plus_v), counter, micro(link.minus_v));
  return {frames.begin(), frames.end()};
}

/// The frames of a sample of the first `cells` cells, from 1 to max_cells.
template <std::size_t Cells = max_cells>
std::vector<can::Frame> frames_for(const measurement::PackSample<max_cells>& all, std::size_t cells,
                                   const plant::LinkPoles& link, std::uint16_t counter) {
  if constexpr (Cells > 1) {
    if (cells < Cells) return frames_for<Cells - 1>(all, cells, link, counter);
  }
  return frames_of_cells<Cells>(all, link, counter);
}

/// Whether the board is ready for a load.
bool ready(const can::ContactorState& contactors) {
  return contactors.state == can::ContactorState::state_drive || contactors.state == can::ContactorState::state_charge;
}

double clamp_to_allowed(double wanted_a, const can::AllowedCurrent& allowed) {
  const auto at_most = [](float limit_a) { return std::isfinite(limit_a) ? static_cast<double>(limit_a) : 0; };
  return std::clamp(wanted_a, -at_most(allowed.discharge), at_most(allowed.charge));
}

/// Statistics of the published state of charge against the true one.
class SocErrors {
 public:
  void add(double error, double sigma) {
    errors_.add(error);
    if (std::abs(error) <= 2 * sigma) ++inside_;
    if (std::abs(error) > std::max(3 * sigma, soc_tolerance)) ++wrong_;
    largest_ = std::max(largest_, std::abs(error));
    sigmas_.push_back(static_cast<float>(sigma));
  }
  void write_to(SessionResult& result) {
    result.soc_published = sigmas_.size();
    result.soc_wrong = wrong_;
    result.soc_max_error = largest_;
    if (sigmas_.empty()) return;
    const auto count = static_cast<double>(sigmas_.size());
    result.soc_rmse = errors_.root();
    result.within_2_sigma = static_cast<double>(inside_) / count;
    result.median_sigma = static_cast<double>(measurement::upper_median(sigmas_));
  }

 private:
  measurement::MeanSquare errors_;
  double largest_ = 0;
  std::uint64_t inside_ = 0, wrong_ = 0;
  std::vector<float> sigmas_;
};

InjectionResult reaction_to(const Injection& injection, const SessionResult& result) {
  InjectionResult reaction{injection, {}, true};
  if (injection.expected.empty() || injection.from_s > result.duration_s) return reaction;
  for (const FaultEvent& fault : result.faults) {
    if (fault.name == injection.expected && fault.raised_at_s >= injection.from_s && !reaction.after_s)
      reaction.after_s = fault.raised_at_s - injection.from_s;
  }
  reaction.in_time = reaction.after_s && *reaction.after_s <= injection.within_s;
  return reaction;
}

class Session {
 public:
  Session(BoardLink& link, const SessionPlan& plan, const std::function<void(double, const can::Frame&)>& frame,
          const std::function<void(double)>& progress)
      : link_(link),
        plan_(plan),
        frame_(frame),
        progress_(progress),
        profile_(plan.profile),
        pack_(plan.cell, plan.cells, plan.initial_soc, plan.spread),
        injector_(plan.injections, plan.spread.seed + 1) {}

  SessionResult run() {
    announce_soc();
    const double last_s = profile_.duration_s() + (plan_.replayed ? 0 : shutdown_s);
    const auto steps_per_request =
        static_cast<std::uint64_t>(std::max(1L, std::lround(1 / plan_.sample_period_s)));  // one request per second
    for (std::uint64_t k = 0; profile_s_ <= last_s; ++k) {
      const Step step = next_step(k);
      Measured measured = measure(step);
      injector_.apply(step.time_s, measured.sample);
      std::vector<can::Frame> frames;
      if (k % steps_per_request == 0) frames.push_back(next_request(step));
      for (const can::Frame& f : injector_.apply(step.time_s, sample_frames(measured, k))) frames.push_back(f);
      exchange(step.time_s, frames);
      judge(step, measured);
    }
    finish();
    return std::move(result_);
  }

 private:
  struct Step {
    double time_s = 0, duration_s = 0;
    ContactorCommand contactors;  ///< as commanded, with the injected faults
    bool welded = false;
    bool profile_runs = false;   ///< false until the contactors are closed for the first time
    bool shutting_down = false;  ///< the profile has ended
  };
  /// What the sensors read, and the truth.
  struct Measured {
    measurement::PackSample<max_cells> sample;
    double soc_true = 0;  ///< NaN: unknown
    double dc_link_v = 0;
    plant::LinkPoles link;
  };

  void announce_soc() {
    if (!plan_.announced_soc) return;
    exchange(0, {hal::frame_of(measurement::StartingPoint{
                    static_cast<std::int32_t>(std::lround(1e9 * *plan_.announced_soc)), announced_soc_sigma_ppb})});
  }

  void exchange(double time_s, const std::vector<can::Frame>& frames) {
    received_.status_received = received_.pack_received = false;
    for (const can::Frame& f : link_.exchange(time_s, frames)) {
      ++result_.frames;
      received_.receive(time_s, f);
      if (frame_) frame_(time_s, f);
    }
  }

  Step next_step(std::uint64_t k) {
    Step step;
    step.time_s = static_cast<double>(k) * plan_.sample_period_s;
    step.duration_s = k == 0 ? 0 : plan_.sample_period_s;
    step.contactors = {received_.contactors.main_plus != 0, received_.contactors.main_minus != 0,
                       received_.contactors.precharge != 0};
    if (step.contactors.main_plus && step.contactors.main_minus && !result_.driving_after_s)
      result_.driving_after_s = step.time_s;
    step.profile_runs = result_.driving_after_s || step.time_s > longest_wait_for_drive_s;
    if (step.profile_runs && k > 0) profile_s_ += plan_.sample_period_s;
    step.shutting_down = profile_s_ > profile_.duration_s();
    profile_.go_to(profile_s_);
    if (injector_.active("precharge_open", step.time_s)) step.contactors.precharge = false;
    step.welded = injector_.active("welded", step.time_s);
    return step;
  }

  double load_a(const Step& step) const {
    if (step.shutting_down || !ready(received_.contactors)) return 0;
    if (injector_.active("overcurrent", step.time_s))
      return -overcurrent_factor * plan_.cell.parameters.limits.discharge_current_max_a;
    return clamp_to_allowed(profile_.current_a(), received_.allowed);
  }

  Measured measure(const Step& step) {
    const double temperature_c = profile_.temperature_c();
    pack_.run(load_a(step), step.contactors, step.welded, temperature_c, step.duration_s);
    Measured measured{pack_.read(static_cast<std::uint64_t>(std::llround(1e6 * step.time_s)), temperature_c),
                      pack_.soc(),
                      pack_.dc_link_v(),
                      {}};
    if (plan_.replayed) replace_by_recording(step, measured);
    measured.link =
        plant::link_poles(step.contactors.connects_plus(step.welded), step.contactors.main_minus,
                          plan_.replayed ? 1e-6 * measured.sample.pack_uv : pack_.pack_v(), measured.dc_link_v);
    return measured;
  }

  /// The recording instead of the simulated pack; the sensors have no noise of their own.
  void replace_by_recording(const Step& step, Measured& measured) {
    const double recorded_a = step.profile_runs ? profile_.current_a() : 0;
    const bool conducts = step.contactors.conducts(step.welded);
    if (!conducts && std::abs(recorded_a) > rest_c_rate * plan_.cell.parameters.capacity_ah && !result_.cut_off_at_s)
      result_.cut_off_at_s = step.time_s;
    auto& sample = measured.sample;
    sample.current_ua = conducts ? micro(recorded_a) : 0;
    const std::int32_t mean_uv = reading_of(profile_.voltage_v(profile_s_));
    if (mean_uv != measurement::no_reading) replayed_pack_uv_ = 0;  // of a missing cell: the mean
    for (std::size_t c = 0; c < plan_.cells; ++c) {
      sample.cell_uv[c] = reading_of(profile_.cell_voltage_v(c, profile_s_));
      if (mean_uv == measurement::no_reading) continue;
      replayed_pack_uv_ += sample.cell_uv[c] == measurement::no_reading ? mean_uv : sample.cell_uv[c];
    }
    sample.pack_uv = replayed_pack_uv_;
    measured.soc_true = result_.cut_off_at_s ? std::nan("") : profile_.soc_ref(profile_s_);
    replayed_dc_link_v_ = dc_link_voltage_after(replayed_dc_link_v_, 1e-6 * sample.pack_uv, step.contactors,
                                                step.welded, plan_.sample_period_s);
    measured.dc_link_v = replayed_dc_link_v_;
  }

  can::Frame next_request(const Step& step) {
    const bool released = step.shutting_down && profile_s_ <= profile_.duration_s() + reclose_request_s;
    request_counter_ = can::next(request_counter_);
    if (plan_.key && !released) return drive_request();
    return request(released ? protection::Request::none : protection::Request::drive, request_counter_);
  }

  /// With the key of the board; the freshness starts again with each challenge.
  can::Frame drive_request() {
    const can::RequestChallenge& now = received_.request_challenge;
    const std::uint64_t challenge = now.challenge_low | static_cast<std::uint64_t>(now.challenge_high) << 32;
    if (challenge != challenge_) freshness_ = 0;
    challenge_ = challenge;
    can::DriveRequest m;
    m.request = can::DriveRequest::request_drive;
    m.freshness = ++freshness_;
    const authentication::Cmac drive(authentication::role_key(*plan_.key, authentication::Role::drive));
    m.code = authentication::drive_code(drive, challenge_, freshness_, can::DriveRequest::request_drive);
    return m.frame(request_counter_);
  }

  std::vector<can::Frame> sample_frames(const Measured& measured, std::uint64_t k) const {
    return frames_for(measured.sample, plan_.cells, measured.link, static_cast<std::uint16_t>(k));
  }

  double trace_every_s() const {
    return std::clamp(profile_.duration_s() / trace_points, shortest_trace_s, longest_trace_s);
  }

  void judge(const Step& step, const Measured& measured) {
    ++result_.samples;
    result_.duration_s = step.time_s;
    if (!received_.status_received) ++result_.unanswered;
    const double soc = 0.01 * static_cast<double>(received_.pack.soc),
                 sigma = 0.01 * static_cast<double>(received_.pack.soc_sigma);
    if (received_.pack_received && std::isfinite(received_.pack.soc) && std::isfinite(measured.soc_true))
      soc_errors_.add(soc - measured.soc_true, sigma);
    if (!result_.trace.empty() && step.time_s - result_.trace.back().time_s < trace_every_s()) return;
    const auto [lowest_v, highest_v] = voltage_range_v(measured.sample, plan_.cells);
    result_.trace.push_back({.time_s = step.time_s,
                             .soc = soc,
                             .soc_sigma = sigma,
                             .soc_true = measured.soc_true,
                             .current_a = value_of(measured.sample.current_ua),
                             .lowest_v = lowest_v,
                             .highest_v = highest_v,
                             .dc_link_v = measured.dc_link_v,
                             .allowed_charge_a = static_cast<double>(received_.allowed.charge),
                             .allowed_discharge_a = static_cast<double>(received_.allowed.discharge)});
    const double end_s = profile_.duration_s();
    if (progress_) progress_(end_s > 0 ? std::min(1.0, profile_s_ / end_s) : 1);
  }

  void finish() {
    soc_errors_.write_to(result_);
    result_.lost = received_.lost();
    result_.crc_errors = received_.crc_errors();
    result_.faults = received_.faults;
    for (const Injection& injection : injector_.all())
      result_.injection_results.push_back(reaction_to(injection, result_));
  }

  BoardLink& link_;
  const SessionPlan& plan_;
  const std::function<void(double, const can::Frame&)>& frame_;
  const std::function<void(double)>& progress_;
  LoadProfile profile_;
  SimulatedPack pack_;
  Injector injector_;
  ReceivedState received_;
  SocErrors soc_errors_;
  SessionResult result_;
  double profile_s_ = 0, replayed_dc_link_v_ = 0;
  std::int32_t replayed_pack_uv_ = 0;
  std::uint8_t request_counter_ = 0;
  std::uint64_t challenge_ = 0;
  std::uint16_t freshness_ = 0;
};

}  // namespace

std::pair<double, double> voltage_range_v(const measurement::PackSample<max_cells>& sample, std::size_t cells) {
  std::pair<double, double> range{std::nan(""), std::nan("")};
  for (std::size_t c = 0; c < cells; ++c) {
    const double cell_v = value_of(sample.cell_uv[c]);
    range = {std::fmin(range.first, cell_v), std::fmax(range.second, cell_v)};  // of a missing reading the other one
  }
  return range;
}

SessionResult run_session(BoardLink& link, const SessionPlan& plan,
                          const std::function<void(double, const can::Frame&)>& frame,
                          const std::function<void(double)>& progress) {
  const auto begin = std::chrono::steady_clock::now();
  SessionResult result = Session(link, plan, frame, progress).run();
  const double wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  result.speedup = wall_s > 0 ? result.duration_s / wall_s : 0;
  return result;
}

}  // namespace bms::hil
