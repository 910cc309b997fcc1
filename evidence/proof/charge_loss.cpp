// Charge balance: what the cycler counts and the cell does not store, confirmed by the counters of the cycler from full
// to full. The current that is read while the cell is idle is an input of the diagnosis.
#include "proof/charge_loss.hpp"

#include <algorithm>
#include <cmath>
#include <map>

#include <fmt/format.h>

#include "proof/claims.hpp"
#include "proof/direct_measurements.hpp"
#include "proof/procedure.hpp"

namespace bms::proof {

namespace {

std::string milliampere_hours(double ah) { return fmt::format("{:.0f} mAh", 1e3 * ah); }
std::string milliamperes(double a) { return fmt::format("{:+.1f} mA", 1e3 * a); }

class ReportedLoss : public Procedure {
 public:
  ReportedLoss(files::TomlTable& file, files::TomlTable& claims)
      : cell_(file.text("cell")),
        losses_(read_charge_losses(file)),
        named_(read_named_claim(claims, "named", {"recording", "missing"})),
        size_(read_number_claim(claims, "size", {"recording", "missing", "idle"})) {
    for (files::TomlTable& table : file.tables("recording")) {
      recordings_.push_back({table.text("name"), table.number("missing_ah")});
      table.finish();
    }
  }

  void run(ProofLab& lab, ProofExperiment& e) const override {
    ProofPoints points{
        "Charge counted but not stored: by the counters of the cycler, and as diagnosed", "", "mAh", {}, {}};
    points.predicted.push_back({"diagnosed", {}});
    for (const CounterReading& counters : recordings_) {
      const workflow::DiagnoseResult& r =
          lab.diagnosed(lab.built_in(cell_), std::vector<std::string>{counters.recording});
      const std::string name = stem(counters.recording);
      const Value idle_a = idle_current_a(lab.recording(counters.recording));
      const Words words = {{"recording", name},
                           {"missing", milliampere_hours(counters.missing_ah)},
                           {"idle", milliamperes(idle_a.value)}};
      add_named(e, named_, words, r);
      const Value measured{counters.missing_ah, 0};
      const auto claimed = lost_charge_ah(r, losses_);
      add_number(e, size_.text, words,
                 {.claimed = claimed,
                  .diagnosed = summary_of(r),
                  .measured = measured,
                  .tolerance = size_.tolerance,
                  .unit = size_.unit});
      const double x = static_cast<double>(points.measured.size() + 1);
      points.measured.push_back({x, 1e3 * measured.value, 1e3 * measured.sigma});
      if (claimed) points.predicted[0].points.push_back({x, 1e3 * claimed->value, 1e3 * claimed->sigma});
      points.names.push_back(name);
    }
    e.points.push_back(std::move(points));
  }

 private:
  struct CounterReading {
    std::string recording;
    double missing_ah;  ///< charge less discharge from full to full, by the counters of the cycler
  };
  std::string cell_;
  std::vector<ChargeLoss> losses_;
  NamedClaim named_;
  NumberClaim size_;
  std::vector<CounterReading> recordings_;
};

class NoLoss : public Procedure {
 public:
  NoLoss(files::TomlTable& file, files::TomlTable& claims)
      : cell_(read_identified_cell(file)),
        diagnosed_(file.texts("diagnosed")),
        losses_(read_charge_losses(file)),
        no_loss_(read_claim_text(claims, "no_loss", {"recording", "idle"})) {}

  void run(ProofLab& lab, ProofExperiment& e) const override {
    for (const std::string& recording : diagnosed_) {
      const workflow::DiagnoseResult& r = lab.diagnosed(lab.identified(cell_), std::vector<std::string>{recording});
      // a diagnosis that was refused does not show that there is no loss
      const bool diagnosed = r.diagnosis.verdict != diagnosis::Verdict::data_fault &&
                             r.diagnosis.verdict != diagnosis::Verdict::not_testable;
      const auto claimed = lost_charge_ah(r, losses_);
      const Value idle_a = idle_current_a(lab.recording(recording));
      add_outcome(e, no_loss_, {{"recording", stem(recording)}, {"idle", milliamperes(idle_a.value)}},
                  {.diagnosed = summary_of(r),
                   .expected = "a diagnosis that does not name " + mechanisms_of(losses_),
                   .holds = diagnosed && !claimed});
      if (claimed)
        e.notes.push_back(fmt::format("{}: {:.0f} +- {:.0f} mAh as diagnosed", stem(recording), 1e3 * claimed->value,
                                      1e3 * claimed->sigma));
    }
  }

 private:
  IdentifiedCell cell_;
  std::vector<std::string> diagnosed_;
  std::vector<ChargeLoss> losses_;
  ClaimText no_loss_;
};

}  // namespace

std::vector<ChargeLoss> read_charge_losses(files::TomlTable& file) {
  std::vector<ChargeLoss> losses;
  for (files::TomlTable& table : file.tables("loss")) {
    ChargeLoss& loss = losses.emplace_back(ChargeLoss{read_parameter_name(table), LossTimes::hours});
    const std::string times = table.text("times");
    if (times == "charge")
      loss.times = LossTimes::charge;
    else if (times == "hours_read")
      loss.times = LossTimes::hours_read;
    else if (times != "hours")
      table.reject("times", "\"hours\", \"hours_read\" or \"charge\"");
    table.finish();
  }
  return losses;
}

std::optional<Value> lost_charge_ah(const workflow::DiagnoseResult& r, const std::vector<ChargeLoss>& losses) {
  const measurement::Recording& recording = r.recordings.front().recording;
  double charged_ah = 0, hours_read = 0;
  for (std::size_t k = 1; k < recording.rows(); ++k) {
    const double hours = (recording.time_s[k] - recording.time_s[k - 1]) / 3'600;
    charged_ah += std::max(0.0, recording.current_a[k]) * hours;
    if (recording.current_a[k] != 0) hours_read += hours;
  }
  const std::map<LossTimes, double> times = {{LossTimes::hours, recording.duration_s() / 3'600},
                                             {LossTimes::hours_read, hours_read},
                                             {LossTimes::charge, charged_ah}};
  Value sum{0, 0};
  bool any = false;
  for (const ChargeLoss& loss : losses) {
    const auto v = value_of(r, loss.parameter);
    if (!v) continue;
    const double factor = times.at(loss.times);
    sum.value += v->value * factor;
    sum.sigma = std::hypot(sum.sigma, v->sigma * factor);
    any = true;
  }
  if (!any) return std::nullopt;
  return sum;
}

std::string mechanisms_of(const std::vector<ChargeLoss>& losses) {
  std::string list;
  for (const ChargeLoss& loss : losses) list += (list.empty() ? "" : ", ") + loss.parameter.mechanism;
  return list;
}

std::unique_ptr<Procedure> read_charge_loss(files::TomlTable& file, files::TomlTable& claims) {
  return std::make_unique<ReportedLoss>(file, claims);
}

std::unique_ptr<Procedure> read_no_charge_loss(files::TomlTable& file, files::TomlTable& claims) {
  return std::make_unique<NoLoss>(file, claims);
}

}  // namespace bms::proof
