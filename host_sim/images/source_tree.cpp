#include "images/source_tree.hpp"

#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <stdexcept>
#include <system_error>
#include <vector>

#include "files/bad_input.hpp"
#include "files/temporary_folder.hpp"
#include "files/text_file.hpp"
#include "images/child_process.hpp"

namespace bms::images {

namespace {

namespace fs = std::filesystem;

/// Where the tool is installed; empty if it runs from its build folder.
fs::path installed() {
  std::error_code failed;
  const auto prefix = fs::read_symlink("/proc/self/exe", failed).parent_path().parent_path();
  return !failed && fs::exists(prefix / "share/greybox/source/CMakeLists.txt") ? prefix : fs::path();
}

fs::path cache_folder() {
  if (const char* cache = std::getenv("XDG_CACHE_HOME"); cache != nullptr && *cache == '/')
    return fs::path(cache) / "greybox-bms";
  const char* home = std::getenv("HOME");
  if (home == nullptr || *home != '/')
    throw files::BadInput("HOME", 1, "no folder for firmware images, expected HOME or XDG_CACHE_HOME");
  return fs::path(home) / ".cache" / "greybox-bms";
}

/// Returns true if both folders have the same files with the same content.
bool same_files(const fs::path& a, const fs::path& b) {
  const auto files_of = [](const fs::path& folder) {
    std::vector<std::string> names;
    if (!fs::is_directory(folder)) return names;
    for (const auto& entry : fs::recursive_directory_iterator(folder)) {
      if (entry.is_regular_file()) names.push_back(fs::relative(entry.path(), folder).string());
    }
    std::sort(names.begin(), names.end());
    return names;
  };
  const auto names = files_of(a);
  return names == files_of(b) && std::all_of(names.begin(), names.end(), [&](const std::string& name) {
           return files::read_file((a / name).string()) == files::read_file((b / name).string());
         });
}

/// The present generator if it is made of the same sources, which saves the minute that another one takes to build.
std::string generator_for(const fs::path& folder) {
  const SourceTree present = present_sources();
  const bool same =
      std::ranges::all_of(std::vector{"arithmetic", "cmake", "host_sim/files", "measurement", "model"},
                          [&](const char* room) { return same_files(folder / room, present.folder / room); });
  return same ? present.cell_header_tool : "";
}

/// The full name of a commit.
std::string commit_id(const SourceTree& sources, const std::string& commit) {
  if (!in_path("git")) throw files::BadInput("git", 1, "not installed, expected git for the name of a commit");
  try {
    std::string id = output_of({"git", "-C", sources.folder.string(), "rev-parse", "--verify", "--quiet",
                                "--end-of-options", commit + "^{commit}"});
    id.erase(id.find_last_not_of(" \n") + 1);
    return id;
  } catch (const std::runtime_error&) {
    throw files::BadInput(commit, 1,
                          "neither a file, nor a folder, nor a commit of " + sources.folder.string() +
                              ", expected an image for the loop (*_hil.elf), a checkout, or a commit");
  }
}

}  // namespace

SourceTree present_sources() {
  const auto prefix = installed();
  const std::string generator =
      prefix.empty() ? BMS_CELL_HEADER_TOOL : (prefix / "libexec/greybox/cell_header").string();
  if (const char* root = std::getenv("BMS_ROOT"); root != nullptr)
    return {root, fs::path(root) / "build" / "firmware", generator};
  if (prefix.empty()) return {BMS_SOURCE_DIR, fs::path(BMS_SOURCE_DIR) / "build" / "firmware", generator};
  return {prefix / "share/greybox/source", cache_folder(), generator};
}

SourceTree sources_in(const fs::path& folder) {
  if (!fs::is_directory(folder / "boards") || !fs::exists(folder / "cmake" / "firmware.cmake"))
    throw files::BadInput(folder.string(), 1, "a folder without the firmware, expected a checkout of this project");
  const auto whole = fs::canonical(folder);
  return {whole, whole / "build" / "firmware", generator_for(whole)};
}

SourceTree sources_of_commit(const std::string& commit) {
  const SourceTree present = present_sources();
  const std::string id = commit_id(present, commit);
  const auto place = present.builds / "of_commits" / id.substr(0, 12), folder = place / "source";
  if (!fs::exists(folder)) {
    fs::create_directories(place);
    const files::TemporaryFolder temporary;
    const auto archive = temporary.path() / "source.tar", unpacked = place / ("unpacking." + std::to_string(getpid()));
    fs::create_directories(unpacked);
    output_of({"git", "-C", present.folder.string(), "archive", "--format=tar", "-o", archive.string(), id});
    output_of({"tar", "-C", unpacked.string(), "-xf", archive.string()});
    std::error_code other_was_first;
    fs::rename(unpacked, folder, other_was_first);
    if (other_was_first) fs::remove_all(unpacked);
  }
  return {folder, place / "images", generator_for(folder)};
}

}  // namespace bms::images
