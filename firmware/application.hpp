// What the firmware does with each sample: estimate, record, look at the whole, protect, tell, listen, feed the watchdog.
//
//   Board   cells, and as functions what depends on the cell file: a step of the estimator, what is known beside it, the cells beside their mean,
//           what a reading may be, the plan of protection (firmware/board_cell.hpp; a test brings its own)
//
// Sees the estimator, protection and the hal, never a register; runs on a host that supplies the few functions of hal/ it calls.
#pragma once

#include <optional>
#include <utility>

#include "estimator/pack_estimator.hpp"
#include "estimator/soc_estimator.hpp"
#include "firmware/commands.hpp"
#include "firmware/telemetry.hpp"
#include "hal/power_path.hpp"
#include "hal/record.hpp"
#include "hal/requests.hpp"
#include "hal/watchdog.hpp"
#include "protection/protection.hpp"

namespace bms {

template <class Board>
class Application {
 public:
  using Estimator = typename Board::Estimator;
  using Result = typename Estimator::Result;
  static constexpr std::size_t cells = Board::cells;

  Application(const std::optional<StartingPoint>& start, const messages::Identity& identity, float capacity_ah)
      : estimator_{start ? Estimator(*start) : Estimator()}, protection_{Board::plan()}, telemetry_{identity, capacity_ah, start} {}

  void take(const PackSample<cells>& pack) {
    const Sample mean = mean_cell(pack, Board::plausible());
    const Result estimate = Board::step(estimator_, mean);
    hal::record(words(estimate));
    const auto request = requested_.power_now(pack.time_us);
    Board::look(condition_, estimator_, mean, estimate, hal::can_listening() || request != protection::Request::none);
    if constexpr (cells > 1) Board::tell_apart(cells_, pack, estimate);
    protect(pack, estimate, request);
    telemetry_.tell(pack, mean, estimate, condition_, cells_, protection_.decision(), requested_.log_samples);
    hear(pack.time_us);
    hal::watchdog_feed();
  }

 private:
  static constexpr int most_requests = 4;  // a sample must not take longer because somebody asks much

  void protect(const PackSample<cells>& pack, const Result& estimate, protection::Request request) {
    protection::PackEstimate<cells> known;
    if ((estimate.flags & not_started) == 0) {
      known.soc_ppb = messages::ppb(estimate.soc);
      known.soc_sigma_ppb = messages::ppb(estimate.soc_sigma);
      known.contradicts = (estimate.flags & voltage_disbelieved) != 0;
      if (condition_.limits_known()) {
        known.model_charge_ua = model::to_micro(condition_.limits_10s().charge_a);
        known.model_discharge_ua = model::to_micro(condition_.limits_10s().discharge_a);
      }
      for (std::size_t k = 0; k < cells; ++k) {
        known.cell_soc_ppb[k] = cells > 1 ? messages::ppb(cells_[k].soc()) : 0;
        known.cell_sigma_ppb[k] = cells > 1 ? messages::ppb(cells_[k].soc_sigma()) : 0;
      }
    }
    protection::Orders orders;
    orders.request = request;
    orders.clear = std::exchange(requested_.clear, protection::Clear::none);
    orders.link_uv = hal::link_uv();
    orders.board_fault = first_ && hal::reset_cause() == hal::ResetCause::watchdog;
    first_ = false;
    const auto& decision = protection_.update(pack, known, orders);
    hal::power_path_set({decision.outputs.main_plus, decision.outputs.main_minus, decision.outputs.precharge, decision.outputs.charge_enable, decision.bleed});
  }

  void hear(std::uint64_t now_us) {
    hal::CanFrame frame;
    for (int k = 0; k < most_requests && hal::next_request(frame); ++k) {
      if (const auto answer = commands_.take(frame, now_us, requested_)) telemetry_.answer(*answer);
    }
  }

  Estimator estimator_;
  Condition<Estimator> condition_;
  PackCells<typename Estimator::Scalar, cells> cells_;
  protection::Protection<cells> protection_;
  Telemetry<Estimator, cells> telemetry_;
  Commands commands_;
  Requested requested_;
  bool first_ = true;
};

}  // namespace bms
