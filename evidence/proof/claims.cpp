#include "proof/claims.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "diagnosis/texts.hpp"

namespace bms::proof {

namespace {

/// The placeholders of a sentence, without their braces.
std::vector<std::string> placeholders_of(const std::string& text) {
  std::vector<std::string> names;
  for (std::size_t open = text.find('{'); open != text.npos; open = text.find('{', open + 1)) {
    const std::size_t close = text.find('}', open);
    names.push_back(text.substr(open + 1, close == text.npos ? close : close - open - 1));
  }
  return names;
}

std::string read_sentence(files::TomlTable& table, const std::string& key,
                          std::initializer_list<std::string_view> placeholders) {
  const std::string text = table.text(key);
  for (const std::string& name : placeholders_of(text)) {
    if (std::find(placeholders.begin(), placeholders.end(), name) != placeholders.end()) continue;
    std::string expected;
    for (const std::string_view one : placeholders)
      expected += fmt::format("{}{{{}}}", expected.empty() ? "" : ", ", one);
    table.reject(key, "no placeholders but " + expected);
  }
  return text;
}

ClaimText read_text(files::TomlTable& table, std::initializer_list<std::string_view> placeholders) {
  return {read_sentence(table, "id", placeholders), read_sentence(table, "text", placeholders),
          read_sentence(table, "source", placeholders)};
}

std::string filled(std::string text, const Words& words) {
  for (const auto& [name, value] : words) {
    const std::string placeholder = fmt::format("{{{}}}", name);
    for (std::size_t at = text.find(placeholder); at != text.npos; at = text.find(placeholder, at + value.size()))
      text.replace(at, placeholder.size(), value);
  }
  return text;
}

/// A claim with its sentences; the rest is for the caller.
ProofClaim& add(ProofExperiment& e, const ClaimText& text, const Words& words) {
  ProofClaim& claim = e.claims.emplace_back();
  claim.id = e.id + "." + filled(text.id, words);
  claim.claim = filled(text.text, words);
  claim.measured = filled(text.source, words);
  return claim;
}

}  // namespace

ClaimText read_claim_text(files::TomlTable& claims, const std::string& name,
                          std::initializer_list<std::string_view> placeholders) {
  files::TomlTable table = claims.table(name);
  ClaimText text = read_text(table, placeholders);
  table.finish();
  return text;
}

NamedClaim read_named_claim(files::TomlTable& claims, const std::string& name,
                            std::initializer_list<std::string_view> placeholders) {
  files::TomlTable table = claims.table(name);
  NamedClaim claim{read_text(table, placeholders), table.texts("mechanisms")};
  for (const std::string& id : claim.mechanisms) {
    if (model::mechanism_index(id) == model::mechanism_count) table.reject("mechanisms", "ids of mechanisms");
  }
  table.finish();
  return claim;
}

NumberClaim read_number_claim(files::TomlTable& claims, const std::string& name,
                              std::initializer_list<std::string_view> placeholders) {
  files::TomlTable table = claims.table(name);
  NumberClaim claim;
  claim.text = read_text(table, placeholders);
  if (table.has("mechanism")) claim.parameter = read_parameter_name(table);
  if (table.has("measured")) claim.measured = table.number("measured");
  if (table.has("sigma")) claim.sigma = table.number("sigma");
  claim.tolerance = table.number("tolerance");
  claim.unit = table.text("unit");
  table.finish();
  return claim;
}

ErrorClaim read_error_claim(files::TomlTable& claims, const std::string& name,
                            std::initializer_list<std::string_view> placeholders) {
  files::TomlTable table = claims.table(name);
  ErrorClaim claim{read_text(table, placeholders), table.number("ratio")};
  table.finish();
  return claim;
}

void add_named(ProofExperiment& e, const NamedClaim& named, const Words& words, const workflow::DiagnoseResult& r,
               const Visibility& visibility) {
  std::string expected;
  bool holds = !visibility.visible && r.diagnosis.verdict == diagnosis::Verdict::no_mismatch;
  for (const std::string& id : named.mechanisms) {
    expected += (expected.empty() ? "" : " or ") + id;
    holds = holds || is_named_or_equivalent(r, id);
  }
  expected = "named, alone or among others: " + expected;
  if (!visibility.visible)
    expected += fmt::format("; or NO_MISMATCH, because the stated limit is {}", visibility.limit);
  add_outcome(e, named.text, words, {summary_of(r), expected, holds});
}

void add_number(ProofExperiment& e, const ClaimText& text, const Words& words, const ComparedNumber& n) {
  const auto with_unit = [&](double value, double sigma) { return diagnosis::quantity(value, sigma, n.unit); };
  ProofClaim& claim = add(e, text, words);
  claim.claimed = "no size; " + n.diagnosed;
  claim.measured = with_unit(n.measured.value, n.measured.sigma) + ", " + claim.measured;
  claim.tolerance = "within " + with_unit(n.tolerance, 0) + (n.visible ? "" : ", or no size: below the stated limit");
  claim.number = ProofNumber{.claimed = {},
                             .claimed_sigma = 0,
                             .measured = n.measured.value,
                             .measured_sigma = n.measured.sigma,
                             .allowed = n.tolerance,
                             .unit = n.unit};
  claim.holds = !n.visible;
  if (!n.claimed) return;
  claim.number->claimed = n.claimed->value;
  claim.number->claimed_sigma = n.claimed->sigma;
  claim.claimed = with_unit(n.claimed->value, n.claimed->sigma);
  const double difference = std::abs(n.claimed->value - n.measured.value);
  // a number that is read off the data, as a moment or a limit, has no standard deviation
  if (n.claimed->sigma > 0) claim.within_uncertainty = difference <= 2 * std::hypot(n.claimed->sigma, n.measured.sigma);
  claim.holds = difference <= n.tolerance;
}

void add_errors(ProofExperiment& e, const ErrorClaim& errors, const Words& words, double before_v, double after_v) {
  ProofClaim& claim = add(e, errors.text, words);
  claim.claimed = fmt::format("{} with the extended cell file", millivolts(after_v));
  claim.measured = fmt::format("{} with the cell file; {}", millivolts(before_v), claim.measured);
  claim.tolerance = errors.ratio == 0.5 ? "halved" : fmt::format("at most {:.0f} % of it", 100 * errors.ratio);
  claim.errors = ProofErrors{before_v, after_v, errors.ratio};
  claim.holds = after_v <= errors.ratio * before_v;
}

void add_outcome(ProofExperiment& e, const ClaimText& text, const Words& words, const Outcome& outcome) {
  ProofClaim& claim = add(e, text, words);
  claim.claimed = outcome.diagnosed;
  claim.tolerance = outcome.expected;
  claim.holds = outcome.holds;
}

std::string millivolts(double volts) { return fmt::format("{:.2f} mV", 1e3 * volts); }

std::string stem(const std::string& recording) { return recording.substr(recording.rfind('/') + 1); }

}  // namespace bms::proof
