// The parameters in flash: one record with all of them, in two copies (storage/log.hpp gives each its CRC and survives
// any loss of power). A record of firmware that knew fewer parameters gives the first ones; of one that knew more, the
// first ones count, too.
#pragma once

#include <cstddef>
#include <cstdint>

#include "parameters/parameter.hpp"
#include "storage/crc32.hpp"
#include "storage/records.hpp"

namespace bms::parameters {

/// Layout 1, 3 + 4 n bytes.
struct ParametersRecord {
  static constexpr storage::Kind kind = storage::parameters_kind, copy = storage::parameters_copy_kind;
  static constexpr std::size_t most = 59;  ///< that fit into a record

  std::uint16_t revision = 0;  ///< incremented with each change
  std::uint8_t count = 0;      ///< of `values`
  Values values{};
};

constexpr storage::Bytes encode(const ParametersRecord& r, storage::Payload into) {
  storage::Encoder e(into);
  e.put(r.revision).put(static_cast<std::uint8_t>(r.values.size()));
  for (const std::int32_t value : r.values) e.put(value);
  return e.bytes();
}

constexpr bool decode(storage::Bytes from, std::uint8_t layout, ParametersRecord& r) {
  storage::Decoder d(from);
  const auto revision = d.read<std::uint16_t>();
  const auto count = d.read<std::uint8_t>();
  if (layout != 1 || from.size() != 3 + std::size_t{4} * count) return false;
  r = {.revision = revision,
       .count = static_cast<std::uint8_t>(std::min<std::size_t>(count, parameter_count)),
       .values = {}};
  for (std::size_t k = 0; k < r.count; ++k) d.get(r.values[k]);
  return true;
}

/// CRC-32 of all values, little-endian, in the order of their numbers: a set that lost a frame has another one.
constexpr std::uint32_t check_code(const Values& values) {
  storage::Crc32 crc;
  for (const std::int32_t value : values) {
    std::array<std::uint8_t, 4> bytes{};
    hal::put_bytes(bytes, 0, value);
    crc.add(bytes);
  }
  return crc.value();
}

}  // namespace bms::parameters
