// A cell file extended by a diagnosis must reproduce recordings without a mismatch.
#include <fmt/format.h>

#include "proof/claims.hpp"
#include "proof/procedure.hpp"

namespace bms::proof {

namespace {

class NoMismatch : public Procedure {
 public:
  NoMismatch(files::TomlTable& file, files::TomlTable& claims)
      : cell_(file.text("cell")),
        no_mismatch_(read_claim_text(claims, "no_mismatch", {"extended_by", "diagnosed", "error", "noise_floor"})) {
    for (files::TomlTable& table : file.tables("pair")) {
      pairs_.push_back({table.text("extended_by"), table.text("diagnosed")});
      table.finish();
    }
  }

  void run(ProofLab& lab, ProofExperiment& e) const override {
    for (const Pair& pair : pairs_) {
      const workflow::DiagnoseResult& first =
          lab.diagnosed(lab.built_in(cell_), std::vector<std::string>{pair.extended_by});
      const workflow::DiagnoseResult& second =
          lab.diagnosed(first.extended_cell, std::vector<std::string>{pair.diagnosed});
      add_outcome(e, no_mismatch_,
                  {{"extended_by", stem(pair.extended_by)},
                   {"diagnosed", stem(pair.diagnosed)},
                   {"error", millivolts(second.baseline ? second.baseline->rmse_v : 0)},
                   {"noise_floor", millivolts(second.diagnosis.noise_floor_v)}},
                  {.diagnosed = summary_of(second),
                   .expected = name_of(diagnosis::Verdict::no_mismatch),
                   .holds = second.diagnosis.verdict == diagnosis::Verdict::no_mismatch});
      ProofLines& lines = e.lines.emplace_back(errors_over_time(
          second.recordings.front(),
          fmt::format("Measured minus simulated, {}: cell file extended by {}, and extended again by the second "
                      "diagnosis",
                      stem(pair.diagnosed), stem(pair.extended_by))));
      lines.labels = {"extended, mV", "extended again, mV"};
    }
  }

 private:
  struct Pair {
    std::string extended_by, diagnosed;
  };
  std::string cell_;
  ClaimText no_mismatch_;
  std::vector<Pair> pairs_;
};

}  // namespace

std::unique_ptr<Procedure> read_no_mismatch(files::TomlTable& file, files::TomlTable& claims) {
  return std::make_unique<NoMismatch>(file, claims);
}

}  // namespace bms::proof
