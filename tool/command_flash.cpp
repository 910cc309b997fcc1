#include "tool/command_flash.hpp"

#include <fmt/format.h>

#include "files/bad_input.hpp"
#include "files/cell_file.hpp"
#include "files/text_file.hpp"
#include "images/child_process.hpp"
#include "images/firmware_image.hpp"
#include "images/flash_plan.hpp"

namespace bms::tool {

namespace {

/// As a shell takes it.
std::string quoted(const std::string& word) {
  if (word.find_first_of(" {}'\"\\$;&|<>*?()") == std::string::npos) return word;
  std::string text = "'";
  for (const char c : word) text += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return text + "'";
}

std::vector<images::PartFile> written_beside(const std::filesystem::path& image,
                                             const std::vector<images::LoadedPart>& parts) {
  std::vector<images::PartFile> files;
  for (const images::LoadedPart& part : parts) {
    files.push_back({part.address, fmt::format("{}.{:08x}.bin", image.string(), part.address)});
    files::write_file(files.back().path, part.bytes);
  }
  return files;
}

}  // namespace

int run(const FlashOptions& o) {
  images::Probe probe{o.probe, images::board_setting(o.board, "BMS_PROBE_TARGET"), o.serial};
  if (probe.interface.empty()) probe.interface = images::board_setting(o.board, "BMS_PROBE");
  if (!o.dry_run && !images::in_path("openocd"))
    throw files::BadInput("openocd", 1,
                          "not installed, expected OpenOCD (Debian: apt-get install openocd; ./bms flash does)");

  const auto image = images::firmware_image(
      o.board, files::read_cell(o.cell.empty() ? images::board_setting(o.board, "BMS_DEFAULT_CELL") : o.cell),
      images::chip_image(o.board));
  const images::ImageFile file(image);
  const auto storage = images::storage_of(file);
  const auto parts = written_beside(image, images::parts_to_write(file.parts(), storage));
  const auto log = image.string() + ".openocd.log";
  const auto command = images::openocd_command(probe, parts, storage, image.string() + ".stored_before.bin");
  if (o.dry_run) {
    std::string line;
    for (const std::string& word : command) line += (line.empty() ? "" : " ") + quoted(word);
    fmt::print("{}\n", line);
    return 0;
  }
  if (images::ChildProcess(command, log).wait() == 0) {
    fmt::print("{}: written, compared, started{}\n", image.string(),
               storage ? "; the stored records are as they were" : "");
    return 0;
  }
  const images::FlashFailure failure = images::failure_in(files::read_file(log), probe);
  if (failure.no_probe) throw files::BadInput(o.board, 1, failure.what);
  fmt::print(stderr, "bms: {}: {}; OpenOCD's log is {}\n", o.board, failure.what, log);
  return 1;
}

}  // namespace bms::tool
