// Cell constants of an update (firmware/cell_update/), in an image for a slot of the boot loader. Without them, those
// of the build act.
#pragma once

#include <cstdint>
#include <span>

#include "boot/refusal.hpp"

namespace bms::firmware {

/// Checks a payload as the build checks its cell file; nothing else changes.
boot::Refusal check_cell_constants(std::span<const std::uint8_t> payload);

/// The same, and from now on they act if they are accepted. hash: of their cell file, for the message Identity. Only
/// before the first sample: the estimator's states belong to its tables.
boot::Refusal use_cell_constants(std::span<const std::uint8_t> payload, std::uint32_t hash);

/// Hash of the cell file of the build.
std::uint32_t cell_hash_of_build();

}  // namespace bms::firmware
