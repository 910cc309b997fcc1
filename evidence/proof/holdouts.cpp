// Open loop on recordings that the diagnosis did not use.
#include <fmt/format.h>

#include "proof/claims.hpp"
#include "proof/direct_measurements.hpp"
#include "proof/procedure.hpp"

namespace bms::proof {

namespace {

class Holdouts : public Procedure {
 public:
  Holdouts(files::TomlTable& file, files::TomlTable& claims)
      : cell_(file.text("cell")),
        diagnosed_(file.texts("diagnosed")),
        holdouts_(file.texts("holdouts")),
        plot_(file.text("plot")),
        error_soc_(read_range(file, "error_soc")),
        open_loop_(read_error_claim(claims, "open_loop", {"recording", "before", "after"})) {}

  void run(ProofLab& lab, ProofExperiment& e) const override {
    const workflow::DiagnoseResult& r = lab.diagnosed(lab.built_in(cell_), diagnosed_);
    e.notes.push_back("Diagnosis: " + summary_of(r));
    ProofBars bars{"open loop on recordings that the diagnosis did not use", "mV", {}};
    for (const std::string& recording : holdouts_) {
      const workflow::RecordingComparison c = lab.scored(r, recording);
      const double before_v = rms_error_v(c, c.base_v, error_soc_), after_v = rms_error_v(c, c.extended_v, error_soc_);
      add_errors(e, open_loop_,
                 {{"recording", stem(recording)},
                  {"before", millivolts(rms_error_v(c, c.base_v))},
                  {"after", millivolts(rms_error_v(c, c.extended_v))}},
                 before_v, after_v);
      bars.rows.push_back({stem(recording), 1e3 * before_v, 1e3 * after_v});
      if (recording == plot_)
        e.lines.push_back(errors_over_time(c, "Measured minus simulated, not used: " + stem(recording)));
    }
    e.bars.push_back(std::move(bars));
  }

 private:
  std::string cell_;
  std::vector<std::string> diagnosed_, holdouts_;
  std::string plot_;
  Range error_soc_;
  ErrorClaim open_loop_;
};

}  // namespace

std::unique_ptr<Procedure> read_holdouts(files::TomlTable& file, files::TomlTable& claims) {
  return std::make_unique<Holdouts>(file, claims);
}

}  // namespace bms::proof
