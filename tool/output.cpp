#include "tool/output.hpp"

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <limits>
#include <memory>
#include <utility>

#include "files/bad_input.hpp"
#include "files/text_file.hpp"

namespace bms::tool {

void Output::set_own(const std::string& file) {
  own = file;
  if ((json == "-") + (report == "-") + (own == "-") > 1)
    throw files::BadInput("-", 1, "more than one result for standard output, expected one");
}

void write_output(const std::string& file, const std::string& text) {
  if (file != "-") return files::write_file(file, text);
  if (std::fwrite(text.data(), 1, text.size(), stdout) != text.size() || std::fflush(stdout) != 0) {
    throw files::BadInput("-", 1, "standard output cannot be written, expected a place to write to");
  }
}

void print_summary(const Output& output, const std::string& text) {
  if (!output.quiet && !output.uses_standard_output()) std::printf("%s\n", text.c_str());
}

workflow::Progress progress_on_terminal(
    double every_s, std::function<std::string(double done, double left_s, const std::string& what)> line) {
  if (!isatty(2)) return {};
  struct Shown {
    double at_s = -1;
    std::size_t width = 0;
  };
  const auto begin = std::chrono::steady_clock::now();
  return [begin, every_s, line = std::move(line), shown = std::make_shared<Shown>()](double done,
                                                                                     const std::string& what) {
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    if (done >= 1) {
      std::fprintf(stderr, "\r%*s\r", static_cast<int>(shown->width), "");
    } else if (seconds - shown->at_s > every_s) {
      const std::string text =
          line(done, done > 0 ? seconds / done * (1 - done) : std::numeric_limits<double>::infinity(), what);
      if (text.empty()) return;
      *shown = {seconds, std::max(shown->width, text.size())};
      std::fprintf(stderr, "\r%s", text.c_str());
    }
    std::fflush(stderr);
  };
}

void warn(const std::string& text) { std::fprintf(stderr, "warning: %s\n", text.c_str()); }

}  // namespace bms::tool
