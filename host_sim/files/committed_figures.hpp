// Measured figures in a README: a Markdown table between two comments.
//
//   <!-- figures: NAME -->
//   | what | figure | ...
//   <!-- end of figures -->
#pragma once

#include <filesystem>
#include <map>
#include <string>

namespace bms::files {

class CommittedFigures {
 public:
  /// Reads the rows whose second column begins with a number. Throws std::runtime_error if the file has no such table.
  CommittedFigures(const std::filesystem::path& readme, const std::string& name);
  bool has(const std::string& what) const { return figures_.contains(what); }
  double at(const std::string& what) const { return figures_.at(what); }

 private:
  std::map<std::string, double> figures_;
};

/// Replaces the text between the comments with `table`. Throws std::runtime_error if the file has no such comments.
void replace_figures(const std::filesystem::path& readme, const std::string& name, const std::string& table);

}  // namespace bms::files
