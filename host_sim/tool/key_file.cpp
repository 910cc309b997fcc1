#include "tool/key_file.hpp"

#include <cctype>
#include <string_view>

#include "files/bad_input.hpp"
#include "files/text_file.hpp"

namespace bms::tool {

authentication::Key read_key(const std::string& path) {
  constexpr std::string_view digits = "0123456789abcdef";
  std::string text = files::read_file(path);
  while (!text.empty() && (text.back() == '\n' || text.back() == '\r')) text.pop_back();
  authentication::Key key{};
  bool good = text.size() == 2 * key.size();
  for (std::size_t k = 0; good && k < text.size(); ++k) {
    const std::size_t digit = digits.find(static_cast<char>(std::tolower(static_cast<unsigned char>(text[k]))));
    good = digit != std::string_view::npos;
    key[k / 2] = static_cast<std::uint8_t>(16 * key[k / 2] + digit);
  }
  if (!good) throw files::BadInput(path, 1, "no key, expected 32 hexadecimal digits in one line");
  return key;
}

}  // namespace bms::tool
