#include "monitor/frame_source.hpp"

#include <charconv>
#include <ctime>
#include <optional>
#include <utility>

#include "hal/identifiers.hpp"

namespace bms::monitor {

namespace {

/// A source whose battery has other identifiers on the bus than those of the DBC file.
class Moved : public FrameSource {
 public:
  Moved(std::unique_ptr<FrameSource> source, const hal::Identifiers& identifiers)
      : source_(std::move(source)), identifiers_(identifiers) {}

  std::size_t read(std::span<BusFrame> room, int wait_ms) override {
    const std::size_t all = source_->read(room, wait_ms);
    malformed_ = source_->malformed();
    dropped_ = source_->dropped();
    std::size_t taken = 0;
    for (std::size_t k = 0; k < all; ++k) {
      can::Frame frame{room[k].id, 0, {}, room[k].long_id};
      if (room[k].kind == FrameKind::standard && !identifiers_.from_the_bus(frame)) continue;  // of another node
      room[taken] = room[k];
      room[taken++].id = frame.id;
    }
    return taken;
  }
  bool ended() const override { return source_->ended(); }
  bool live() const override { return source_->live(); }
  bool send(const can::Frame& frame) override { return source_->send(identifiers_.on_the_bus(frame)); }

 private:
  std::unique_ptr<FrameSource> source_;
  hal::Identifiers identifiers_;
};

/// Numbers after the name of a source: ",key=NUMBER", in decimal or as 0x...
struct Settings {
  std::optional<unsigned> base, stop, rate;

  /// Takes one from the end of `name`. Throws SourceError if it is not a number or above 0x7FF.
  bool take(std::string& name) {
    const std::size_t comma = name.rfind(',');
    const std::size_t equals = comma == std::string::npos ? comma : name.find('=', comma);
    if (equals == std::string::npos) return false;
    const std::string key = name.substr(comma + 1, equals - comma - 1);
    const std::pair<const char*, std::optional<unsigned>*> places[] = {
        {"base", &base}, {"stop", &stop}, {"rate", &rate}};
    std::optional<unsigned>* place = nullptr;
    for (const auto& [known, at] : places) {
      if (key == known) place = at;
    }
    if (place == nullptr) return false;
    const bool hexadecimal = name.compare(equals + 1, 2, "0x") == 0;
    const char* const end = name.data() + name.size();
    unsigned value = 0;
    const auto [rest, error] =
        std::from_chars(name.data() + equals + (hexadecimal ? 3 : 1), end, value, hexadecimal ? 16 : 10);
    constexpr unsigned last_id = 0x7FF;
    using hal::Identifiers;
    const bool takes_room = key == "base" && (value == 0 || value % Identifiers::block != 0);
    if (error != std::errc{} || rest != end || value > last_id || takes_room)
      throw SourceError(name, 1, "has no number after " + key + "=, expected one such as 0x400");
    *place = value;
    name.resize(comma);
    return true;
  }
};

std::unique_ptr<FrameSource> open_unmoved(const std::string& name, std::optional<unsigned> rate) {
  if (name.starts_with("slcan:")) return rate ? open_slcan(name.substr(6), *rate) : open_slcan(name.substr(6));
  if (rate)
    throw SourceError(name, 1, "has the bit rate of its interface or log, expected rate= after slcan:DEVICE only");
  if (name.starts_with("file:")) return open_dump(name.substr(5));
  if (name.empty() || name.find_first_of(":/. ") != std::string::npos) {
    throw SourceError(name, 1, "unknown source, expected a CAN interface (can0), slcan:DEVICE or file:DUMP.log");
  }
  return open_socketcan(name);
}

}  // namespace

std::int64_t clock_us() {
  timespec now{};
  clock_gettime(CLOCK_REALTIME, &now);
  return static_cast<std::int64_t>(now.tv_sec) * 1'000'000 + now.tv_nsec / 1'000;
}

std::unique_ptr<FrameSource> open_source(const std::string& name) {
  std::string plain = name;
  Settings settings;
  while (settings.take(plain)) continue;
  auto source = open_unmoved(plain, settings.rate);
  if (!settings.base && !settings.stop) return source;
  using hal::Identifiers;
  const auto base = static_cast<std::uint16_t>(settings.base.value_or(Identifiers::dbc_base));
  const auto stop = static_cast<std::uint16_t>(settings.stop.value_or(Identifiers::dbc_stop));
  return std::make_unique<Moved>(std::move(source), Identifiers({.bit_rate = 0, .base = base, .stop = stop}));
}

}  // namespace bms::monitor
