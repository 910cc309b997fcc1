// bms parameters: reads and sets the parameters of a battery over CAN (host_sim/monitor/parameters.hpp).
#include <array>
#include <chrono>
#include <memory>

#include <fmt/format.h>

#include "files/bad_input.hpp"
#include "files/text_file.hpp"
#include "files/toml_table.hpp"
#include "monitor/frame_source.hpp"
#include "monitor/parameters.hpp"
#include "monitor/service_client.hpp"
#include "tool/commands.hpp"
#include "tool/key_file.hpp"
#include "tool/options.hpp"

namespace bms::tool {

namespace {

using namespace monitor;

struct ParameterOptions {
  std::string source, what, name, value, key;
  unsigned operator_number = 0;
};

class ParametersCommand final : public Command {
 public:
  CLI::App* add(CLI::App& app) override {
    CLI::App& c = *app.add_subcommand(
        "parameters",
        "Read and set the parameters of a battery: limits, delays, capacity, shunt, bit rate, identifiers");
    c.footer("Example: bms parameters can0 set cell_voltage_max 3.55 --key pack17.key --operator 42");
    c.add_option("source", o_.source, "can0, vcan0: SocketCAN; slcan:/dev/ttyACM0: a serial adapter")->required();
    c.add_option("what", o_.what, "get [NAME]; set NAME VALUE; save FILE.toml; load FILE.toml")
        ->required()
        ->check(CLI::IsMember({"get", "set", "save", "load"}));
    c.add_option("name", o_.name, "name of a parameter, or a file");
    c.add_option("value", o_.value, "in the unit that `get` shows");
    c.add_option("--key", o_.key, "device key of this battery, 32 hexadecimal digits; set and load need it")
        ->check(not_empty())
        ->type_name("FILE");
    c.add_option("--operator", o_.operator_number, "who answers for it; stored with the change")
        ->check(Within(0, 65'535))
        ->capture_default_str();
    return &c;
  }

  int run() override {
    check_usage();
    try {
      source_ = open_source(o_.source);
      if (!source_->live()) throw files::BadInput(o_.source, 1, "is a recording, expected a bus with the battery");
      if (!read()) return 1;
      if (o_.what == "get") return get();
      if (o_.what == "save") return save();
      std::vector<std::int32_t> wanted = received_.raw();
      if (o_.what == "set")
        place(wanted, *find_parameter(o_.name), number(o_.value), "VALUE", 1);
      else
        load(wanted);
      return change(wanted);
    } catch (const SourceError& error) {
      throw files::BadInput(error.source, error.line, error.what());
    }
  }

 private:
  static constexpr int wait_ms = 50, format = 1;

  static double seconds() {
    return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
  }
  void check_usage() const {
    const bool changes = o_.what == "set" || o_.what == "load", file = o_.what == "save" || o_.what == "load";
    if (changes && o_.key.empty()) throw files::BadInput("--key", 1, "is missing, expected the key of this battery");
    if (file && o_.name.empty()) throw files::BadInput("FILE", 1, "is missing, expected the name of a TOML file");
    if (o_.what == "set" && o_.value.empty())
      throw files::BadInput("VALUE", 1, "is missing, expected NAME and VALUE of a parameter");
    if (!file && !o_.name.empty() && find_parameter(o_.name) == nullptr) {
      std::string names;
      for (const ParameterName& p : parameter_names()) names += fmt::format("{}{}", names.empty() ? "" : ", ", p.name);
      throw files::BadInput(o_.name, 1, "is not a parameter, expected one of " + names);
    }
    if (o_.what == "set") number(o_.value);
  }
  static double number(const std::string& text) {
    std::size_t used = 0;
    double value = 0;
    try {
      value = text.starts_with("0x") ? std::stoi(text, &used, 16) : std::stod(text, &used);
    } catch (const std::exception&) {
      used = 0;
    }
    if (used == 0 || used != text.size() || !(value > -1e9 && value < 1e9))
      throw files::BadInput("VALUE", 1, fmt::format("'{}' is not a number, expected one such as 3.55 or 0x400", text));
    return value;
  }

  /// Sends the frames and reads until `done`, or for `limit_s`. Returns false if nothing can be sent.
  template <class Due, class See, class Done>
  bool talk(double limit_s, Due&& due, See&& see, Done&& done) {
    std::array<BusFrame, 256> room{};
    for (const double end_s = seconds() + limit_s; !done() && seconds() < end_s && !source_->ended();) {
      for (const can::Frame& frame : due(seconds())) {
        if (source_->send(frame)) continue;
        fmt::print(stderr,
                   "{}: the frames cannot be sent; check that the interface is up and not in listen-only mode\n",
                   o_.source);
        return false;
      }
      const std::size_t n = source_->read(room, wait_ms);
      for (std::size_t k = 0; k < n; ++k) {
        if (room[k].kind == FrameKind::standard) see(to_can_frame(room[k]));
      }
    }
    return true;
  }

  /// Reads all parameters; asks again after a silence. Returns false, after one line, if they do not arrive.
  bool read() {
    constexpr double silence_s = 2.5, limit_s = 30;
    received_ = {};
    double next_s = 0;
    int asked = 0;
    bool unknown = false;
    const auto due = [&](double now_s) -> std::vector<can::Frame> {
      if (now_s < next_s || asked == 5) return {};
      next_s = now_s + silence_s;
      ++asked;
      return {ReceivedParameters::request(counter_ = can::next(counter_))};
    };
    const auto see = [&](const can::Frame& frame) {
      if (received_.receive(frame)) {
        next_s = seconds() + silence_s;
        asked = 1;
      }
      if (frame.id != can::CommandAnswer::id || !can::intact(frame, can::CommandAnswer::data_id)) return;
      const auto answer = can::CommandAnswer::of(frame);
      unknown = unknown || (answer.code == can::Command::code_read_parameters &&
                            answer.result == can::CommandAnswer::result_no_such_command);
    };
    if (!talk(limit_s, due, see, [&] { return received_.complete() || unknown; })) return false;
    if (received_.complete()) return true;
    fmt::print(stderr, "{}: {}\n", o_.source,
               unknown ? "this battery has no parameters; its image has the values of its build"
                       : words_for(ServiceClient::State::silent));
    return false;
  }

  int get() const {
    fmt::print("{:<23} {:>10} {:>10} {:>10} {:>10}  {}\n", "parameter", "value", "lowest", "highest", "initial",
               "unit");
    for (const ParameterName& p : parameter_names()) {
      const auto found = received_.values().find(p.number);
      if (found == received_.values().end() || (!o_.name.empty() && o_.name != p.name)) continue;
      const auto& v = found->second;
      fmt::print("{:<23} {:>10} {:>10} {:>10} {:>10}  {}\n", p.name, text_of(p, *v.value), text_of(p, *v.lowest),
                 text_of(p, *v.highest), text_of(p, *v.initial), p.unit);
    }
    if (o_.name.empty()) fmt::print("block: {}, revision {}\n", received_.state(), *received_.values().at(0).lowest);
    return 0;
  }

  int save() const {
    std::string text =
        fmt::format("# Parameters of a battery, written by bms parameters\nformat = {}\n\n[parameters]\n", format);
    for (const ParameterName& p : parameter_names()) {
      const auto found = received_.values().find(p.number);
      if (found == received_.values().end()) continue;
      const auto& v = found->second;
      const std::string assigned = fmt::format("{} = {}", p.name, text_of(p, *v.value));
      text += fmt::format("{:<36} # {}{}{} to {}\n", assigned, p.unit, *p.unit == 0 ? "" : ", ", text_of(p, *v.lowest),
                          text_of(p, *v.highest));
    }
    files::write_file(o_.name, text);
    return 0;
  }

  /// Replaces the values that the file has.
  void load(std::vector<std::int32_t>& wanted) const {
    files::TomlTable top = files::TomlTable::parse(files::read_file(o_.name), o_.name, "a file of parameters");
    if (top.number("format") != format) top.reject("format", fmt::format("{}", format));
    files::TomlTable table = top.table("parameters");
    top.finish();
    for (const ParameterName& p : parameter_names()) {
      if (table.has(p.name))
        place(wanted, p, table.number(p.name), o_.name, table.line(fmt::format("parameters.{}", p.name)));
    }
    table.finish();
  }

  void place(std::vector<std::int32_t>& wanted, const ParameterName& p, double value, const std::string& where,
             std::size_t line) const {
    const auto found = received_.values().find(p.number);
    const std::int32_t raw = raw_of(p, value);
    if (found == received_.values().end())
      throw files::BadInput(where, line, fmt::format("{} is not known to this battery", p.name));
    if (raw < *found->second.lowest || raw > *found->second.highest)
      throw files::BadInput(where, line,
                            fmt::format("{} = {} is out of range, expected {} to {} {}", p.name, text_of(p, raw),
                                        text_of(p, *found->second.lowest), text_of(p, *found->second.highest), p.unit));
    wanted[p.number - 1U] = raw;
  }

  int change(const std::vector<std::int32_t>& wanted) {
    constexpr double limit_s = 240;
    const std::vector<std::int32_t> now = received_.raw();
    if (wanted == now) {
      fmt::print("{}: nothing to change\n", o_.source);
      return 0;
    }
    ServiceClient client(read_key(o_.key), static_cast<std::uint16_t>(o_.operator_number),
                         commands_to_set(now, wanted));
    const auto due = [&](double now_s) { return client.due(now_s); };
    const auto see = [&](const can::Frame& frame) { client.receive(frame, seconds()); };
    if (!talk(limit_s, due, see, [&] { return client.state() != ServiceClient::State::working; })) return 1;
    if (client.state() != ServiceClient::State::done) {
      fmt::print(stderr, "{}: {}; no parameter has changed\n", o_.source, words_for(client.state()));
      return 1;
    }
    if (!read()) return 1;
    if (received_.raw() != wanted) {
      fmt::print(stderr, "{}: the battery has other parameters than those that were sent; read them again\n",
                 o_.source);
      return 1;
    }
    for (const ParameterName& p : parameter_names()) {
      const std::size_t k = p.number - 1U;
      if (k < now.size() && now[k] != wanted[k])
        fmt::print("{}: {} -> {} {}\n", p.name, text_of(p, now[k]), text_of(p, wanted[k]), p.unit);
    }
    fmt::print(
        "bit rate and identifiers are used from the next start on; then the source of all commands is, for example, "
        "can0,base=0x400,stop=0x050\n");
    return 0;
  }

  ParameterOptions o_;
  std::unique_ptr<FrameSource> source_;
  ReceivedParameters received_;
  std::uint8_t counter_ = 0;
};

}  // namespace

std::unique_ptr<Command> parameters_command() { return std::make_unique<ParametersCommand>(); }

}  // namespace bms::tool
