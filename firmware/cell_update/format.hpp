// Cell constants as an update carries them: the payload of a container of the kind cell (firmware/boot/container.hpp).
// Little-endian.
//
//   offset  bytes
//        0      4   magic "CELL"
//        4      2   format, 1
//        6      1   number of mechanisms
//        7      1   0
//        8          the values of model/cell_fields.hpp in their order: a number as a double, a flag as one byte, a
//                   column as its length in one byte and its values
//                   for each mechanism that the estimator computes, in the order of the catalogue: hash of its id (4),
//                   number of parameters (1), their values
//
// It has the numbers of the cell file, not tables that are prepared for one application: the application prepares them
// with the code that prepares those of its build, and checks them as the build does.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "hal/bytes.hpp"
#include "model/cell_fields.hpp"

namespace bms::cell_update {

inline constexpr std::uint32_t magic = 0x4C4C'4543;
inline constexpr std::uint16_t format = 1;
inline constexpr std::size_t fields_at = 8;
/// Intervals of SOC that the tables of an application have room for: more than any cell file of model/cells/ has. An
/// application that is built with a larger one has room for as many as that.
inline constexpr std::size_t room_for_intervals = 48;

/// FNV-1a of a mechanism's id.
constexpr std::uint32_t id_hash(std::string_view id) {
  std::uint32_t hash = 0x811C'9DC5;
  for (const char c : id) hash = (hash ^ static_cast<std::uint8_t>(c)) * 0x0100'0193;
  return hash;
}

/// Visitor of model/cell_fields.hpp that reads. After the end of the bytes everything is 0, and good() is false.
class Reader {
 public:
  explicit constexpr Reader(std::span<const std::uint8_t> bytes) : bytes_(bytes) {}

  void table(const char*) {}
  bool optional_table(const char*, bool) { return true; }
  void number(const char*, double& value) { value = number(); }
  void optional_number(const char*, double& value, double = 0) { value = number(); }
  void optional_flag(const char*, bool& value) { value = take<std::uint8_t>() != 0; }
  template <class Column>
  void column(const char*, Column& column) {
    column.size = take<std::uint8_t>();
    if (column.size > column.value.size()) {
      good_ = false;
      column.size = 0;
    }
    for (std::size_t k = 0; k < column.size; ++k) column[k] = number();
  }
  template <class Column>
  void optional_column(const char* key, Column& values) {
    column(key, values);
  }

  double number() { return std::bit_cast<double>(take<std::uint64_t>()); }
  template <class Integer>
  Integer take() {
    if (bytes_.size() < sizeof(Integer)) good_ = false;
    if (!good_) return 0;
    const auto value = hal::get_bytes<Integer>(bytes_, 0);
    bytes_ = bytes_.subspan(sizeof(Integer));
    return value;
  }
  bool good() const { return good_; }
  bool at_end() const { return bytes_.empty(); }

 private:
  std::span<const std::uint8_t> bytes_;
  bool good_ = true;
};

}  // namespace bms::cell_update
