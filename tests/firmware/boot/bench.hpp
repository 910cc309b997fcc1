// A battery with two slots on the flash model, and signed images for it. Keys are made when the test runs.
#pragma once

#include <gtest/gtest.h>

#include <map>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "boot/receiver.hpp"
#include "boot/slots.hpp"
#include "files/temporary_folder.hpp"
#include "tests/firmware/storage/flash_model.hpp"
#include "update/container_file.hpp"

namespace bms::boot {

inline const update::SigningKey& key_of(const std::string& name) {
  static const files::TemporaryFolder folder;
  static std::map<std::string, std::unique_ptr<update::SigningKey>> keys;
  auto& key = keys[name];
  if (!key) {
    const auto path = (folder.path() / (name + ".pem")).string();
    update::make_key(path);
    key = std::make_unique<update::SigningKey>(path);
  }
  return *key;
}

/// Sectors 0 and 1 of the model are the slots, sector 2 the one-time words.
class ModelSlots : public SlotFlash {
 public:
  explicit ModelSlots(FlashModel& model) : model_(&model) {}
  std::uint32_t slot_bytes() const override { return model_->size().sector_bytes; }
  bool erase(std::uint8_t slot) override { return model_->erase(slot); }
  bool program(std::uint8_t slot, std::uint32_t at, std::uint32_t word) override {
    return model_->program(slot, at, word);
  }
  void read(std::uint8_t slot, std::uint32_t at, std::span<std::uint8_t> into) override {
    model_->read(slot, at, into);
  }
  std::uint32_t one_time(std::uint32_t word) override {
    std::array<std::uint8_t, 4> bytes{};
    model_->read(2, 4 * word, bytes);
    return hal::get_bytes<std::uint32_t>(bytes, 0);
  }
  /// One-time memory clears bits of a word one after the other, so it is allowed; the model would count it as a fault.
  bool program_one_time(std::uint32_t word, std::uint32_t value) override {
    model_->program(2, 4 * word, value);
    return true;
  }

 private:
  FlashModel* model_;
};

/// Slots of an image that cannot erase, because its code is in the same bank.
class SlotsOfAnImage final : public SlotFlash {
 public:
  explicit SlotsOfAnImage(SlotFlash& chip) : chip_(chip) {}
  std::uint32_t slot_bytes() const override { return chip_.slot_bytes(); }
  bool erases_now() const override { return may_erase; }
  bool erase(std::uint8_t slot) override { return may_erase && chip_.erase(slot); }
  bool program(std::uint8_t slot, std::uint32_t at, std::uint32_t word) override {
    return chip_.program(slot, at, word);
  }
  void read(std::uint8_t slot, std::uint32_t at, std::span<std::uint8_t> into) override { chip_.read(slot, at, into); }
  std::uint32_t one_time(std::uint32_t word) override { return chip_.one_time(word); }
  bool program_one_time(std::uint32_t word, std::uint32_t value) override {
    return chip_.program_one_time(word, value);
  }
  bool may_erase = true;

 private:
  SlotFlash& chip_;
};

struct ImageWish {
  std::uint8_t slot = 0;
  std::uint32_t version = 0x000200, security_version = 1, bytes = 9'000, seed = 1;
  std::string board = "board", key = "product";
  bool development = false;
  std::uint32_t oldest_loader = 0;
  Kind kind = Kind::application;
};

inline update::Payload payload_of(const ImageWish& w) {
  update::Payload p;
  p.header.kind = w.kind;
  p.header.slot = w.slot;
  p.header.version = w.version;
  p.header.security_version = w.security_version;
  p.header.oldest_loader = w.oldest_loader;
  p.header.flags = w.development ? flag_development : 0;
  std::ranges::copy(w.board, p.header.board.begin());
  std::mt19937 random(w.seed * 2 + w.slot);
  for (std::uint32_t k = 0; k < w.bytes; ++k) p.bytes.push_back(static_cast<char>(random()));
  return p;
}

inline std::string image(const ImageWish& w) { return sign({payload_of(w)}, key_of(w.key)).front().bytes; }

inline std::span<const std::uint8_t> bytes_of(const std::string& text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

class Bench {
 public:
  static constexpr std::uint32_t sector_bytes = 16 * 1024;

  explicit Bench(std::uint64_t seed = 1) : flash_({3, sector_bytes}, seed), slots_(flash_) {
    keys_ = {{key_of("product").public_key(), false, false},
             {key_of("next").public_key(), false, false},
             {key_of("development").public_key(), true, false},
             {key_of("revoked").public_key(), false, true}};
    battery_ = {"board", keys_, 0, 0x000100, sector_bytes - trailer_bytes, true, Kind::application};
  }

  Battery& battery() {
    battery_.security_counter = security_counter(slots_);
    return battery_;
  }
  FlashModel& flash() { return flash_; }
  SlotFlash& slots() { return slots_; }

  Start reset(bool power_on = false) { return choose(slots_, battery(), power_on); }
  /// The whole container, or the first refusal.
  Refusal transfer(const std::string& container, std::uint8_t running, std::size_t piece = 1'000) {
    Receiver receiver(slots_, battery(), running);
    if (const Refusal r = receiver.prepare(); r != Refusal::none) return r;
    if (const Refusal r = receiver.begin(static_cast<std::uint32_t>(container.size())); r != Refusal::none) return r;
    for (std::size_t at = 0; at < container.size(); at += piece) {
      const auto bytes = bytes_of(container).subspan(at, std::min(piece, container.size() - at));
      if (const Refusal r = receiver.take(bytes); r != Refusal::none) return r;
    }
    return receiver.finish();
  }
  /// As a battery leaves the production: a confirmed image in slot A.
  void produce(const ImageWish& w) { produce(image(w), w.security_version); }
  void produce(const std::string& container, std::uint32_t security_version) {
    ASSERT_EQ(transfer(container, 2), Refusal::none);
    ASSERT_TRUE(reset(true).trial);
    ASSERT_TRUE(confirm(slots_, 0, security_version));
    const Start start = reset(true);
    ASSERT_TRUE(start.found && !start.trial && start.slot == 0);
  }

 private:
  std::vector<TrustedKey> keys_;
  FlashModel flash_;
  ModelSlots slots_;
  Battery battery_;
};

}  // namespace bms::boot
