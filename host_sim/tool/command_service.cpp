// bms service: one command of a service session, over CAN (host_sim/monitor/service_client.hpp).
#include <array>
#include <chrono>
#include <ctime>
#include <map>
#include <memory>

#include <fmt/format.h>

#include "files/bad_input.hpp"
#include "monitor/bus_state.hpp"
#include "monitor/frame_source.hpp"
#include "monitor/service_client.hpp"
#include "tool/commands.hpp"
#include "tool/key_file.hpp"
#include "tool/options.hpp"

namespace bms::tool {

namespace {

using namespace monitor;

constexpr int read_wait_ms = 50;

struct ServiceOptions {
  std::string source, key, what;
  std::int64_t value = 0;
  unsigned operator_number = 0;
  CLI::Option* given = nullptr;
};

const std::map<std::string, std::uint32_t>& commands() {
  static const std::map<std::string, std::uint32_t> all{
      {"clear-faults", can::Command::code_clear_faults}, {"clear-latched", can::Command::code_clear_faults},
      {"set-time", can::Command::code_set_time},         {"switch-off", can::Command::code_switch_off},
      {"voltage-gain", can::Command::code_voltage_gain}, {"voltage-offset", can::Command::code_voltage_offset},
      {"current-gain", can::Command::code_current_gain}, {"current-offset", can::Command::code_current_offset}};
  return all;
}

std::uint32_t argument_of(const ServiceOptions& o) {
  if (o.what == "clear-faults" || o.what == "switch-off") return 0;
  if (o.what == "clear-latched") return 1;
  if (o.what == "set-time" && o.given->count() == 0) return static_cast<std::uint32_t>(std::time(nullptr));
  if (o.given->count() == 0)
    throw files::BadInput("--value", 1, fmt::format("is missing, expected the number for {}", o.what));
  return static_cast<std::uint32_t>(o.value);
}

double now_s() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

class ServiceCommand final : public Command {
 public:
  CLI::App* add(CLI::App& app) override {
    CLI::App& c = *app.add_subcommand(
        "service", "Send a command that needs a service session: clear faults, set the time, calibrate");
    c.footer("Example: bms service can0 clear-latched --key pack17.key --operator 42");
    c.add_option("source", o_.source, "can0, vcan0: SocketCAN; slcan:/dev/ttyACM0: a serial adapter")->required();
    c.add_option(
         "command", o_.what,
         "clear-faults; clear-latched: also those that only a workshop clears; set-time; switch-off: for transport "
         "and storage, until key or plug, refused by a board without BMS_SWITCHES_OFF; voltage-gain, "
         "current-gain [ppm]; voltage-offset [uV], current-offset [uA]")
        ->required()
        ->check(CLI::IsMember(commands()));
    c.add_option("--key", o_.key, "device key of this battery, 32 hexadecimal digits")
        ->required()
        ->check(not_empty())
        ->type_name("FILE");
    c.add_option("--operator", o_.operator_number, "who answers for it; stored with the command")
        ->check(Within(0, 65'535))
        ->capture_default_str();
    o_.given = c.add_option("--value", o_.value, "number of the command; set-time: seconds since 1970, or now")
                   ->check(Within(-2'147'483'648.0, 4'294'967'295.0));
    return &c;
  }

  int run() override {
    ServiceClient client(read_key(o_.key), static_cast<std::uint16_t>(o_.operator_number), commands().at(o_.what),
                         argument_of(o_));
    try {
      const auto source = open_source(o_.source);
      if (!source->live()) throw files::BadInput(o_.source, 1, "is a recording, expected a bus with the battery");
      if (!talk(*source, client)) return 1;
    } catch (const SourceError& error) {
      throw files::BadInput(error.source, error.line, error.what());
    }
    const bool done = client.state() == ServiceClient::State::done;
    fmt::print(done ? stdout : stderr, "{}: {}: {}\n", o_.source, o_.what, words_for(client.state()));
    return done ? 0 : 1;
  }

 private:
  /// Returns false, after one line on standard error, if nothing can be sent.
  bool talk(FrameSource& source, ServiceClient& client) {
    std::array<BusFrame, 256> room{};
    while (client.state() == ServiceClient::State::working && !source.ended()) {
      for (const can::Frame& frame : client.due(now_s())) {
        if (source.send(frame)) continue;
        fmt::print(stderr,
                   "{}: the frames cannot be sent; check that the interface is up and not in listen-only mode\n",
                   o_.source);
        return false;
      }
      if (client.state() != ServiceClient::State::working) break;
      const std::size_t n = source.read(room, read_wait_ms);
      for (std::size_t k = 0; k < n; ++k) {
        if (room[k].kind == FrameKind::standard) client.receive(to_can_frame(room[k]), now_s());
      }
    }
    return true;
  }

  ServiceOptions o_;
};

}  // namespace

std::unique_ptr<Command> service_command() { return std::make_unique<ServiceCommand>(); }

}  // namespace bms::tool
