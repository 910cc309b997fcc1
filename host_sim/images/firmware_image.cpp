#include "images/firmware_image.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <regex>
#include <stdexcept>
#include <system_error>

#include <fmt/format.h>

#include "files/bad_input.hpp"
#include "files/text_file.hpp"
#include "images/child_process.hpp"
#include "images/chosen_image.hpp"

namespace bms::images {

namespace {

std::filesystem::path board_file(const std::string& board, const SourceTree& sources) {
  const auto file = sources.folder / "boards" / board / "board.cmake";
  // board.cmake is run, so it must not come from elsewhere: "../DIR"
  const bool plain =
      !board.empty() &&
      board.find_first_not_of("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-") == std::string::npos;
  if (!plain || !std::filesystem::exists(file))
    throw files::BadInput(
        board, 1, "no such board in " + (sources.folder / "boards").string() + ", expected the folder name of a board");
  return file;
}

/// Creates and locks a build folder: two runs at once would overwrite each other's files.
class Lock {
 public:
  explicit Lock(const std::filesystem::path& folder) {
    std::filesystem::create_directories(folder);
    fd_ = open((folder / "lock").c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644);
    if (fd_ < 0 || flock(fd_, LOCK_EX) != 0) throw std::runtime_error("cannot lock " + folder.string());
  }
  ~Lock() { close(fd_); }
  Lock(const Lock&) = delete;
  Lock& operator=(const Lock&) = delete;

 private:
  int fd_ = -1;
};

void run_step(const std::vector<std::string>& argv, const std::filesystem::path& log) {
  if (ChildProcess(argv, log).wait() == 0) return;
  throw std::runtime_error("the build of the firmware failed, see " + log.string());
}

const char* ending(Image image) {
  switch (image) {
    case Image::remote:
      return "_remote";
    case Image::slot_a:
      return "_slot_a";
    case Image::slot_b:
      return "_slot_b";
    case Image::remote_slot_a:
      return "_remote_slot_a";
    case Image::remote_slot_b:
      return "_remote_slot_b";
    case Image::loader:
      return "_loader";
    case Image::remote_product:
      return "_remote_product";
    case Image::replay:
      return "_replay";
    case Image::hil:
      return "_hil";
    case Image::bench:
      return "_bench";
    case Image::fault:
      return "_fault";
    case Image::filter_forms:
      return "_filter_forms";
    case Image::pack:
      return "_pack";
    case Image::protection:
      return "_protection";
    default:
      return "";
  }
}

/// The image that is not linked for a slot.
Image without_slot(Image image) {
  switch (image) {
    case Image::slot_a:
    case Image::slot_b:
      return Image::application;
    case Image::remote_slot_a:
    case Image::remote_slot_b:
      return Image::remote;
    default:
      return image;
  }
}

std::string setting_of(const std::filesystem::path& file, const std::string& name) {
  const std::regex line("(^|\n)set\\(" + name + " ([^ )]*)\\)");
  const std::string text = files::read_file(file);
  std::smatch found;
  if (!std::regex_search(text, found, line)) throw std::runtime_error("no " + name + " in " + file.string());
  return found[2];
}

void check_cells(const std::string& board, std::size_t cells, const std::filesystem::path& file) {
  const std::size_t fewest = std::stoul(setting_of(file, "BMS_FEWEST_CELLS")),
                    most = std::stoul(setting_of(file, "BMS_MOST_CELLS"));
  if (cells < fewest || cells > most)
    throw files::BadInput(board, 1, fmt::format("{} cells, expected {} to {}", cells, fewest, most));
}

/// What decides on an image, apart from the cell.
struct Variant {
  std::string board, vehicle_profile;
  std::size_t cells;  ///< 0: the board's own number
  Choice choice{};

  std::string ending() const {
    return (vehicle_profile == "none" ? "" : "-" + vehicle_profile) +
           (cells == 0 ? "" : fmt::format("-{}cells", cells)) + (choice.name.empty() ? "" : "-" + choice.name);
  }
};

/// A locked build folder of images.
class BuildFolder {
 public:
  BuildFolder(const SourceTree& sources, const std::string& name)
      : sources_(sources), path_(sources.builds / name), lock_(path_) {}

  bool is_new() const { return !std::filesystem::exists(path_ / "build.ninja"); }
  const std::filesystem::path& path() const { return path_; }

  void configure(const Variant& variant, const std::vector<std::string>& options) const {
    std::vector<std::string> configure = {"cmake",
                                          "-S",
                                          sources_.folder.string(),
                                          "-B",
                                          path_.string(),
                                          "-G",
                                          "Ninja",
                                          "-DBMS_BOARD=" + variant.board,
                                          "-DBMS_VEHICLE_PROFILE=" + variant.vehicle_profile,
                                          "--toolchain",
                                          (sources_.folder / "cmake" / "toolchain-arm-none-eabi.cmake").string(),
                                          "-DBMS_CELL_HEADER_TOOL=" + sources_.cell_header_tool};
    if (variant.cells != 0) configure.push_back(fmt::format("-DBMS_CELLS={}", variant.cells));
    for (const auto* more : {&variant.choice.options, &options}) {
      configure.insert(configure.end(), more->begin(), more->end());
    }
    run_step(configure, log());
  }

  void build(const std::vector<std::string>& targets) const {
    std::vector<std::string> command = {"ninja", "-C", path_.string()};
    command.insert(command.end(), targets.begin(), targets.end());
    run_step(command, log());
  }

 private:
  std::filesystem::path log() const { return path_ / "build.log"; }

  const SourceTree& sources_;
  std::filesystem::path path_;
  Lock lock_;
};

/// Compiles what the cell does not decide on in an image. Returns the build folder.
std::filesystem::path shared_objects(const SourceTree& sources, const Variant& variant,
                                     const std::vector<std::string>& targets) {
  const BuildFolder folder(sources, variant.board + variant.ending());
  if (folder.is_new()) folder.configure(variant, {});
  folder.build(targets);
  return folder.path();
}

std::filesystem::path build(const SourceTree& sources, const Variant& variant, const files::CellFile& cell,
                            Image image) {
  for (const char* tool : {"cmake", "ninja", "arm-none-eabi-g++", "qemu-system-arm"}) {
    if (!in_path(tool)) throw files::BadInput(tool, 1, "not installed, expected the tools that ./bms installs");
  }
  const auto name_of = [&](Image of) { return fmt::format("bms_{}{}", variant.board, ending(of)); };
  const std::string image_name = name_of(image);
  const bool in_a_slot = without_slot(image) != image;
  std::vector<std::string> targets = {name_of(without_slot(image)) + "_shared"};
  if (in_a_slot) targets.push_back(fmt::format("bms_{}_update_shared", variant.board));
  const auto shared = shared_objects(sources, variant, targets);
  const BuildFolder folder(sources, fmt::format("{}-{}-{:08x}{}{}", variant.board, cell.name, cell.hash,
                                                variant.ending(), in_a_slot ? "-slots" : ""));
  const auto cell_path = folder.path() / "cell.toml";
  if (!std::filesystem::exists(cell_path) || files::read_file(cell_path) != cell.text)
    files::write_file(cell_path, cell.text);
  if (folder.is_new()) {
    if (isatty(2)) fmt::print(stderr, "building the firmware of {} with cell {} (once)\n", variant.board, cell.name);
    folder.configure(variant, {"-DBMS_CELL=" + cell_path.string(), "-DBMS_SHARED_OBJECTS=" + shared.string(),
                               std::string("-DBMS_SLOT=") + (in_a_slot ? "a;b" : "")});
  }
  folder.build({image_name + ".elf"});
  return folder.path() / (image_name + ".elf");
}

}  // namespace

std::vector<std::string> board_names() {
  std::vector<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(present_sources().folder / "boards")) {
    if (std::filesystem::exists(entry.path() / "board.cmake")) names.push_back(entry.path().filename());
  }
  std::sort(names.begin(), names.end());
  return names;
}

std::string board_setting(const std::string& board, const std::string& name) {
  return setting_of(board_file(board, present_sources()), name);
}

Image chip_image(const std::string& board) {
  return board_setting(board, "BMS_EMULATED") == "ON" ? Image::bench : Image::application;
}

std::size_t board_cells(const std::string& board) { return std::stoul(board_setting(board, "BMS_CELLS")); }

std::filesystem::path firmware_image(const std::string& board, const files::CellFile& cell, Image image,
                                     const std::string& vehicle_profile, std::size_t cells) {
  return firmware_image(present_sources(), board, cell, image, vehicle_profile, cells);
}

std::filesystem::path firmware_image(const SourceTree& sources, const std::string& board, const files::CellFile& cell,
                                     Image image, const std::string& vehicle_profile, std::size_t cells) {
  const auto file = board_file(board, sources);
  const bool other_cells = cells != 0 && cells != std::stoul(setting_of(file, "BMS_CELLS"));
  if (other_cells) check_cells(board, cells, file);
  return build(sources, {board, vehicle_profile, other_cells ? cells : 0}, cell, image);
}

std::filesystem::path chosen_image(const std::string& board, const files::CellFile& cell, const Choice& choice) {
  const SourceTree& sources = present_sources();
  board_file(board, sources);
  return build(sources, {board, "none", 0, choice}, cell, Image::application);
}

}  // namespace bms::images
