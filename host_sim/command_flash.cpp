#include "host_sim/command_flash.hpp"

#include <fmt/format.h>

#include "host_sim/bad_input.hpp"
#include "host_sim/cell_file.hpp"
#include "host_sim/child_process.hpp"
#include "host_sim/firmware_image.hpp"
#include "host_sim/flash_plan.hpp"
#include "host_sim/text_file.hpp"

namespace bms {

namespace {

/// As a shell takes it.
std::string quoted(const std::string& word) {
  if (word.find_first_of(" {}'\"\\$;&|<>*?()") == std::string::npos) return word;
  std::string text = "'";
  for (const char c : word) text += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return text + "'";
}

std::vector<PartFile> written_beside(const std::filesystem::path& image, const std::vector<LoadedPart>& parts) {
  std::vector<PartFile> files;
  for (const LoadedPart& part : parts) {
    files.push_back({part.address, fmt::format("{}.{:08x}.bin", image.string(), part.address)});
    write_file(files.back().path, part.bytes);
  }
  return files;
}

}  // namespace

int run(const FlashOptions& o) {
  Probe probe{o.probe, board_setting(o.board, "BMS_PROBE_TARGET"), o.serial};
  if (probe.interface.empty()) probe.interface = board_setting(o.board, "BMS_PROBE");
  if (!o.dry_run && !in_path("openocd")) throw BadInput("openocd", 1, "not installed, expected OpenOCD (Debian: apt-get install openocd; ./bms flash does)");

  const auto image = firmware_image(o.board, read_cell(o.cell.empty() ? board_setting(o.board, "BMS_DEFAULT_CELL") : o.cell), chip_image(o.board));
  const ImageFile file(image);
  const auto storage = storage_of(file);
  const auto parts = written_beside(image, parts_to_write(file.parts(), storage));
  const auto log = image.string() + ".openocd.log";
  const auto command = openocd_command(probe, parts, storage, image.string() + ".stored_before.bin");
  if (o.dry_run) {
    std::string line;
    for (const std::string& word : command) line += (line.empty() ? "" : " ") + quoted(word);
    fmt::print("{}\n", line);
    return 0;
  }
  if (ChildProcess(command, log).wait() == 0) {
    fmt::print("{}: written, compared, started{}\n", image.string(), storage ? "; the stored records are as they were" : "");
    return 0;
  }
  const FlashFailure failure = failure_in(read_file(log), probe);
  if (failure.nothing_to_talk_to) throw BadInput(o.board, 1, failure.what);
  fmt::print(stderr, "bms: {}: {}; OpenOCD's log is {}\n", o.board, failure.what, log);
  return 1;
}

}  // namespace bms
