// Healthy synthetic recordings with errors that real instruments make: what the diagnosis says of each form.
//
// Exit code: 0 done; 2 bad usage; 3 internal error
#include <algorithm>
#include <cstdio>
#include <exception>
#include <map>
#include <string>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include "benchmark/cause_ids.hpp"
#include "benchmark/instrument_forms.hpp"
#include "benchmark/run_case.hpp"
#include "files/run_program.hpp"

namespace {

using bms::benchmark::InstrumentForm;
namespace truth = bms::benchmark::truth;

struct Options {
  std::string split, only;
  std::uint64_t seed = 0;
  std::size_t cells = 4;
};

/// Of one form and size.
struct Counts {
  int right = 0, unknown = 0, nothing = 0, wrong = 0, alone = 0;
  std::map<std::string, int> others;  ///< named though they are not there
};

void count(const InstrumentForm& form, const truth::Case& c, double size, Counts& counts) {
  truth::Series s = c.recording;
  form.put(s, size, c.cell.capacity_ah);
  const auto cell = bms::benchmark::cell_of(c.cell);
  const bms::diagnosis::Diagnosis d = bms::diagnosis::diagnose(
      cell, {}, {bms::benchmark::record_of(s, c.given_initial_soc, cell.tolerance.initial_soc)});
  using bms::diagnosis::Verdict;
  if (d.verdict == Verdict::unknown || d.verdict == Verdict::data_fault) ++counts.unknown;
  if (d.verdict == Verdict::no_mismatch || d.verdict == Verdict::not_testable) ++counts.nothing;
  if (!bms::diagnosis::names(d.verdict)) return;
  const auto is_right = [&](const std::string& id) {
    return std::find(form.right.begin(), form.right.end(), id) != form.right.end();
  };
  const auto sets = bms::benchmark::sets_of(d);
  bool first = true, others = false;
  for (const auto& set : sets) {
    const bool right = std::any_of(set.begin(), set.end(), is_right);
    if (first) ++(right ? counts.right : counts.wrong);
    first = false;
    if (right) continue;
    others = true;
    ++counts.others[set.front()];
  }
  if (!others) ++counts.alone;
}

void run(const Options& o) {
  const truth::Split split = o.split == "final" ? truth::Split::final : truth::Split::development;
  std::vector<truth::Case> healthy;
  for (std::size_t k = 0; k < truth::case_count(split) && healthy.size() < o.cells; ++k) {
    truth::Case c = truth::make_case(split, o.seed, k);
    if (c.answer.kind == truth::CaseKind::null) healthy.push_back(std::move(c));
  }
  fmt::print(
      "| form | size | right first | and nothing else | UNKNOWN or data fault | nothing | wrong first | named "
      "wrongly |\n|---|---|---|---|---|---|---|---|\n");
  for (const InstrumentForm& form : bms::benchmark::instrument_forms()) {
    if (form.name.find(o.only) == std::string_view::npos) continue;
    for (const double size : form.sizes) {
      Counts n;
      for (const truth::Case& c : healthy) count(form, c, size, n);
      std::string others;
      for (const auto& [id, times] : n.others) others += fmt::format("{}{} {}", others.empty() ? "" : ", ", id, times);
      fmt::print("| {} | {:g} {} | {} of {} | {} | {} | {} | {} | {} |\n", form.name, size, form.size, n.right,
                 healthy.size(), n.alone, n.unknown, n.nothing, n.wrong, others);
      std::fflush(stdout);
    }
  }
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"Put errors of real instruments into healthy synthetic recordings, and diagnose them"};
  app.name("instrument_forms");
  app.footer("Example: instrument_forms development 1");
  Options o;
  app.add_option("split", o.split, "development or final")->required()->check(CLI::IsMember({"development", "final"}));
  app.add_option("seed", o.seed, "seed of the cases")->required();
  app.add_option("--cells", o.cells, "number of healthy recordings")->capture_default_str();
  app.add_option("--only", o.only, "run only forms whose name contains TEXT")->type_name("TEXT");
  return bms::files::run_program(app, argc, argv, [&] { run(o); });
}
