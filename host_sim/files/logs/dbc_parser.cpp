// The grammar of DBC files: sections begin with a keyword, most end with a semicolon.
#include <algorithm>
#include <array>
#include <map>
#include <utility>

#include <fmt/format.h>

#include "files/bad_input.hpp"
#include "files/logs/dbc.hpp"
#include "files/logs/dbc_scanner.hpp"
#include "files/logs/table_layout.hpp"
#include "files/logs/text_lines.hpp"
#include "files/logs/units.hpp"

namespace bms::files {

namespace {

constexpr std::uint32_t long_id_bit = 0x8000'0000U, long_id_mask = 0x1FFF'FFFF, short_id_mask = 0x7FF;
constexpr std::uint32_t signals_without_a_message = 0xC000'0000U;  ///< VECTOR__INDEPENDENT_SIG_MSG
constexpr std::size_t most_bytes = std::size_t{64} << 20, longest_name = 1'024;

/// A text of VAL_ that says that there is no value.
bool means_not_available(std::string_view text) {
  constexpr std::array texts = {"sna", "not available", "signal not available", "n/a", "invalid", "error"};
  const std::string name = normalised(text);
  return std::any_of(texts.begin(), texts.end(), [&](const char* t) { return name == t; });
}

class Parser {
 public:
  Parser(std::string_view text, const std::string& path) : in_(text), path_(path) {}

  std::vector<DbcSignal> signals() && {
    while (in_.more()) section();
    finish();
    if (signals_.empty()) throw BadInput(path_, 1, "no signal, expected a DBC file");
    return std::move(signals_);
  }

 private:
  [[noreturn]] void refuse(const std::string& expected) const {
    throw BadInput(path_, line_,
                   in_quotes(trimmed(in_.from(begin_))) + " is not a line of a DBC file, expected " + expected);
  }

  void section() {
    begin_ = in_.place();
    line_ = in_.line();
    const std::string_view keyword = in_.peek();
    if (!in_.first_of_line() || keyword.empty()) {
      in_.skip();
      return;
    }
    in_.word();
    if (keyword == "NS_") return new_symbols();
    if (keyword == "BO_") return message();
    if (keyword == "SG_") return signal();
    if (keyword == "CM_") return comment();
    if (keyword == "SIG_VALTYPE_") return value_type();
    if (keyword == "SG_MUL_VAL_") return multiplexing();
    if (keyword == "BA_DEF_") return attribute_definition();
    if (keyword == "BA_DEF_DEF_") return attribute_default();
    if (keyword == "BA_") return attribute();
    if (keyword == "VAL_") return value_texts();
    skip_section();
  }

  /// To the semicolon, or to the next section.
  void skip_section() {
    while (in_.more() && !(in_.first_of_line() && is_dbc_keyword(in_.peek()))) {
      if (in_.sign(';')) return;
      if (!in_.at('"')) {
        in_.skip();
      } else if (!in_.text()) {
        refuse("a quote that ends the text");
      }
    }
  }

  /// NS_ lists keywords. A line that has more than keywords begins the next section.
  void new_symbols() {
    in_.sign(':');
    while (in_.more()) {
      const DbcScanner before = in_;
      const bool begins = in_.first_of_line() && is_dbc_keyword(in_.peek());
      in_.skip();
      if (!begins || !in_.more() || in_.first_of_line()) continue;
      if (is_dbc_keyword(in_.peek()) && !is_dbc_object(in_.peek())) continue;
      in_ = before;
      return;
    }
  }

  void message() {
    const auto id = in_.whole();
    if (!id || *id > 0xFFFF'FFFFU) refuse("the number of a message");
    message_ = name("a message");
    if (!in_.sign(':')) refuse("':' behind the name of the message");
    if (!in_.whole()) refuse("the number of bytes behind ':'");
    id_ = static_cast<std::uint32_t>(*id);
    in_message_ = true;
    while (in_.more() && !in_.first_of_line()) in_.skip();  // the sender
  }

  std::string name(const char* of) {
    const std::string_view word = in_.word();
    if (word.empty() || word.size() > longest_name) refuse(std::string("the name of ") + of);
    return std::string(word);
  }

  void signal() {
    if (!in_message_) refuse("BO_ with its message above");
    DbcSignal s;
    s.name = name("a signal");
    s.line = line_;
    s.message = message_;
    s.id = id_ & long_id_mask;
    s.long_id = (id_ & long_id_bit) != 0 || s.id > short_id_mask;
    std::optional<std::uint64_t> selected_by;
    if (!in_.at(':')) multiplex(s, selected_by);
    if (!in_.sign(':')) refuse("':' behind the name of the signal");
    layout(s);
    scale(s);
    receivers();
    if (id_ == signals_without_a_message) return;
    if (selected_by) {
      s.selected_by = {{*selected_by, *selected_by}};
      simple_.push_back(signals_.size());
    }
    by_id_[id_].push_back(signals_.size());
    signals_.push_back(std::move(s));
  }

  /// "M" selects other signals, "m3" is sent with the value 3, "m3M" both.
  void multiplex(DbcSignal& s, std::optional<std::uint64_t>& selected_by) {
    std::string_view word = in_.word();
    if (word.ends_with('M')) {
      s.is_multiplexor = true;
      word.remove_suffix(1);
    }
    if (word.empty() && s.is_multiplexor) return;
    std::uint64_t value = 0;
    const auto [end, error] = std::from_chars(word.data() + 1, word.data() + word.size(), value);
    if (!word.starts_with('m') || error != std::errc() || end != word.data() + word.size())
      refuse("':', M, m1 or m1M behind the name of the signal");
    selected_by = value;
  }

  /// "0|16@1-"
  void layout(DbcSignal& s) {
    const auto start = in_.whole();
    if (!start || !in_.sign('|')) refuse("the first bit and '|'");
    const auto length = in_.whole();
    if (!length || !in_.sign('@')) refuse("the number of bits and '@'");
    const std::string_view order = in_.word();
    const bool known = order.size() <= 2 && (order.starts_with('0') || order.starts_with('1'));
    const std::string_view sign = order.size() == 1 ? in_.word() : order.substr(std::min<std::size_t>(1, order.size()));
    if (!known || (sign != "+" && sign != "-")) refuse("0 or 1 and '+' or '-' behind '@'");
    if (*length < 1 || *length > 64 || *start > 511) refuse("1 to 64 bits that begin at bit 0 to 511");
    s.start = static_cast<unsigned>(*start);
    s.length = static_cast<unsigned>(*length);
    s.little_endian = order.front() == '1';
    s.is_signed = sign == "-";
  }

  /// "(0.1,-40) [0|0] "degC""; without a usable range none is stated.
  void scale(DbcSignal& s) {
    const bool open = in_.sign('(');
    const auto factor = open ? in_.decimal() : std::nullopt;
    const auto offset = factor && in_.sign(',') ? in_.decimal() : std::nullopt;
    if (!offset || !in_.sign(')')) refuse("'(factor,offset)', two numbers");
    s.factor = factor->value;
    s.offset = offset->value;
    if (const auto units = common_units(*factor, *offset)) {
      s.digits = units->digits;
      s.factor_units = units->a;
      s.offset_units = units->b;
    }
    if (!in_.sign('[')) refuse("'[lowest|highest]'");
    s.lowest = limit();
    if (in_.sign('|')) s.highest = limit();
    if (!in_.sign(']')) refuse("']' behind the range");
    const auto unit = in_.text();
    if (!unit || unit->size() > longest_name) refuse("the unit in quotes");
    s.unit = *unit;
  }
  double limit() {
    if (const auto number = in_.decimal()) return number->value;
    in_.word();
    return 0;
  }

  void receivers() {
    bool comma = false;
    while (in_.more() && (!in_.first_of_line() || comma)) {
      comma = in_.at(',');
      if (!in_.skip()) return;
    }
  }

  void comment() {
    while (in_.more() && !in_.at('"')) {
      if (in_.sign(';') || (in_.first_of_line() && is_dbc_keyword(in_.peek()) && !is_dbc_object(in_.peek()))) return;
      in_.skip();
    }
    if (in_.more() && !in_.comment()) refuse("'\";' at the end of the comment");
    in_.sign(';');
  }

  template <class Function>
  void each(std::uint64_t id, std::string_view name, Function&& function) {
    const auto at = by_id_.find(static_cast<std::uint32_t>(id));
    if (at == by_id_.end()) return;
    for (const std::size_t k : at->second) {
      if (signals_[k].name == name) function(signals_[k]);
    }
  }

  /// SIG_VALTYPE_ 291 Current : 1;
  void value_type() {
    const auto id = in_.whole();
    const std::string_view name = in_.word();
    in_.sign(':');
    const auto type = in_.whole();
    if (!id || name.empty() || !type) refuse("a message, a signal, ':' and 0, 1 or 2");
    each(*id, name, [&](DbcSignal& s) {
      if (*type == 0) return;
      s.float_bits = *type == 1 ? 32 : 64;
      if (*type <= 2 && s.length == static_cast<unsigned>(s.float_bits)) return;
      refuse(fmt::format("1 for a signal of 32 bits or 2 for one of 64, this has {}", s.length));
    });
    skip_section();
  }

  /// SG_MUL_VAL_ 257 Voltage Page 1-1, 3-5;
  void multiplexing() {
    const auto id = in_.whole();
    const std::string_view name = in_.word(), by = in_.word();
    std::vector<MultiplexRange> ranges;
    do {
      MultiplexRange range;
      if (!in_.range(range.low, range.high)) break;
      ranges.push_back(range);
    } while (in_.sign(','));
    if (!id || name.empty() || by.empty() || ranges.empty())
      refuse("a message, a signal, its multiplexor and ranges as 1-1, 3-5");
    each(*id, name, [&](DbcSignal& s) {
      s.multiplexor = by;
      s.selected_by = ranges;
    });
    skip_section();
  }

  /// BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","ExtendedCAN","reserved","J1939PG";
  void attribute_definition() {
    if (is_dbc_object(in_.peek())) in_.word();
    const auto attribute = in_.text();
    if (attribute && *attribute == "VFrameFormat" && in_.word() == "ENUM") {
      do {
        const auto value = in_.text();
        if (value) frame_formats_.emplace_back(*value);
      } while (in_.sign(','));
    }
    skip_section();
  }

  void attribute_default() {
    const auto attribute = in_.text();
    if (attribute && *attribute == "VFrameFormat") default_format_ = format();
    if (attribute && *attribute == "ProtocolType") all_j1939_ = all_j1939_ || in_.text().value_or("") == "J1939";
    skip_section();
  }
  /// A value of VFrameFormat: its text, or its number in the list.
  std::string format() {
    if (const auto text = in_.text()) return std::string(*text);
    const auto number = in_.whole();
    return number && *number < frame_formats_.size() ? frame_formats_[*number] : std::string();
  }

  void attribute() {
    const auto attribute = in_.text();
    if (!attribute) refuse("the name of an attribute in quotes");
    const std::string_view object = in_.peek();
    if (*attribute == "ProtocolType" && in_.at('"')) {
      all_j1939_ = in_.text().value_or("") == "J1939";
    } else if (object == "BO_") {
      in_.word();
      const auto id = in_.whole();
      if (id && *attribute == "VFrameFormat") message_formats_[static_cast<std::uint32_t>(*id)] = format();
      if (id && *attribute == "SystemMessageLongSymbol")
        long_messages_[static_cast<std::uint32_t>(*id)] = in_.text().value_or("");
    } else if (object == "SG_") {
      in_.word();
      const auto id = in_.whole();
      const std::string_view name = in_.word();
      if (id && !name.empty()) signal_attribute(*attribute, *id, name);
    }
    skip_section();
  }

  void signal_attribute(std::string_view attribute, std::uint64_t id, std::string_view name) {
    if (attribute == "SystemSignalLongSymbol") {
      const std::string text(in_.text().value_or(""));
      if (text.empty()) return;
      each(id, name, [&](const DbcSignal& s) { long_signals_.emplace_back(&s - signals_.data(), text); });
    } else if (attribute == "Invalid") {
      const auto text = in_.text();
      DbcScanner quoted(text.value_or(""));
      const auto value = text ? quoted.integer() : in_.integer();
      if (value) each(id, name, [&](DbcSignal& s) { s.invalid = *value; });
    }
  }

  /// VAL_ 291 Current 65535 "SNA" 65534 "Error";
  void value_texts() {
    const auto id = in_.whole();
    const std::string_view name = id ? in_.word() : std::string_view{};
    while (id) {
      const auto value = in_.integer();
      const auto text = value ? in_.text() : std::nullopt;
      if (!text) break;
      if (means_not_available(*text)) each(*id, name, [&](DbcSignal& s) { s.not_available.push_back(*value); });
    }
    skip_section();
  }

  bool is_j1939(std::uint32_t id) const {
    const auto at = message_formats_.find(id);
    const std::string& format = at == message_formats_.end() ? default_format_ : at->second;
    return format == "J1939PG" || (format.empty() && all_j1939_);
  }

  /// What needs the whole file.
  void finish() {
    for (const std::size_t k : simple_) {
      if (signals_[k].multiplexor.empty()) signals_[k].multiplexor = multiplexor_of(signals_[k]);
    }
    constexpr std::uint32_t no_source = 0xFE, source = 0xFF;
    for (const auto& [id, list] : by_id_) {
      const bool any = (id & source) == no_source && (id & long_id_bit) != 0 && is_j1939(id);
      const auto long_name = long_messages_.find(id);
      for (const std::size_t k : list) {
        signals_[k].any_source = any;
        if (long_name != long_messages_.end()) signals_[k].message = long_name->second;
      }
    }
    for (const auto& [k, text] : long_signals_) {
      DbcSignal& s = signals_[static_cast<std::size_t>(k)];
      s.short_name = std::exchange(s.name, text);
    }
  }
  /// The multiplexor of a message that is always sent; "M" if the message has no such signal.
  std::string multiplexor_of(const DbcSignal& of) const {
    for (const DbcSignal& s : signals_) {
      if (s.id == of.id && s.long_id == of.long_id && s.is_multiplexor && s.selected_by.empty()) return s.name;
    }
    return "M";
  }

  DbcScanner in_;
  const std::string& path_;
  std::size_t begin_ = 0, line_ = 1;  ///< of the section
  bool in_message_ = false;
  std::uint32_t id_ = 0;  ///< of the message, as in the file
  std::string message_;
  std::vector<DbcSignal> signals_;
  std::map<std::uint32_t, std::vector<std::size_t>> by_id_;
  std::vector<std::size_t> simple_;  ///< signals with "m3"
  std::vector<std::string> frame_formats_;
  std::string default_format_;
  std::map<std::uint32_t, std::string> message_formats_, long_messages_;
  std::vector<std::pair<std::ptrdiff_t, std::string>> long_signals_;
  bool all_j1939_ = false;
};

std::vector<DbcSignal> parse(TextLines&& lines, const std::string& path) {
  std::string text;
  std::string_view line;
  while (lines.next(line)) {
    text += line;
    text += '\n';
    if (text.size() > most_bytes) throw BadInput(path, lines.number(), "more than 64 MB, expected a DBC file");
  }
  return Parser(text, path).signals();
}

}  // namespace

std::vector<DbcSignal> read_dbc(const std::string& path) { return parse(TextLines(path), path); }

std::vector<DbcSignal> parse_dbc(std::string_view text, const std::string& path) {
  return parse(TextLines(text, path), path);
}

}  // namespace bms::files
