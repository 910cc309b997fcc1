// Templates that most tests of the tool use, instantiated once (common_instances.cpp) instead of in each source: JSON
// and regular expressions were up to half of what such a source compiled. Never included by name, as
// common_headers.hpp: without it everything compiles as well, in more time.
#pragma once

#include <regex>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

namespace bms::common_instances {
using Json = nlohmann::json;
using Text = std::string::const_iterator;
using JsonText = nlohmann::detail::iterator_input_adapter<Text>;
using Characters = std::regex_traits<char>;
using Parser = nlohmann::detail::parser<Json, JsonText>;
using JsonOfText = nlohmann::detail::json_sax_dom_parser<Json>;
using ChosenJsonOfText = nlohmann::detail::json_sax_dom_callback_parser<Json>;
}  // namespace bms::common_instances

// Some are internal, so they are named for the versions of Debian 12 only; with others each source compiles its own.
#if NLOHMANN_JSON_VERSION_MAJOR == 3 && NLOHMANN_JSON_VERSION_MINOR == 11 && _GLIBCXX_RELEASE == 12
#define BMS_COMMON_INSTANCES(OF)                                                                       \
  OF class nlohmann::basic_json<>;                                                                     \
  OF class std::vector<bms::common_instances::Json>;                                                   \
  OF class nlohmann::detail::serializer<bms::common_instances::Json>;                                  \
  OF class nlohmann::detail::json_sax_dom_parser<bms::common_instances::Json>;                         \
  OF class nlohmann::detail::json_sax_dom_callback_parser<bms::common_instances::Json>;                \
  OF class nlohmann::detail::lexer<bms::common_instances::Json, bms::common_instances::JsonText>;      \
  OF class nlohmann::detail::parser<bms::common_instances::Json, bms::common_instances::JsonText>;     \
  OF bool bms::common_instances::Parser::sax_parse_internal(bms::common_instances::JsonOfText*);       \
  OF bool bms::common_instances::Parser::sax_parse_internal(bms::common_instances::ChosenJsonOfText*); \
  OF class std::basic_regex<char>;                                                                     \
  OF class std::match_results<bms::common_instances::Text>;                                            \
  OF class std::regex_iterator<bms::common_instances::Text>;                                           \
  OF class std::__detail::_Compiler<bms::common_instances::Characters>;                                \
  OF class std::__detail::_Scanner<char>;                                                              \
  OF struct std::__detail::_NFA<bms::common_instances::Characters>;
#else
#define BMS_COMMON_INSTANCES(OF)
#endif

BMS_COMMON_INSTANCES(extern template)
