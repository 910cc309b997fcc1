// Sources of the firmware: those of the tool, another checkout, or a commit.
#pragma once

#include <filesystem>
#include <string>

namespace bms::images {

struct SourceTree {
  std::filesystem::path folder;  ///< with boards/, firmware/ and the others
  std::filesystem::path builds;  ///< where its images are built
  std::string cell_header_tool;  ///< generator of the cell's constants; empty: the build makes its own
};

/// BMS_ROOT, or what is installed with the tool, or the folder from which the tool was built. Images of an installed
/// tool are built in the user's cache.
SourceTree present_sources();

/// Another checkout. Throws BadInput if the folder has no firmware.
SourceTree sources_in(const std::filesystem::path& folder);

/// A commit of the repository of the present sources, by any name that git knows. It is unpacked once, next to the
/// images of the present sources. Throws BadInput if there is no repository or no such commit.
SourceTree sources_of_commit(const std::string& commit);

}  // namespace bms::images
