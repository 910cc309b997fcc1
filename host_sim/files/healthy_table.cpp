#include "files/healthy_table.hpp"

#include <fmt/format.h>

#include "files/toml_text.hpp"

namespace bms::files {

namespace {

using healthy_data::HealthyBlock;
using healthy_data::HealthyRange;
using healthy_data::HealthyRegime;

double not_negative(TomlTable& table, const std::string& key) {
  const double value = table.number(key);
  if (!(value >= 0)) table.reject(key, "0 or more");
  return value;
}

HealthyRange read_range(TomlTable& table, const std::string& key) {
  if (!table.has(key)) return {};
  const std::vector<double> ends = table.numbers(key);
  if (ends.size() != 2 || !(ends[0] <= ends[1])) table.reject(key, "the smallest and the largest value");
  return {ends[0], ends[1]};
}

HealthyBlock read_block(TomlTable& table) {
  HealthyBlock b;
  b.recording = table.text("recording");
  b.start_s = table.number("start_s");
  b.duration_s = table.number("duration_s");
  if (!(b.duration_s > 0)) table.reject("duration_s", "more than 0 s");
  b.error_v = not_negative(table, "error_v");
  b.soc = read_range(table, "soc");
  b.current_a = read_range(table, "current_a");
  b.temperature_c = read_range(table, "temperature_c");
  const std::vector<std::string> causes = table.texts("causes");
  const std::vector<double> gains = table.numbers("gains");
  if (gains.size() != causes.size()) table.reject("gains", fmt::format("{} numbers, as 'causes' has", causes.size()));
  for (std::size_t k = 0; k < causes.size(); ++k) {
    if (!(gains[k] >= 0)) table.reject("gains", "numbers of 0 or more");
    b.gains.push_back({causes[k], gains[k]});
  }
  table.finish();
  return b;
}

HealthyRegime read_regime(TomlTable& table) {
  HealthyRegime r;
  r.axis = table.text("axis");
  r.from = table.number("from");
  r.to = table.number("to");
  if (!(r.to > r.from)) table.reject("to", "more than 'from'");
  r.hours = not_negative(table, "hours");
  r.bias_v = table.number("bias_v");
  r.rms_v = not_negative(table, "rms_v");
  r.spread_v = not_negative(table, "spread_v");
  if (table.has("parts")) r.parts = not_negative(table, "parts");
  if (table.has("high_v")) not_negative(table, "high_v");  // of older files
  table.finish();
  return r;
}

std::string line(const std::string& key, double value) { return key + " = " + literal(value) + "\n"; }

std::string range_line(const std::string& key, const HealthyRange& range) {
  return range.known() ? fmt::format("{} = [{}, {}]\n", key, literal(range.low), literal(range.high)) : "";
}

std::string block_text(const HealthyBlock& b) {
  std::string causes, gains;
  for (const healthy_data::HealthyGain& e : b.gains) {
    const char* separator = causes.empty() ? "" : ", ";
    causes += separator + quoted(e.cause);
    gains += separator + literal(e.gain);
  }
  return "\n[[healthy.block]]\nrecording = " + quoted(b.recording) + "\n" + line("start_s", b.start_s) +
         line("duration_s", b.duration_s) + line("error_v", b.error_v) + range_line("soc", b.soc) +
         range_line("current_a", b.current_a) + range_line("temperature_c", b.temperature_c) +
         fmt::format("causes = [{}]\ngains = [{}]\n", causes, gains);
}

std::string regime_text(const HealthyRegime& r) {
  return "\n[[healthy.regime]]\naxis = " + quoted(r.axis) + "\n" + line("from", r.from) + line("to", r.to) +
         line("hours", r.hours) + line("bias_v", r.bias_v) + line("rms_v", r.rms_v) + line("spread_v", r.spread_v) +
         line("parts", r.parts);
}

}  // namespace

healthy_data::HealthyData read_healthy(TomlTable& healthy) {
  healthy_data::HealthyData data;
  data.known = true;
  for (TomlTable& block : healthy.tables("block")) data.blocks.push_back(read_block(block));
  for (TomlTable& regime : healthy.tables("regime")) data.regimes.push_back(read_regime(regime));
  if (healthy.has("beyond_tolerance_v")) data.beyond_tolerance_v = not_negative(healthy, "beyond_tolerance_v");
  healthy.finish();
  return data;
}

std::string healthy_text(const healthy_data::HealthyData& healthy, const std::string& source) {
  if (!healthy.known) return "";
  std::string text =
      "\n[healthy]\nsource = " + quoted(source) + "\n" + line("beyond_tolerance_v", healthy.beyond_tolerance_v);
  for (const HealthyBlock& b : healthy.blocks) text += block_text(b);
  for (const HealthyRegime& r : healthy.regimes) text += regime_text(r);
  return text;
}

}  // namespace bms::files
