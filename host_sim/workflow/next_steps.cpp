#include "workflow/next_steps.hpp"

#include <algorithm>
#include <string_view>

#include <fmt/format.h>

namespace bms::workflow {

namespace {

/// A word of a shell's command line; in quotation marks if it needs them.
std::string word(const std::string& text) {
  const bool plain = !text.empty() && std::all_of(text.begin(), text.end(), [](unsigned char c) {
    return (c >= '0' && c <= '9') || (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z') || c >= 0x80 ||
           std::string_view("_-./=,:+@%").find(static_cast<char>(c)) != std::string_view::npos;
  });
  if (plain) return text;
  std::string quoted = "'";
  for (const char c : text) quoted += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return quoted + "'";
}

std::string reading_options(const files::ReadOptions& o) {
  std::string text;
  const auto add = [&](const std::string& option, const std::string& value) {
    if (!value.empty()) text += fmt::format(" {} {}", option, word(value));
  };
  for (const std::string& map : o.map) add("--map", map);
  for (const std::string& unit : o.unit) add("--unit", unit);
  if (o.sign == files::CurrentSign::discharge_positive) text += " --discharge-positive";
  if (o.sign == files::CurrentSign::charge_positive) text += " --charge-positive";
  add("--format", o.format);
  add("--separator", o.separator);
  if (o.decimal_comma) text += " --decimal-comma";
  if (o.day_first) text += " --day-first";
  add("--dbc", o.dbc);
  if (o.cells_in_series > 0) text += fmt::format(" --series {}", o.cells_in_series);
  return text;
}

}  // namespace

std::string joint_command(const DiagnoseOptions& options, const std::vector<RecordingComparison>& recordings,
                          const diagnosis::NextExperiment& next) {
  std::string text = "bms diagnose --cell " + word(options.cell);
  for (const std::string& path : options.recordings) text += " --recording " + word(path);
  text += fmt::format(" --recording {}_measured.csv", next.profile);
  for (const std::string& path : options.holdouts) text += " --holdout " + word(path);
  const bool given = std::all_of(recordings.begin(), recordings.end(),
                                 [](const RecordingComparison& c) { return c.record.initial_soc_given; });
  if (given) {
    text += " --initial-soc";
    for (const RecordingComparison& c : recordings) text += fmt::format(" {:.6g}", c.record.initial_soc);
    text += fmt::format(" {:g}", next.start_soc);
  }
  return text + reading_options(options.reading);
}

std::string together_command(const DiagnoseOptions& options, const std::vector<RecordingComparison>& recordings,
                             const std::vector<RecordingComparison>& holdouts) {
  std::string text = "bms diagnose --cell " + word(options.cell), starts;
  bool given = true;
  for (const auto* list : {&recordings, &holdouts}) {
    for (const RecordingComparison& c : *list) {
      text += " --recording " + word(c.recording.path);
      starts += fmt::format(" {:.6g}", c.record.initial_soc);
      given = given && c.record.initial_soc_given;
    }
  }
  if (given) text += " --initial-soc" + starts;
  return text + reading_options(options.reading);
}

std::vector<std::string> next_steps(const DiagnoseResult& r) {
  std::vector<std::string> steps;
  if (!r.together.empty()) steps = {"Diagnose the recordings and the hold-outs together:", r.together};
  if (!r.next && !r.nothing_more.empty()) steps.push_back(r.nothing_more);
  if (!r.next) return steps;
  for (const std::string& step :
       {diagnosis::why(*r.next), std::string(diagnosis::instruction(*r.next)), diagnosis::command(*r.next),
        std::string("Then diagnose all recordings together:"), r.then})
    steps.push_back(step);
  return steps;
}

}  // namespace bms::workflow
