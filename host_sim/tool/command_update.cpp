// bms update: new firmware or new cell constants for a battery, over its CAN bus (host_sim/update/update_run.hpp), or
// for the trucks of a depot (host_sim/update/depot_update.hpp). Cell constants are sent only with a replay of their
// cell file against the one that acts (bms replay --against).
#include <memory>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "files/bad_input.hpp"
#include "files/text_file.hpp"
#include "monitor/frame_source.hpp"
#include "tool/commands.hpp"
#include "tool/key_file.hpp"
#include "tool/options.hpp"
#include "tool/progress.hpp"
#include "update/depot_update.hpp"
#include "update/update_run.hpp"

namespace bms::tool {

namespace {

using update::UpdateResult;

struct UpdateOptions {
  std::string source, image, key, out, replayed;
  bool other_faults = false;
  unsigned operator_number = 0;
  double wait_s = 90;
  Output output;
};

class UpdateCommand final : public Command {
 public:
  CLI::App* add(CLI::App& app) override {
    CLI::App& c = *app.add_subcommand("update", "Send new firmware to a battery over CAN and start it");
    c.footer("Example: bms update can0 update.bms --key pack17.key --operator 42");
    c.add_option(
         "source", o_.source,
         "can0, vcan0: SocketCAN; slcan:/dev/ttyACM0: a serial adapter; NAME.csv: trucks, buses, keys of a depot")
        ->required();
    c.add_option("image", o_.image, "signed images or cell constants, from bms image")->required()->check(not_empty());
    c.add_option("--key", o_.key, "device key of this battery, 32 hexadecimal digits")
        ->check(not_empty())
        ->type_name("FILE");
    c.add_option("--operator", o_.operator_number, "who answers for it")->check(Within(0, 65'535));
    c.add_option("--wait", o_.wait_s, "seconds for the new image to confirm itself")->check(Within(1, 3'600));
    c.add_option("--replayed", o_.replayed,
                 "of cell constants: what bms replay LOG --cell OLD --against . --against-cell NEW --json FILE wrote")
        ->check(not_empty())
        ->type_name("FILE");
    c.add_flag("--other-faults", o_.other_faults, "the replay may show other faults, or contactors that open");
    c.add_option("--out", o_.out, "table of what runs where, with a table of trucks; a later run continues it")
        ->check(not_empty())
        ->type_name("FILE");
    add_json(c, o_.output);
    return &c;
  }

  int run() override {
    update::UpdateWish wish;
    wish.containers = update::read_containers(o_.image);
    if (!o_.key.empty()) wish.device_key = read_key(o_.key);
    wish.operator_number = static_cast<std::uint16_t>(o_.operator_number);
    wish.start_wait_s = o_.wait_s;
    for (const auto& c : wish.containers) {
      if (c.header.kind != wish.containers.front().header.kind)
        throw files::BadInput(o_.image, 1, "has images and cell constants, expected one kind in a file");
    }
    if (wish.containers.front().header.kind == boot::Kind::cell) ask_for_replay(wish);
    if (o_.source.ends_with(".csv")) return depot(wish);
    if (!o_.out.empty()) throw files::BadInput("--out", 1, "needs a table of trucks, NAME.csv, in place of a bus");
    const auto shown = progress_on_stderr(0.5, [](double done, double left_s, const std::string&) {
      return fmt::format("sending: {:.0f} %, {:.0f} s left", 100 * done, left_s);
    });
    if (shown && !o_.output.quiet)
      wish.progress = [&shown](std::uint32_t done, std::uint32_t of) { shown(static_cast<double>(done) / of, ""); };
    const UpdateResult result = send(o_.source, wish);
    const nlohmann::ordered_json json{{"command", "update"},
                                      {"from", result.from},
                                      {"to", result.to},
                                      {"seconds", result.seconds},
                                      {"bytes_sent", result.sent},
                                      {"resumed_at", result.resumed_at},
                                      {"result", name_of(result.outcome)},
                                      {"reason", result.reason}};
    if (!o_.output.json.empty()) write_output(o_.output.json, json.dump(2) + "\n");
    const bool done = result.outcome == UpdateResult::Outcome::done;
    if (done)
      print_summary(o_.output, fmt::format("{}: {} runs, {} before; {} bytes in {:.1f} s\n", o_.source, result.to,
                                           result.from, result.sent, result.seconds));
    else
      fmt::print(stderr, "{}: {}: {}\n", o_.source, name_of(result.outcome), result.reason);
    return done ? 0 : 1;
  }

 private:
  /// Cell constants change what a battery says of itself, so somebody has to have seen it on a log.
  void ask_for_replay(update::UpdateWish& wish) const {
    const boot::Header& header = wish.containers.front().header;
    const std::string cell = fmt::format("{:08x}", header.cell_hash), board(header.board_name());
    if (o_.replayed.empty())
      throw files::BadInput(
          o_.image, 1,
          fmt::format(
              "has cell constants; expected --replayed FILE, of bms replay LOG --board {} --cell OLD --against . "
              "--against-cell NEW --json FILE",
              board));
    const auto refuse = [&](const std::string& what) { throw files::BadInput(o_.replayed, 1, what); };
    const auto report = nlohmann::json::parse(files::read_file(o_.replayed), nullptr, false);
    const auto text = [&](const char* key) {
      return report.contains(key) && report[key].is_string() ? report[key].get<std::string>() : std::string();
    };
    const auto cut_off = report.is_object() ? report.value("cut_off_at_s", nlohmann::json()) : nlohmann::json();
    if (!report.is_object() || text("command") != "replay" || !report.contains("faults") ||
        !report["faults"].is_array() || !cut_off.is_object() || !cut_off.contains("before") ||
        !cut_off.contains("after") || !report.contains("samples") || !report["samples"].is_number())
      refuse("expected the JSON of bms replay --against");
    if (text("board") != board || text("against_cell_hash") != cell || report["samples"] <= 0)
      refuse(fmt::format("is a replay of the cell file {} on {}, expected {} on {}", text("against_cell_hash"),
                         text("board"), cell, board));
    if (!o_.other_faults && (!report["faults"].empty() || cut_off["before"] != cut_off["after"]))
      refuse(
          "shows other faults with the new cell file, or contactors that open at another time, expected the same, or "
          "--other-faults if that is what the new cell file is for");
    print_summary(o_.output, text("statement"));
    wish.gate = [before = text("cell_hash")](std::uint32_t acting) {
      const std::string acts = fmt::format("{:08x}", acting);
      if (acts == before) return std::string();
      return fmt::format("the replay compares with the cell file {}, but {} acts in this battery", before, acts);
    };
  }

  int depot(const update::UpdateWish& all) const {
    if (o_.out.empty()) throw files::BadInput("--out", 1, "is missing, expected the table of what runs where");
    if (!o_.key.empty()) throw files::BadInput("--key", 1, "is of one battery, expected the column key of the trucks");
    const auto trucks = update::read_trucks(o_.source);
    const auto one = [&](const update::Truck& truck) {
      update::UpdateWish wish = all;
      if (!truck.key.empty()) wish.device_key = read_key(truck.key.string());
      return send(truck.bus, wish);
    };
    const auto shown = [&](const update::TruckRow& row) {
      print_summary(o_.output, fmt::format("{}: {}: {}{}{}\n", row.bus, row.truck, row.state,
                                           row.reason.empty() ? "" : ": ", row.reason));
    };
    const auto rows = update::update_trucks(trucks, files::sha256(files::read_file(o_.image)), o_.out, one, shown);
    nlohmann::ordered_json json{{"command", "update"}, {"trucks", nlohmann::ordered_json::array()}};
    bool all_done = true;
    for (const auto& row : rows) {
      json["trucks"].push_back({{"truck", row.truck},
                                {"bus", row.bus},
                                {"state", row.state},
                                {"runs", row.runs},
                                {"cell", row.cell},
                                {"reason", row.reason}});
      all_done = all_done && row.state == "done";
    }
    if (!o_.output.json.empty()) write_output(o_.output.json, json.dump(2) + "\n");
    return all_done ? 0 : 1;
  }

  static UpdateResult send(const std::string& bus, const update::UpdateWish& wish) {
    try {
      const auto source = monitor::open_source(bus);
      if (!source->live()) throw files::BadInput(bus, 1, "is a recording, expected a bus with the battery");
      return update::run_update(*source, wish);
    } catch (const monitor::SourceError& error) {
      throw files::BadInput(error.source, error.line, error.what());
    }
  }

  UpdateOptions o_;
};

}  // namespace

std::unique_ptr<Command> update_command() { return std::make_unique<UpdateCommand>(); }

}  // namespace bms::tool
