#include "tool/output.hpp"

#include <sys/stat.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>

#include "files/bad_input.hpp"
#include "files/finite_text.hpp"
#include "files/text_file.hpp"
#include "tool/progress.hpp"

namespace bms::tool {

namespace {

[[noreturn]] void refuse_standard_output() {
  throw files::BadInput("-", 1, "standard output cannot be written, expected a place to write to");
}

/// Returns true for two names of one regular file, which may not exist yet.
bool same_file(const std::string& a, const std::string& b) {
  if (a.empty() || b.empty() || a == "-" || b == "-") return false;
  struct stat of_a {
  }, of_b{};
  const bool a_exists = stat(a.c_str(), &of_a) == 0, b_exists = stat(b.c_str(), &of_b) == 0;
  if (a_exists && b_exists) return S_ISREG(of_a.st_mode) && of_a.st_dev == of_b.st_dev && of_a.st_ino == of_b.st_ino;
  if (a_exists != b_exists) return false;
  std::error_code error;
  const auto full_a = std::filesystem::weakly_canonical(std::filesystem::absolute(a, error), error);
  const auto full_b = std::filesystem::weakly_canonical(std::filesystem::absolute(b, error), error);
  return !error && full_a == full_b;
}

bool is_file(const std::string& name) {
  std::error_code error;
  return std::filesystem::is_regular_file(name, error);
}

}  // namespace

void Output::protect(const std::vector<std::string>& inputs, const std::vector<std::string>& more) const {
  std::vector<std::string> outputs = {own, json, report};
  outputs.insert(outputs.end(), more.begin(), more.end());
  for (std::size_t k = 0; k < outputs.size(); ++k) {
    for (const std::string& input : inputs) {
      if (is_file(input) && same_file(input, outputs[k]))
        throw files::BadInput(outputs[k], 1, "is an input and would be overwritten, expected another file to write");
    }
    for (std::size_t i = 0; i < k; ++i) {
      if (same_file(outputs[i], outputs[k]))
        throw files::BadInput(outputs[k], 1, "two results for one file, expected a file for each");
    }
  }
}

void Output::set_own(const std::string& file) {
  own = file;
  if ((json == "-") + (report == "-") + (own == "-") > 1)
    throw files::BadInput("-", 1, "more than one result for standard output, expected one");
}

void write_output(const std::string& file, const std::string& text) {
  write_output(file, [&](const files::Sink& sink) { sink(text); });
}

void write_output(const std::string& file, const std::function<void(const files::Sink&)>& produce) {
  if (file != "-") {
    return files::write_file(file, [&](const files::Sink& sink) {
      produce([&](std::string_view piece) {
        files::require_finite(piece);
        sink(piece);
      });
    });
  }
  produce([](std::string_view piece) {
    files::require_finite(piece);
    if (std::fwrite(piece.data(), 1, piece.size(), stdout) != piece.size()) refuse_standard_output();
  });
  if (std::fflush(stdout) != 0) refuse_standard_output();
}

void print_summary(const Output& output, const std::string& text) {
  if (output.quiet || output.uses_standard_output()) return;
  clear_progress();
  files::require_finite(text);
  std::printf("%s\n", files::printable(text, true).c_str());
  check_standard_output();
}

void check_standard_output() {
  if (std::fflush(stdout) != 0 || std::ferror(stdout) != 0) refuse_standard_output();
}

void warn(const std::string& text) {
  clear_progress();
  std::fprintf(stderr, "warning: %s\n", files::printable(text).c_str());
}

}  // namespace bms::tool
