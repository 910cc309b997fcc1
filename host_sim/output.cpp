#include "host_sim/output.hpp"

#include <cstdio>

#include "host_sim/bad_input.hpp"
#include "host_sim/text_file.hpp"

namespace bms {

void put(const std::string& file, const std::string& text) {
  if (file != "-") return write_file(file, text);
  if (std::fwrite(text.data(), 1, text.size(), stdout) != text.size() || std::fflush(stdout) != 0) {
    throw BadInput("-", 1, "standard output cannot be written, expected a place to write to");
  }
}

void tell(const Output& output, const std::string& text) {
  if (!output.quiet && !output.standard_output_is_taken()) std::printf("%s\n", text.c_str());
}

void warn(const std::string& text) { std::fprintf(stderr, "warning: %s\n", text.c_str()); }

}  // namespace bms
