// bms flash: builds a board's image and writes it onto the chip with OpenOCD.
#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include "files/bad_input.hpp"
#include "files/cell_file.hpp"
#include "files/text_file.hpp"
#include "images/child_process.hpp"
#include "images/firmware_image.hpp"
#include "images/flash_plan.hpp"
#include "tool/commands.hpp"
#include "tool/progress.hpp"

namespace bms::tool {

namespace {

struct FlashOptions {
  std::string board = "stm32f405_forklift", cell;  ///< cell empty: the board's own
  std::size_t cells = 0;                           ///< in series; 0: the board's own number
  std::string probe, serial;                       ///< probe empty: the board's own (BMS_PROBE in board.cmake)
  bool dry_run = false;
};

/// The word with the quotes that a shell needs.
std::string quoted(const std::string& word) {
  if (word.find_first_of(" {}'\"\\$;&|<>*?()") == std::string::npos) return word;
  std::string text = "'";
  for (const char c : word) text += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return text + "'";
}

/// Both become words of OpenOCD's language, where brackets and quotes run commands. A probe is a file of interface/,
/// also in a folder of it.
void check_probe(const images::Probe& probe) {
  constexpr const char* letters = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-.";
  const bool plain = probe.interface.find_first_not_of(std::string(letters) + "/") == std::string::npos;
  if (!plain || probe.interface.starts_with('/') || probe.interface.find("..") != std::string::npos)
    throw files::BadInput("--probe", 1, "'" + probe.interface + "' is not a probe, expected a name as stlink");
  if (probe.serial.find_first_not_of(letters) != std::string::npos)
    throw files::BadInput("--serial", 1, "'" + probe.serial + "' is not a serial number, expected letters and digits");
}

/// Writes each part to a file next to the image.
std::vector<images::PartFile> write_parts(const std::filesystem::path& image,
                                          const std::vector<images::LoadedPart>& parts) {
  std::vector<images::PartFile> files;
  for (const images::LoadedPart& part : parts) {
    files.push_back({part.address, fmt::format("{}.{:08x}.bin", image.string(), part.address)});
    files::write_file(files.back().path, part.bytes);
  }
  return files;
}

/// Returns 0 if the image was written, compared and started, 1 if OpenOCD failed. Throws BadInput if OpenOCD, the probe
/// or the board is missing.
int flash(const FlashOptions& o) {
  images::Probe probe{o.probe, images::board_setting(o.board, "BMS_PROBE_TARGET"), o.serial};
  if (probe.interface.empty()) probe.interface = images::board_setting(o.board, "BMS_PROBE");
  check_probe(probe);
  if (!o.dry_run && !images::in_path("openocd")) {
    throw files::BadInput("openocd", 1,
                          "not installed, expected OpenOCD (Debian: apt-get install openocd; ./bms flash installs it)");
  }
  set_stage("building the firmware");
  const auto image = images::firmware_image(
      o.board, files::read_cell(o.cell.empty() ? images::board_setting(o.board, "BMS_DEFAULT_CELL") : o.cell),
      images::chip_image(o.board), "none", o.cells);
  const images::ImageFile file(image);
  const auto storage = images::storage_of(file);
  const auto parts = write_parts(image, images::parts_to_write(file.parts(), storage));
  const auto log = image.string() + ".openocd.log";
  const auto command = images::openocd_command(probe, parts, storage, image.string() + ".stored_before.bin");
  if (o.dry_run) {
    std::string line;
    for (const std::string& word : command) line += (line.empty() ? "" : " ") + quoted(word);
    fmt::print("{}\n", line);
    return 0;
  }
  set_stage("writing and comparing");
  if (images::ChildProcess(command, log).wait() == 0) {
    fmt::print("{}: written, compared, started{}\n", image.string(),
               storage ? "; the stored records are unchanged" : "");
    return 0;
  }
  const images::FlashFailure failure = images::failure_in(files::read_file(log), probe);
  if (failure.no_probe) throw files::BadInput(o.board, 1, failure.what);
  fmt::print(stderr, "bms: {}: {}; OpenOCD's log is {}\n", o.board, failure.what, log);
  return 1;
}

class FlashCommand final : public Command {
 public:
  CLI::App* add(CLI::App& app) override {
    CLI::App& c = *app.add_subcommand(
        "flash", "Build a board's firmware, write it onto the chip with OpenOCD, compare it and reset the chip");
    c.footer(
        "The stored records in the flash are not erased.\n"
        "Example: bms flash --board stm32f405_forklift --cell my_cell.toml");
    c.add_option("--board", o_.board, "folder in boards/")->capture_default_str();
    c.add_option("--cell", o_.cell, "cell file, or name of a built-in cell; the board's own if not given")
        ->type_name("CELL");
    c.add_option("--cells", o_.cells, "cells in series; the board's own number if not given");
    c.add_option("--probe", o_.probe,
                 "debug probe: stlink, cmsis-dap, jlink, ... (a file of OpenOCD's interface/); the board's own if not "
                 "given");
    c.add_option("--serial", o_.serial, "serial number of the probe, if there are several");
    c.add_flag("--dry-run", o_.dry_run, "build, and print OpenOCD's command instead of running it");
    return &c;
  }

  int run() override { return flash(o_); }

 private:
  FlashOptions o_;
};

}  // namespace

std::unique_ptr<Command> flash_command() { return std::make_unique<FlashCommand>(); }

}  // namespace bms::tool
