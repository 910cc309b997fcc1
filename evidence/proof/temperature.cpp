// Temperature: a diagnosis at one temperature, confirmed by the resistance at current edges and by the open loop at the
// other temperatures.
#include <algorithm>
#include <cmath>
#include <map>

#include <fmt/format.h>

#include "proof/claims.hpp"
#include "proof/direct_measurements.hpp"
#include "proof/procedure.hpp"

namespace bms::proof {

namespace {

struct TemperatureRecording {
  double temperature_c;
  std::string recording;
};

/// What a cell file that was extended at one temperature predicts at the others.
struct Prediction {
  std::map<double, workflow::RecordingComparison> comparison;  ///< by temperature [degrees C]
  std::map<double, Value> ratio;  ///< resistance over that at the reference; sigma: of the mechanism's parameters
};

class Temperature : public Procedure {
 public:
  Temperature(files::TomlTable& file, files::TomlTable& claims)
      : cell_(read_identified_cell(file)),
        reference_c_(file.number("reference_c")),
        diagnosed_c_(file.numbers("diagnosed_c")),
        error_claims_from_c_(file.number("error_claims_from_c")),
        plot_c_(file.number("plot_c")),
        mechanism_(file.text("mechanism")),
        tolerance_sigmas_(file.number("tolerance_sigmas")),
        tolerance_fraction_(read_range(file, "tolerance_fraction")),
        named_(read_named_claim(claims, "named", {"from", "ratio"})),
        resistance_(read_number_claim(claims, "resistance", {"from", "at"})),
        open_loop_(read_error_claim(claims, "open_loop", {"from", "at", "recording"})) {
    for (files::TomlTable& table : file.tables("temperature")) {
      recordings_.push_back({table.number("temperature_c"), table.text("recording")});
      table.finish();
    }
    for (const double c : diagnosed_c_) {
      if (find(c) == nullptr) file.reject("diagnosed_c", "temperatures of [[temperature]]");
    }
    if (find(reference_c_) == nullptr) file.reject("reference_c", "a temperature of [[temperature]]");
    if (model::mechanism_index(mechanism_) == model::mechanism_count) file.reject("mechanism", "the id of a mechanism");
  }

  void run(ProofLab& lab, ProofExperiment& e) const override {
    // a mechanism that is missing at the reference already would be attributed to the temperature elsewhere
    const workflow::DiagnoseResult& at_reference = lab.diagnosed(lab.identified(cell_), {cell_.drive});
    e.notes.push_back(fmt::format("Diagnosis at {:g} degrees C: {}", reference_c_, summary_of(at_reference)));
    ProofPoints points{
        fmt::format("Resistance at current edges over that at {:g} degrees C: measured, and as predicted by the "
                    "diagnosis at one temperature",
                    reference_c_),
        "degrees C",
        "ratio",
        {},
        {}};
    for (const TemperatureRecording& t : recordings_) {
      const Value ratio = measured_ratio(lab, t);
      points.measured.push_back({t.temperature_c, ratio.value, ratio.sigma});
    }
    for (const double from_c : diagnosed_c_) run_from(lab, at_reference.extended_cell, *find(from_c), points, e);
    e.points.push_back(std::move(points));
  }

 private:
  const TemperatureRecording* find(double temperature_c) const {
    const auto at = std::find_if(recordings_.begin(), recordings_.end(),
                                 [&](const TemperatureRecording& t) { return t.temperature_c == temperature_c; });
    return at == recordings_.end() ? nullptr : &*at;
  }

  Value measured_ratio(ProofLab& lab, const TemperatureRecording& t) const {
    const Value reference = edge_resistance_ohm(lab.recording(find(reference_c_)->recording)),
                r = edge_resistance_ohm(lab.recording(t.recording));
    const double ratio = r.value / reference.value;
    return {ratio, ratio * std::hypot(r.sigma / r.value, reference.sigma / reference.value)};
  }

  /// The diagnosis at one temperature and its claims at all others.
  void run_from(ProofLab& lab, const files::CellFile& cell, const TemperatureRecording& from, ProofPoints& points,
                ProofExperiment& e) const {
    const workflow::DiagnoseResult& r = lab.diagnosed(cell, std::vector<std::string>{from.recording});
    const std::string from_text = fmt::format("{:g}", from.temperature_c);
    const Words words = {{"from", from_text}};
    Words named_words = words;
    named_words.emplace_back("ratio", fmt::format("{:.2f}", measured_ratio(lab, from).value));
    add_named(e, named_, named_words, r);
    const bool named = is_named(r, mechanism_);
    const Prediction prediction = predict(lab, r, named);
    const std::string at = "from " + from_text + " degrees C";
    if (named) {
      ProofPoints::Curve& curve = points.predicted.emplace_back(ProofPoints::Curve{at, {}});
      for (const TemperatureRecording& t : recordings_) {
        const Value& p = prediction.ratio.at(t.temperature_c);
        curve.points.push_back({t.temperature_c, p.value, p.sigma});
      }
    }
    ProofBars bars{"open loop, not used; diagnosed " + at, "mV", {}};
    for (const TemperatureRecording& t : recordings_) {
      if (t.temperature_c == reference_c_ || t.temperature_c == from.temperature_c) continue;
      Words words_here = words;
      words_here.emplace_back("at", fmt::format("{:g}", t.temperature_c));
      words_here.emplace_back("recording", stem(t.recording));
      const auto predicted = named ? std::optional(prediction.ratio.at(t.temperature_c)) : std::nullopt;
      claim_ratio(measured_ratio(lab, t), predicted, summary_of(r), words_here, e);
      claim_open_loop(prediction.comparison.at(t.temperature_c), from, t, words_here, bars, e);
    }
    e.bars.push_back(std::move(bars));
  }

  void claim_ratio(const Value& measured, const std::optional<Value>& predicted, const std::string& diagnosed,
                   const Words& words, ProofExperiment& e) const {
    double tolerance = resistance_.tolerance * measured.value;
    if (predicted) {
      tolerance = std::clamp(tolerance_sigmas_ * predicted->sigma, tolerance_fraction_.from * measured.value,
                             tolerance_fraction_.to * measured.value);
    }
    add_number(e, resistance_.text, words,
               {.claimed = predicted,
                .diagnosed = diagnosed,
                .measured = measured,
                .tolerance = tolerance,
                .unit = resistance_.unit});
  }

  void claim_open_loop(const workflow::RecordingComparison& c, const TemperatureRecording& from,
                       const TemperatureRecording& at, const Words& words, ProofBars& bars, ProofExperiment& e) const {
    const double before_v = rms_error_v(c, c.base_v), after_v = rms_error_v(c, c.extended_v);
    bars.rows.push_back({stem(at.recording), 1e3 * before_v, 1e3 * after_v});
    if (from.temperature_c != error_claims_from_c_) return;
    add_errors(e, open_loop_, words, before_v, after_v);
    if (at.temperature_c == plot_c_) {
      e.lines.push_back(
          errors_over_time(c, fmt::format("Measured minus simulated at {:g} degrees C; diagnosed at {:g}: {}",
                                          at.temperature_c, from.temperature_c, stem(at.recording))));
    }
  }

  /// The ratio of the simulated edges: an edge shows the ohmic resistance and all that is faster than a sample.
  Prediction predict(ProofLab& lab, const workflow::DiagnoseResult& r, bool with_sigma) const {
    Prediction prediction;
    for (const auto& [temperature_c, ratio] : ratios(lab, r, r.diagnosis.extended, &prediction.comparison))
      prediction.ratio[temperature_c] = {ratio, 0};
    if (!with_sigma) return prediction;
    std::map<double, double> squares;
    for (const diagnosis::Hypothesis& other : one_sigma_away(r.diagnosis, mechanism_)) {
      for (const auto& [temperature_c, ratio] : ratios(lab, r, other, nullptr))
        squares[temperature_c] += std::pow(ratio - prediction.ratio.at(temperature_c).value, 2);
    }
    for (auto& [temperature_c, value] : prediction.ratio) value.sigma = std::sqrt(squares[temperature_c]);
    return prediction;
  }

  /// Edge resistance of the simulation over that at the reference, by temperature. comparison: kept if not null.
  std::map<double, double> ratios(ProofLab& lab, const workflow::DiagnoseResult& r,
                                  const diagnosis::Hypothesis& extended,
                                  std::map<double, workflow::RecordingComparison>* comparison) const {
    std::map<double, double> ohm;
    for (const TemperatureRecording& t : recordings_) {
      workflow::RecordingComparison c = lab.scored(r, t.recording, &extended);
      measurement::Recording simulated = c.recording;
      simulated.voltage_v = c.extended_v;
      ohm[t.temperature_c] = edge_resistance_ohm(simulated).value;
      if (comparison != nullptr) (*comparison)[t.temperature_c] = std::move(c);
    }
    const double reference_ohm = ohm.at(reference_c_);
    for (auto& [temperature_c, value] : ohm) value /= reference_ohm;
    return ohm;
  }

  IdentifiedCell cell_;
  double reference_c_;
  std::vector<double> diagnosed_c_;
  double error_claims_from_c_, plot_c_;
  std::string mechanism_;
  double tolerance_sigmas_;
  Range tolerance_fraction_;
  NamedClaim named_;
  NumberClaim resistance_;
  ErrorClaim open_loop_;
  std::vector<TemperatureRecording> recordings_;
};

}  // namespace

std::unique_ptr<Procedure> read_temperature(files::TomlTable& file, files::TomlTable& claims) {
  return std::make_unique<Temperature>(file, claims);
}

}  // namespace bms::proof
