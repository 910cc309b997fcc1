// Slow polarisation: a cell file with one RC pair, confirmed by the shape of long rests.
#include <fmt/format.h>

#include "identification/goodness_of_fit.hpp"
#include "proof/claims.hpp"
#include "proof/direct_measurements.hpp"
#include "proof/procedure.hpp"

namespace bms::proof {

namespace {

class Relaxation : public Procedure {
 public:
  Relaxation(files::TomlTable& file, files::TomlTable& claims)
      : cell_(read_identified_cell(file)),
        diagnosed_(file.text("diagnosed")),
        rests_of_(file.text("rests_of")),
        rest_at_least_s_(file.number("rest_at_least_s")),
        named_(read_named_claim(claims, "named", {"recording"})),
        rest_(read_error_claim(claims, "rest", {"recording", "number", "hours"})) {}

  void run(ProofLab& lab, ProofExperiment& e) const override {
    const workflow::DiagnoseResult& r = lab.diagnosed(lab.identified(cell_), {diagnosed_});
    add_named(e, named_, {{"recording", stem(diagnosed_)}}, r);
    const workflow::RecordingComparison c = lab.scored(r, rests_of_);
    std::size_t number = 0;
    for (const measurement::Rows& rest : rests(c.recording, rest_at_least_s_)) claim_rest(c, rest, ++number, e);
  }

 private:
  /// The voltage relative to the end of the rest, so that the OCV does not matter.
  void claim_rest(const workflow::RecordingComparison& c, const measurement::Rows& rest, std::size_t number,
                  ProofExperiment& e) const {
    const std::size_t last = rest.end - 1;
    identification::ErrorFigure before, after;
    ProofLines lines{
        fmt::format("Rest {} of {}, relative to its end; diagnosed: {}", number, stem(rests_of_), stem(diagnosed_)),
        {"measured, mV", "cell file, mV", "extended, mV"},
        {},
        "min",
        {{}, {}, {}}};
    for (std::size_t k = rest.begin; k < rest.end; ++k) {
      const double measured = c.record.voltage_v[k] - c.record.voltage_v[last], base = c.base_v[k] - c.base_v[last],
                   extended = c.extended_v[k] - c.extended_v[last];
      before.add(measured - base);
      after.add(measured - extended);
      lines.x.push_back((c.record.time_s[k] - c.record.time_s[rest.begin]) / 60);
      lines.columns[0].push_back(1e3 * measured);
      lines.columns[1].push_back(1e3 * base);
      lines.columns[2].push_back(1e3 * extended);
    }
    const double hours = (c.record.time_s[last] - c.record.time_s[rest.begin]) / 3'600;
    add_errors(
        e, rest_,
        {{"recording", stem(diagnosed_)}, {"number", std::to_string(number)}, {"hours", fmt::format("{:.1f}", hours)}},
        before.rms(), after.rms());
    e.lines.push_back(std::move(lines));
  }

  IdentifiedCell cell_;
  std::string diagnosed_, rests_of_;
  double rest_at_least_s_;
  NamedClaim named_;
  ErrorClaim rest_;
};

}  // namespace

std::unique_ptr<Procedure> read_relaxation(files::TomlTable& file, files::TomlTable& claims) {
  return std::make_unique<Relaxation>(file, claims);
}

}  // namespace bms::proof
