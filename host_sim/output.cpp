#include "host_sim/output.hpp"

#include <cstdio>

#include "host_sim/text_file.hpp"

namespace bms {

void put(const std::string& file, const std::string& text) {
  if (file == "-") std::fwrite(text.data(), 1, text.size(), stdout);
  else write_file(file, text);
}

void tell(const Output& output, const std::string& text) {
  if (!output.quiet && output.json != "-") std::printf("%s\n", text.c_str());
}

void warn(const std::string& text) { std::fprintf(stderr, "warning: %s\n", text.c_str()); }

}  // namespace bms
