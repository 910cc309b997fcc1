// bms proof: the diagnosis of real recordings, each of its claims compared with a measurement that it did not use.
#include <algorithm>
#include <filesystem>

#include <fmt/format.h>

#include "files/bad_input.hpp"
#include "proof/proof.hpp"
#include "reports/json_study.hpp"
#include "reports/proof_page.hpp"
#include "reports/proof_table.hpp"
#include "tool/commands.hpp"
#include "tool/options.hpp"

namespace bms::tool {

namespace {

struct ProofOptions {
  std::string data;  ///< folder with a123_26650 and a123_esctoolbox
  std::string only;  ///< one experiment; empty: all
  std::string table;
  Output output;
};

std::string proof_progress(double done, double left_s, const std::string& what) {
  const std::string left = done > 0.02 ? fmt::format("about {:.0f} s left", left_s) : "";
  return fmt::format("{:3.0f} %, {:20} {:80.80}", 100 * done, left, what);
}

std::string claim_text(const proof::ProofClaim& c) {
  std::string text = fmt::format("  {:5} {}\n        tool: {}\n        measured: {}\n        holds if {}",
                                 c.holds ? "holds" : "FAILS", c.claim, c.claimed, c.measured, c.tolerance);
  if (c.within_uncertainty)
    text += *c.within_uncertainty ? "; within the stated uncertainty" : "; not within the stated uncertainty";
  return text + "\n";
}

std::string summary(const proof::ProofResult& r) {
  std::string text;
  for (const proof::ProofExperiment& e : r.experiments) {
    text += fmt::format("{} ({} of {} hold)\n", e.title, e.holding(), e.claims.size());
    for (const proof::ProofClaim& c : e.claims) text += claim_text(c);
  }
  return text + fmt::format("{} of {} claims hold, {} diagnoses in {:.0f} s.", r.holding(), r.claims(),
                            r.diagnoses.size(), r.wall_s);
}

std::string experiment_names() {
  std::string text;
  for (const std::string& name : proof::proof_names()) text += (text.empty() ? "" : ", ") + name;
  return text;
}

void check(const ProofOptions& options) {
  const auto names = proof::proof_names();
  if (!options.only.empty() && std::find(names.begin(), names.end(), options.only) == names.end()) {
    throw files::BadInput("--only", 1,
                          "no such experiment '" + options.only + "', expected one of: " + experiment_names());
  }
  std::error_code error;
  for (const char* folder : {".", "a123_26650", "a123_esctoolbox"}) {
    const std::filesystem::path path = (std::filesystem::path(options.data) / folder).lexically_normal();
    if (!std::filesystem::is_directory(path, error)) {
      throw files::BadInput(path.string(), 1,
                            "no folder, expected one with the recordings a123_26650 and a123_esctoolbox "
                            "(evidence/proof/README.md names their source)");
    }
  }
}

std::vector<std::string> files_in(const std::string& folder) {
  std::vector<std::string> files;
  std::error_code error;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder, error)) files.push_back(entry.path());
  return files;
}

class ProofCommand final : public Command {
 public:
  CLI::App* add(CLI::App& app) override {
    CLI::App& c = *app.add_subcommand(
        "proof", "Compare the diagnosis of real recordings with measurements that it did not use; takes minutes");
    c.footer("Experiments: " + experiment_names() + "\nExample: bms proof --data FOLDER --report proof.html");
    c.add_option("--data", o_.data, "folder with the recordings in a123_26650 and a123_esctoolbox")
        ->required()
        ->type_name("DIR");
    c.add_option("--only", o_.only, "run only this experiment")->type_name("NAME");
    c.add_option("--table", o_.table, "write all claims as a table in Markdown")->type_name("FILE.md");
    add_output(c, o_.output);
    return &c;
  }

  int run() override {
    o_.output.set_own(o_.table);
    check(o_);
    o_.output.protect(files_in(o_.data));
    const proof::ProofResult result = proof::prove(o_.data, o_.only, progress_on_stderr(0.2, proof_progress));
    if (!o_.table.empty()) write_output(o_.table, reports::proof_table(result));
    if (!o_.output.json.empty()) write_output(o_.output.json, reports::json_of(result));
    if (!o_.output.report.empty()) write_output(o_.output.report, reports::proof_report(result));
    print_summary(o_.output, summary(result));
    return 0;
  }

 private:
  ProofOptions o_;
};

}  // namespace

std::unique_ptr<Command> proof_command() { return std::make_unique<ProofCommand>(); }

}  // namespace bms::tool
