// Instrument faults added to a recording, and whether the diagnosis finds their kind and size.
#include <algorithm>
#include <cmath>
#include <optional>

#include <fmt/format.h>

#include "diagnosis/quantity_text.hpp"
#include "proof/claims.hpp"
#include "proof/faults_put_in.hpp"
#include "proof/procedure.hpp"

namespace bms::proof {

namespace {

using measurement::Recording;

using AddFault = std::vector<double> (*)(Recording& r, double amount);

// Each adds a fault of the given amount and returns the sizes that the diagnosis should find.

template <void (*put)(Recording&, double)>
std::vector<double> add(Recording& r, double amount) {
  put(r, amount);
  return {amount};
}

/// By some rows, however long they are. Size: the mean delay in seconds.
std::vector<double> add_skew(Recording& r, double rows) {
  const auto late = static_cast<std::size_t>(rows);
  std::vector<double>& current_a = r.current_a.edit();
  for (std::size_t k = r.rows(); k-- > 0;) current_a[k] = current_a[k >= late ? k - late : 0];
  return {rows * r.duration_s() / static_cast<double>(r.rows() - 1)};
}

/// Sizes: the limit, and the mean current above it.
std::vector<double> add_clipping(Recording& r, double limit_a) {
  double excess_a = 0;
  std::size_t count = 0;
  for (const double i : r.current_a) {
    if (std::abs(i) <= limit_a) continue;
    excess_a += std::abs(i) - limit_a;
    ++count;
  }
  put_clipping(r, limit_a);
  return {limit_a, count > 0 ? excess_a / static_cast<double>(count) : 0};
}

/// From half time on. Sizes: the resistance, and the time.
std::vector<double> add_contact_step(Recording& r, double ohm) {
  const double onset_s = std::round((r.time_s.front() + r.time_s.back()) / 2);
  const auto first = std::lower_bound(r.time_s.begin(), r.time_s.end(), onset_s);
  put_contact(r, ohm, static_cast<std::size_t>(first - r.time_s.begin()));
  return {ohm, onset_s};
}

struct FaultCode {
  const char* mechanism;
  AddFault add;
  std::size_t sizes;  ///< that it returns
};
constexpr FaultCode fault_codes[] = {
    {"current_offset", add<put_current_offset>, 1},
    {"current_gain", add<put_current_gain>, 1},
    {"channel_skew", add_skew, 1},
    {"current_clipping", add_clipping, 2},
    {"contact_step", add_contact_step, 2},
    {"contact_intermittent", add<put_contact_in_bursts>, 1},
    {"voltage_offset", add<put_voltage_offset>, 1},
};

/// One size of a fault, and how far the diagnosis may be off.
struct FaultSize {
  ParameterName parameter;
  std::string unit;
  std::optional<double> tolerance;
  double tolerance_fraction = 0;  ///< of the added size, if there is no tolerance
};

struct Fault {
  std::string mechanism, text;
  double amount = 0;
  AddFault add = nullptr;
  std::vector<FaultSize> sizes;
};

FaultSize read_size(files::TomlTable& table, const std::string& mechanism) {
  FaultSize size{{mechanism, table.text("parameter")}, table.text("unit"), {}, 0};
  if (!has_parameter(size.parameter)) table.reject("parameter", "a parameter of " + mechanism);
  if (table.has("tolerance"))
    size.tolerance = table.number("tolerance");
  else
    size.tolerance_fraction = table.number("tolerance_fraction");
  table.finish();
  return size;
}

Fault read_fault(files::TomlTable& table) {
  Fault fault{table.text("mechanism"), table.text("text"), table.number("amount"), nullptr, {}};
  const auto* const code = std::find_if(std::begin(fault_codes), std::end(fault_codes),
                                        [&](const FaultCode& one) { return fault.mechanism == one.mechanism; });
  if (code == std::end(fault_codes)) table.reject("mechanism", "a fault that added_faults.cpp can add");
  fault.add = code->add;
  for (files::TomlTable& size : table.tables("size")) fault.sizes.push_back(read_size(size, fault.mechanism));
  if (fault.sizes.size() != code->sizes) table.reject("mechanism", fmt::format("[[fault.size]] {} times", code->sizes));
  table.finish();
  return fault;
}

/// Whether the diagnosis of the unchanged recording says that it would have revealed a fault of this size.
Visibility visibility_of(const Fault& fault, const std::vector<double>& added, const diagnosis::Diagnosis& healthy) {
  const std::size_t mechanism = model::mechanism_index(fault.mechanism);
  for (const diagnosis::DetectionLimit& limit : healthy.limits) {
    const model::Parameter& parameter = model::catalogue[mechanism].parameter[limit.parameter];
    if (limit.mechanism != mechanism) continue;
    for (std::size_t k = 0; k < fault.sizes.size(); ++k) {
      if (fault.sizes[k].parameter.parameter == parameter.name)
        return {diagnosis::parameter_text(parameter, limit.value, 0), std::abs(added[k]) >= limit.value};
    }
  }
  return {};
}

class AddedFaults : public Procedure {
 public:
  AddedFaults(files::TomlTable& file, files::TomlTable& claims)
      : cell_(file.text("cell")),
        recording_(file.text("recording")),
        named_(read_claim_text(claims, "named", {"mechanism", "fault"})),
        size_(read_claim_text(claims, "size", {"mechanism", "fault", "parameter"})) {
    for (files::TomlTable& table : file.tables("fault")) faults_.push_back(read_fault(table));
  }

  void run(ProofLab& lab, ProofExperiment& e) const override {
    const workflow::DiagnoseResult& unchanged = lab.diagnosed(lab.built_in(cell_), {recording_});
    e.notes.push_back("The unchanged recording: " + summary_of(unchanged));
    ProofPoints points{"Diagnosed size over added size", "", "diagnosed / added", {}, {}};
    points.predicted.push_back({"diagnosed", {}});
    const diagnosis::Diagnosis& healthy = lab.diagnosed(unchanged.extended_cell, {recording_}).diagnosis;
    for (const Fault& fault : faults_) {
      claim_fault(lab, unchanged.extended_cell, healthy, fault, points, e);
      points.names.push_back(fault.mechanism);
    }
    e.points.push_back(std::move(points));
  }

 private:
  void claim_fault(ProofLab& lab, const files::CellFile& cell, const diagnosis::Diagnosis& healthy, const Fault& fault,
                   ProofPoints& points, ProofExperiment& e) const {
    Recording r = lab.recording(recording_);
    const std::vector<double> added = fault.add(r, fault.amount);
    const workflow::DiagnoseResult& d = lab.diagnosed(cell, recording_ + ", " + fault.text, {r});
    const Words words = {{"mechanism", fault.mechanism}, {"fault", fault.text}};
    const Visibility visibility = visibility_of(fault, added, healthy);
    // another name is never right
    const bool visible = visibility.visible || d.diagnosis.verdict != diagnosis::Verdict::no_mismatch;
    add_named(e, {named_, {fault.mechanism}}, words, d, visibility);
    for (std::size_t k = 0; k < fault.sizes.size(); ++k) {
      const FaultSize& size = fault.sizes[k];
      Words size_words = words;
      size_words.emplace_back("parameter", size.parameter.parameter);
      add_number(e, size_, size_words,
                 {.claimed = value_of(d, size.parameter),
                  .diagnosed = summary_of(d),
                  .measured = {added[k], 0},
                  .tolerance = size.tolerance.value_or(size.tolerance_fraction * added[k]),
                  .unit = size.unit,
                  .visible = visible});
    }
    const double x = static_cast<double>(points.measured.size() + 1);
    points.measured.push_back({x, 1, 0});
    if (const auto claimed = value_of(d, fault.sizes.back().parameter))
      points.predicted[0].points.push_back({x, claimed->value / added.back(), claimed->sigma / std::abs(added.back())});
  }

  std::string cell_, recording_;
  ClaimText named_, size_;
  std::vector<Fault> faults_;
};

}  // namespace

std::unique_ptr<Procedure> read_added_faults(files::TomlTable& file, files::TomlTable& claims) {
  return std::make_unique<AddedFaults>(file, claims);
}

}  // namespace bms::proof
