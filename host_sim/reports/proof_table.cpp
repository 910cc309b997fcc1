#include "reports/proof_table.hpp"

#include <fmt/format.h>

namespace bms::reports {

namespace {

/// As one cell of a table.
std::string cell(std::string text) {
  for (std::size_t at = text.find('|'); at != text.npos; at = text.find('|', at + 2)) text.insert(at, "\\");
  for (char& c : text) c = c == '\n' ? ' ' : c;
  return text;
}

std::string row_of(const proof::ProofClaim& c) {
  return fmt::format("| `{}` | {} | {} | {} | {} | {} |\n", c.id, cell(c.claim), cell(c.tolerance), cell(c.claimed),
                     cell(c.measured), c.holds ? c.verdict() : "**fails**");
}

}  // namespace

std::string proof_table(const proof::ProofResult& r) {
  std::string text = fmt::format(
      "# Claims of the proof\n\nWritten by `./bms proof --table FILE` ([evidence/proof/](../../proof/README.md)). {} "
      "of {} "
      "claims "
      "hold.\n\n| experiment | claims that hold |\n|---|---|\n",
      r.holding(), r.claims());
  for (const proof::ProofExperiment& e : r.experiments)
    text += fmt::format("| {} | {} of {} |\n", cell(e.title), e.holding(), e.claims.size());
  for (const proof::ProofExperiment& e : r.experiments) {
    text += fmt::format(
        "\n## {}\n\n{}\n\n| id | claim | required | diagnosis | measured | result |\n|---|---|---|---|---|---|\n",
        e.title, e.method);
    for (const proof::ProofClaim& c : e.claims) text += row_of(c);
  }
  return text;
}

}  // namespace bms::reports
