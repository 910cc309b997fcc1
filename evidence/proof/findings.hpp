// What a diagnosis reported: mechanisms, their parameters, in words and as numbers.
#pragma once

#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "diagnosis/diagnose.hpp"
#include "files/toml_table.hpp"
#include "workflow/diagnosis_result.hpp"

namespace bms::proof {

struct Value {
  double value = std::numeric_limits<double>::quiet_NaN();
  double sigma = 0;  ///< standard deviation
};

/// A parameter of the catalogue by its names.
struct ParameterName {
  std::string mechanism;
  std::string parameter;
};

/// Returns true if the catalogue has that parameter.
bool has_parameter(const ParameterName& name);

/// Reads the keys `mechanism` and `parameter`. Throws BadInput if they are unknown.
ParameterName read_parameter_name(files::TomlTable& table);

/// Returns true if the diagnosis names the mechanism.
bool is_named(const workflow::DiagnoseResult& r, std::string_view mechanism);

/// Returns true if the diagnosis names the mechanism, or one that the recording cannot distinguish from it.
bool is_named_or_equivalent(const workflow::DiagnoseResult& r, std::string_view mechanism);

/// The verdict and the mechanisms: "CAUSE: ocv_hysteresis or slow_polarisation".
std::string summary_of(const workflow::DiagnoseResult& r);

/// A parameter as diagnosed; nothing if its mechanism is not named.
std::optional<Value> value_of(const workflow::DiagnoseResult& r, const ParameterName& parameter);

/// The diagnosed cell, moved by one standard deviation along each principal axis of the joint covariance of a
/// mechanism's parameters.
std::vector<diagnosis::Hypothesis> one_sigma_away(const diagnosis::Diagnosis& d, std::string_view mechanism);

}  // namespace bms::proof
