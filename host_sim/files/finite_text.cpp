#include "files/finite_text.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <stdexcept>
#include <string>

#include "files/bad_input.hpp"

namespace bms::files {

namespace {

constexpr std::array<std::string_view, 3> words = {"infinity", "inf", "nan"};
constexpr std::size_t shown = 40;  ///< characters on either side

bool is_part_of_a_name(char c) {
  constexpr std::string_view others = "._'/\\-$`(";
  return std::isalnum(static_cast<unsigned char>(c)) != 0 || others.find(c) != std::string_view::npos;
}

/// Length of such a word at this place; 0: none.
std::size_t word_at(std::string_view text, std::size_t at) {
  const auto same = [](char a, char b) { return std::tolower(static_cast<unsigned char>(a)) == b; };
  for (const std::string_view word : words) {
    const std::string_view here = text.substr(at, word.size());
    if (here.size() == word.size() && std::equal(here.begin(), here.end(), word.begin(), same)) return word.size();
  }
  return 0;
}

bool is_number(std::string_view text, std::size_t begin, std::size_t length) {
  const std::size_t end = begin + length;
  const bool sign = begin > 0 && (text[begin - 1] == '-' || text[begin - 1] == '+');
  const std::size_t before = begin - (sign ? 1 : 0);
  const bool starts = before == 0 || !is_part_of_a_name(text[before - 1]);
  const bool sentence_ends = end + 1 >= text.size() || std::isspace(static_cast<unsigned char>(text[end + 1])) != 0;
  const bool ends = end == text.size() || !is_part_of_a_name(text[end]) || (text[end] == '.' && sentence_ends);
  return starts && ends;
}

}  // namespace

std::string_view not_finite_in(std::string_view text) {
  for (std::size_t at = 0; at < text.size(); ++at) {
    const char c = text[at];
    if (c == '<' && text.substr(at).starts_with("<script")) {
      at = std::min(text.find("</script>", at), text.size());
      continue;
    }
    if (c != 'n' && c != 'N' && c != 'i' && c != 'I') continue;
    const std::size_t length = word_at(text, at);
    if (length == 0 || !is_number(text, at, length)) continue;
    const std::size_t from = at < shown ? 0 : at - shown;
    return text.substr(from, at + length - from + shown);
  }
  return {};
}

void require_finite(std::string_view text) {
  const std::string_view where = not_finite_in(text);
  if (!where.empty())
    throw std::runtime_error("a result is not a finite number: ..." + printable(std::string(where)) + "...");
}

}  // namespace bms::files
