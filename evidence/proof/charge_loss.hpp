// Charge that is counted but not stored, as a diagnosis reports it.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "files/toml_table.hpp"
#include "proof/findings.hpp"

namespace bms::proof {

/// What a parameter is multiplied by. hours_read: those with another reading than exactly 0 (model::CurrentOffset).
enum class LossTimes { hours, hours_read, charge };

/// A mechanism that loses charge: its parameter times the hours of the recording, or times the charge that went in.
struct ChargeLoss {
  ParameterName parameter;
  LossTimes times = LossTimes::hours;
};

/// All [[loss]] of an experiment file. Throws BadInput.
std::vector<ChargeLoss> read_charge_losses(files::TomlTable& file);

/// Lost charge [Ah] over the recording of a diagnosis; nothing if no such mechanism is named. A changed capacity is not
/// a loss.
std::optional<Value> lost_charge_ah(const workflow::DiagnoseResult& r, const std::vector<ChargeLoss>& losses);

/// "current_offset, coulombic_loss, leakage".
std::string mechanisms_of(const std::vector<ChargeLoss>& losses);

}  // namespace bms::proof
