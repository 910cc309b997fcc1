// The firmware of the forklift board on this machine, with its own flash model: the reference for sent frames and
// stored records.
#pragma once

#include <optional>
#include <vector>

#include "tests/firmware/host_hal.hpp"
#include "tests/firmware/storage/flash_model.hpp"

namespace bms::firmware {

using Pack = measurement::PackSample<16>;

/// The application's Board of this board, with the cell from its file.
struct ForkliftCell : host_hal::Table9Board<Pack::cells> {
  static const protection::ProtectionPlan& plan() {
    static const auto plan = protection::protection_plan(design(0.1));
    return plan;
  }
};

/// Input of the board for one sample.
struct Input {
  Pack pack;
  hal::LinkVoltages link{0, 0};
  std::optional<can::Frame> command = std::nullopt;  ///< received before the sample
};

/// All sectors, one after the other.
inline void fill(FlashModel& flash, const std::vector<std::uint8_t>& bytes) {
  const std::uint32_t each = flash.size().sector_bytes;
  for (std::uint32_t k = 0; k < flash.size().sectors; ++k)
    flash.fill(k, {bytes.begin() + k * each, bytes.begin() + (k + 1) * each});
}
inline std::vector<std::uint8_t> bytes_of(FlashModel& flash) {
  std::vector<std::uint8_t> all;
  for (std::uint32_t k = 0; k < flash.size().sectors; ++k) {
    const auto sector = flash.bytes(k);
    all.insert(all.end(), sector.begin(), sector.end());
  }
  return all;
}

class HostBoard {
 public:
  static constexpr std::uint32_t sectors = 3, sector_bytes = 0x4000;  // of the STM32F405, after the vectors

  explicit HostBoard(const std::vector<std::uint8_t>& flash,
                     const std::optional<measurement::StartingPoint>& start = std::nullopt) {
    fill(flash_, flash);
    plug_in(&flash_);
    host_hal::sent.clear();
    host_hal::requests.clear();
    host_hal::switched = {};
    persistence_.start(hal::reset_cause(), hal::last_fault(), hal::calendar_s());
    application_.emplace(start ? start : stored_starting_point(persistence_, host_hal::cell_hash),
                         messages::Identity{host_hal::cell_hash, 0x000200},
                         static_cast<float>(tests::table9.capacity_ah), persistence_);
  }
  ~HostBoard() { plug_in(nullptr); }
  HostBoard(const HostBoard&) = delete;
  HostBoard& operator=(const HostBoard&) = delete;

  void process_sample(const Input& in) {
    host_hal::link_readings = in.link;
    if (in.command) host_hal::requests.push_back(*in.command);
    application_->process_sample(in.pack);
  }
  void shut_down() { application_->shut_down(); }
  std::vector<std::uint8_t> flash() { return bytes_of(flash_); }
  /// From now on no word can be programmed and no sector erased.
  void wear_out_flash() {
    for (std::uint32_t k = 0; k < sectors; ++k) {
      flash_.wear_out(k, FlashModel::Wear::bits_stuck_at_one);
      flash_.wear_out(k, FlashModel::Wear::erase_fails);
    }
  }
  const storage::Persistence& persistence() const { return persistence_; }

 private:
  FlashModel flash_{{sectors, sector_bytes}, 1};
  storage::Persistence persistence_;
  std::optional<Application<ForkliftCell>> application_;
};

}  // namespace bms::firmware
