// Hysteresis: a cell file from a slow discharge alone, confirmed by the slow charge.
#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "model/cell.hpp"
#include "proof/claims.hpp"
#include "proof/direct_measurements.hpp"
#include "proof/procedure.hpp"

namespace bms::proof {

namespace {

class Hysteresis : public Procedure {
 public:
  Hysteresis(files::TomlTable& file, files::TomlTable& claims)
      : cell_(read_identified_cell(file)),
        slow_charge_(file.text("slow_charge")),
        slow_discharge_(file.text("slow_discharge")),
        diagnosed_(file.text("diagnosed")),
        gap_soc_(file.number("gap_soc")),
        error_soc_(read_range(file, "error_soc")),
        plot_soc_(read_range(file, "plot_soc")),
        named_(read_named_claim(claims, "named", {"folder", "recording"})),
        half_gap_(read_number_claim(claims, "half_gap", {"folder", "recording", "gap", "overvoltage"})),
        ocv_at_(read_number_claim(claims, "ocv_at", {"folder", "recording"})),
        slow_charge_claim_(read_error_claim(claims, "slow_charge", {"folder", "recording"})) {
    files::TomlTable slow_resistance = file.table("slow_resistance");
    slow_resistance_ = read_parameter_name(slow_resistance);
    slow_resistance.finish();
    if (!ocv_at_.measured) claims.reject("ocv_at", "a key 'measured'");
  }

  void run(ProofLab& lab, ProofExperiment& e) const override {
    const files::CellFile& cell = lab.identified(cell_);
    const workflow::DiagnoseResult& r = lab.diagnosed(cell, {diagnosed_});
    const std::string folder = diagnosed_.substr(0, diagnosed_.find('/'));
    const Words words = {{"folder", folder}, {"recording", stem(diagnosed_)}};
    add_named(e, named_, words, r);
    claim_half_gap(lab, cell, r, words, e);
    add_number(e, ocv_at_.text, words,
               {.claimed = value_of(r, ocv_at_.parameter),
                .diagnosed = summary_of(r),
                .measured = {*ocv_at_.measured, ocv_at_.sigma},
                .tolerance = ocv_at_.tolerance,
                .unit = ocv_at_.unit});
    const workflow::RecordingComparison slow = lab.scored(r, slow_charge_);
    const double before_v = rms_error_v(slow, slow.base_v, error_soc_),
                 after_v = rms_error_v(slow, slow.extended_v, error_soc_);
    add_errors(e, slow_charge_claim_, words, before_v, after_v);
    e.bars.push_back(
        {fmt::format("slow charge of {}, {:g} to {:g} % of charge", folder, 100 * error_soc_.from, 100 * error_soc_.to),
         "mV",
         {{stem(diagnosed_), 1e3 * before_v, 1e3 * after_v}}});
    e.lines.push_back(plot(slow, folder));
  }

 private:
  /// The gap at rest: the gap of the slow runs less the voltage drop of their current.
  void claim_half_gap(ProofLab& lab, const files::CellFile& cell, const workflow::DiagnoseResult& r, Words words,
                      ProofExperiment& e) const {
    const measurement::Recording &charge = lab.recording(slow_charge_), &discharge = lab.recording(slow_discharge_);
    const double gap_v = slow_voltage_v(charge, gap_soc_) - slow_voltage_v(discharge, gap_soc_),
                 slow_a = (slow_current_a(charge) + slow_current_a(discharge)) / 2;
    const auto& rc = cell.parameters.rc;
    double ohm =
        model::cell_detail::rc_value(rc, rc.r0_ohm, gap_soc_) + model::cell_detail::rc_value(rc, rc.r1_ohm, gap_soc_);
    if (const auto slow = value_of(r, slow_resistance_)) ohm += slow->value;
    words.emplace_back("gap", fmt::format("{:.1f} mV", 1e3 * gap_v));
    words.emplace_back("overvoltage", fmt::format("{:.1f} mV", 1e3 * slow_a * ohm));
    add_number(e, half_gap_.text, words,
               {.claimed = value_of(r, half_gap_.parameter),
                .diagnosed = summary_of(r),
                .measured = {gap_v / 2 - slow_a * ohm, half_gap_.sigma},
                .tolerance = half_gap_.tolerance,
                .unit = half_gap_.unit});
  }

  ProofLines plot(const workflow::RecordingComparison& slow, const std::string& folder) const {
    constexpr std::size_t points = 2'000;
    ProofLines lines{fmt::format("Slow charge, {}: not used; cell file extended by {}", folder, stem(diagnosed_)),
                     {"measured, V", "cell file, V", "extended, V"},
                     {},
                     "h",
                     {{}, {}, {}}};
    for (std::size_t k = 0; k < slow.record.size(); k += std::max<std::size_t>(1, slow.record.size() / points)) {
      if (slow.recording.soc_ref[k] < plot_soc_.from || slow.recording.soc_ref[k] > plot_soc_.to) continue;
      lines.x.push_back((slow.record.time_s[k] - slow.record.time_s.front()) / 3'600);
      lines.columns[0].push_back(slow.record.voltage_v[k]);
      lines.columns[1].push_back(slow.base_v[k]);
      lines.columns[2].push_back(slow.extended_v[k]);
    }
    return lines;
  }

  IdentifiedCell cell_;
  std::string slow_charge_, slow_discharge_, diagnosed_;
  double gap_soc_;
  Range error_soc_, plot_soc_;
  ParameterName slow_resistance_;  ///< adds to the voltage drop of the slow runs
  NamedClaim named_;
  NumberClaim half_gap_, ocv_at_;
  ErrorClaim slow_charge_claim_;
};

}  // namespace

std::unique_ptr<Procedure> read_hysteresis(files::TomlTable& file, files::TomlTable& claims) {
  return std::make_unique<Hysteresis>(file, claims);
}

}  // namespace bms::proof
