#include "tests/firmware/board_budget.hpp"

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <stdexcept>
#include <vector>

#include <fmt/format.h>

#include "can_messages.hpp"  // generated from firmware/can/greybox_bms.dbc
#include "files/cell_file.hpp"
#include "files/recording.hpp"
#include "files/temporary_folder.hpp"
#include "files/text_file.hpp"
#include "hal/sample_frames.hpp"
#include "hal/slcan/codec.hpp"
#include "images/emulator.hpp"
#include "images/firmware_image.hpp"
#include "images/image_file.hpp"
#include "replay/replay.hpp"
#include "tests/firmware/elf_image.hpp"
#include "tests/firmware/slcan_board.hpp"
#include "tests/firmware/stack_depth.hpp"
#include "tests/firmware/unicorn_board.hpp"

namespace bms::firmware {

namespace {

std::vector<measurement::Sample> two_minutes() {
  const auto all =
      measurement::samples(files::read_recording(BMS_SOURCE_DIR "/evidence/recordings/forklift_shift.csv"));
  return {all.begin() + 3000, all.begin() + 3125};
}

template <std::size_t Cells>
std::vector<can::Frame> pack_frames_of(const measurement::Sample& s, std::uint16_t counter) {
  measurement::PackSample<Cells> pack;
  pack.time_us = s.time_us;
  pack.current_ua = s.current_ua;
  pack.cell_uv.fill(s.voltage_uv);
  pack.pack_uv = static_cast<std::int32_t>(Cells) * s.voltage_uv;
  pack.temperature_cdegc.fill(s.temperature_cdegc);
  const auto frames = hal::frames_of(pack, 0, counter);
  return {frames.begin(), frames.end()};
}

BudgetRun run_in_unicorn(const std::string& board_name) {
  UnicornBoard board(images::firmware_image(board_name, files::read_cell("table9"), images::Image::remote));
  board.by_instructions = true;
  if (!board.run_until([&] { return board.can.on_the_bus(); }, 3'000))
    throw std::runtime_error(board_name + " does not start");
  std::uint16_t counter = 0;
  const auto frames_of = images::board_cells(board_name) > 16 ? pack_frames_of<24> : pack_frames_of<16>;
  for (const measurement::Sample& s : two_minutes()) {
    const unsigned fed = board.watchdog_feeds;
    for (const can::Frame& frame : frames_of(s, counter++)) {
      board.can.deliver(frame);
      if (!board.run_until([&] { return !board.can.receive_interrupt(); }, 1))
        throw std::runtime_error(board_name + " receives no frame");
    }
    if (!board.run_until([&] { return board.watchdog_feeds > fed; }, 100))
      throw std::runtime_error(board_name + " does not finish a sample");
    board.run_for_ms(15);
  }
  const auto& seen = board.can.seen;
  const auto report = std::find_if(seen.rbegin(), seen.rend(),
                                   [](const SeenFrame& f) { return f.from_board && f.frame.id == can::Board::id; });
  if (report == seen.rend()) throw std::runtime_error(board_name + " does not report how long a sample takes");
  return {board.stack_used(), can::Board::of(report->frame).longest_sample};
}

/// Memory of the emulator from `begin` on, read through its monitor at a socket.
std::string memory_of(const std::filesystem::path& monitor, std::uint32_t begin, std::uint32_t size,
                      const std::filesystem::path& file) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  std::strncpy(address.sun_path, monitor.c_str(), sizeof address.sun_path - 1);
  const int line = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
  const std::string command = fmt::format("memsave {:#x} {:#x} \"{}\"\nquit\n", begin, size, file.string());
  const bool sent = connect(line, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0 &&
                    send(line, command.data(), command.size(), MSG_NOSIGNAL) == static_cast<ssize_t>(command.size());
  for (char c = 0; sent && recv(line, &c, 1, 0) > 0;) continue;  // until it has ended
  close(line);
  const std::string memory = sent ? files::read_file(file) : "";
  if (memory.size() != size) throw std::runtime_error("no memory from the emulator's monitor");
  return memory;
}

/// An instruction takes 8 ns (1.3 cycles at 168 MHz) or 64 ns (one cycle at 16 MHz). The stack is measured down to the
/// pattern that the firmware wrote.
BudgetRun run_in_qemu(const images::EmulatedBoard& emulated) {
  const std::string& board_name = emulated.name;
  const auto image = images::firmware_image(board_name, files::read_cell("table9"), images::Image::application);
  const files::TemporaryFolder folder;
  const auto monitor = folder.path() / "monitor";
  SlcanBoard board(image, {},
                   {"-chardev", "socket,id=monitor,server=on,wait=off,path=" + monitor.string(), "-mon", "monitor",
                    "-icount", "shift=" + std::string(emulated.scalar == replay::ScalarKind::fixed ? "6" : "3")},
                   emulated);
  board.read();
  board.write("S6\rO\r");
  for (const measurement::Sample& s : two_minutes()) {
    board.send_sample(s.time_us, s.current_ua, s.voltage_uv, s.temperature_cdegc);
    board.telemetry();
  }
  board.send_sample(two_minutes().back().time_us + 1'000'000, 0, 3'300'000,
                    2500);  // when it answers, the record is written
  can::Frame report;
  if (!hal::slcan::decode(board.read_until("t1B98"), report))
    throw std::runtime_error(board_name + " does not report how long a sample takes");
  board.telemetry();
  const images::ImageFile file(image);
  const std::uint32_t top = file.symbol("image_stack_top"),
                      bottom = file.symbol("image_stack_limit") + 1'024;  // above the guard
  const std::string memory = memory_of(monitor, bottom, top - bottom, folder.path() / "ram");
  std::size_t free = 0;
  while (free + 4 <= memory.size() && memory.compare(free, 4, "\xA5\xA5\xA5\xA5") == 0) free += 4;
  return {memory.size() - free, can::Board::of(report).longest_sample};
}

}  // namespace

BoardBudget budget_of(const std::string& board) {
  const auto bytes = [&](const char* name) { return std::stoull(images::board_setting(board, name)); };
  return {bytes("BMS_BUDGET_FLASH"), bytes("BMS_BUDGET_RAM"), bytes("BMS_BUDGET_STACK"),
          std::stod(images::board_setting(board, "BMS_BUDGET_SAMPLE_MS"))};
}

BoardFigures figures_of(const std::string& board) {
  const auto image = images::firmware_image(board, files::read_cell("table9"), images::chip_image(board));
  const ImageSize size = size_of(image);
  return {size.text + size.data, size.data + size.bss, stack_depth(image).worst()};
}

std::optional<BudgetRun> run_of(const std::string& board) {
  if (images::board_setting(board, "BMS_EMULATED") == "OFF")
    return images::board_setting(board, "BMS_CAN") == "bxcan" ? std::optional(run_in_unicorn(board)) : std::nullopt;
  for (const images::EmulatedBoard& emulated : images::emulated_boards()) {
    if (emulated.name == board) return run_in_qemu(emulated);
  }
  return std::nullopt;
}

std::string board_table() {
  std::string table =
      "| board | flash [bytes] | of | static RAM [bytes] | of | stack, worst [bytes] | of | stack, measured [bytes] | "
      "a sample, longest [ms] | of |\n|---|---|---|---|---|---|---|---|---|---|\n";
  for (const std::string& board : images::board_names()) {
    const BoardFigures f = figures_of(board);
    const BoardBudget b = budget_of(board);
    const auto run = run_of(board);
    table += fmt::format("| {} | {} | {} | {} | {} | {} | {} | {} | {} | {} |\n", board, f.flash, b.flash, f.ram, b.ram,
                         f.stack_worst, b.stack, run ? std::to_string(run->stack) : "-",
                         run ? fmt::format("{:.2f}", run->sample_ms) : "-", b.sample_ms);
  }
  return table;
}

}  // namespace bms::firmware
