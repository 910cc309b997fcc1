// Any bytes as cell constants of an update (firmware/cell_update/): the application refuses them, or what it then
// computes with is a cell. The first byte of an input chooses the application, and the bit in which another one
// differs; the others are the payload.
//
// The judge reads the payload with code of its own, and takes the ranges from what a cell is: no number is NaN,
// infinite or huge, resistances, capacitances and slopes are positive, and limits and capacity are those of the build,
// bit for bit. Every second change of the mutator puts such a value into one of the numbers, because random bytes
// rarely do.
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <random>
#include <string_view>
#include <vector>

#include "cell_update/contents.hpp"
#include "tests/fuzz/require.hpp"

extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* data, std::size_t size, std::size_t most);

namespace bms::cell_update {
namespace {

using boot::Refusal;
using Bytes = std::span<const std::uint8_t>;
using Plain = Contents<float, room_for_intervals, model::LawSet<float>>;
using Extended = Contents<float, room_for_intervals,
                          model::Laws<float, model::SlowPolarisation, model::BranchTemperature, model::OcvHysteresis,
                                      model::TemperatureResistance, model::EntropicOcv>>;

struct Number {
  std::size_t at = 0;
  std::string_view key;  ///< of the cell file; empty: a value of a mechanism
};

/// Where the numbers of a payload stand, as far as it reaches. Visitor of model/cell_fields.hpp.
class Places {
 public:
  explicit Places(Bytes bytes) : bytes_(bytes) {
    model::CellParameters<> unused;
    model::visit_cell(*this, unused);
    while (at_ + 5 <= bytes_.size()) {  // mechanisms: hash, count, values
      at_ += 5;
      for (int left = bytes_[at_ - 1]; left > 0; --left) add("");
    }
  }
  std::vector<Number> numbers;

  void table(const char*) {}
  bool optional_table(const char*, bool) { return true; }
  void number(const char* key, double) { add(key); }
  void optional_number(const char* key, double, double = 0) { add(key); }
  void optional_flag(const char*, bool) { at_ += 1; }
  template <class Column>
  void column(const char* key, const Column&) {
    for (int left = at_ < bytes_.size() ? bytes_[at_++] : 0; left > 0; --left) add(key);
  }
  template <class Column>
  void optional_column(const char* key, const Column& values) {
    column(key, values);
  }

 private:
  void add(const char* key) {
    if (at_ + 8 <= bytes_.size()) numbers.push_back({at_, key});
    at_ += 8;
  }

  Bytes bytes_;
  std::size_t at_ = fields_at;
};

double number_at(Bytes bytes, std::size_t at) {
  double value = 0;
  if (at + sizeof value <= bytes.size()) std::memcpy(&value, bytes.data() + at, sizeof value);
  return value;
}

/// The application for which the payload would be right, if it is one at all.
OfBuild built_for(Bytes payload, bool errors_are_states) {
  const auto value = [&](std::size_t k) { return number_at(payload, fields_at + 8 * k); };
  OfBuild built;
  built.capacity_ah = value(0);
  built.limits = {value(2), value(3), value(4), value(5), value(6), value(7)};
  built.errors_are_states = errors_are_states;
  return built;
}

void judge_numbers(Bytes payload) {
  constexpr double huge = 1e10;
  constexpr std::string_view positive[] = {"r0_ohm", "r1_ohm", "c1_f", "b1_v", "capacity_ah", "voltage_v"};
  constexpr std::string_view never_negative[] = {"soc", "r0_std_ohm", "r1_std_ohm", "c1_std_f", "resistance_fraction"};
  for (const Number& n : Places(payload).numbers) {
    const double v = number_at(payload, n.at);
    require(std::isfinite(v) && std::abs(v) < huge);
    require(std::ranges::find(positive, n.key) == std::end(positive) || v > 0);
    require(std::ranges::find(never_negative, n.key) == std::end(never_negative) || v >= 0);
  }
}

template <class Tables>
void judge_tables(const Tables& t) {
  require(t.size >= 3 && t.size <= room_for_intervals);
  for (std::size_t k = 0; k < t.size; ++k) {
    require(t.edge[k] < t.edge[k + 1]);
    const auto& i = t.interval[k];
    for (const float end : {0.0F, 1.0F}) {
      require(i.r0_ohm + end * i.r0_delta_ohm > 0 && i.r0_ohm + end * i.r0_delta_ohm < 1);
      require(i.r1_ohm + end * i.r1_delta_ohm > 0 && i.r1_ohm + end * i.r1_delta_ohm < 1);
      require(i.c1_f + end * i.c1_delta_f > 0 && i.c1_f + end * i.c1_delta_f < 1e7F);
    }
    require(i.per_width > 0 && std::isfinite(i.per_width) && std::isfinite(i.gap) && std::isfinite(i.gap_delta));
    require(i.error_v2 > 0 && i.error_v2 < 1);
    if (k > 0 && k + 1 < t.size) require(i.ocv_v > 0.4F && i.ocv_v < 5.1F && i.ocv_delta_v > 0);
  }
  require(t.charge.capacity_uaus > 0);
}

/// The same application but for one bit of a limit, or of the capacity.
OfBuild other(OfBuild built, std::size_t value, unsigned bit) {
  std::array<double*, 7> values{&built.limits.voltage_min_v,
                                &built.limits.voltage_max_v,
                                &built.limits.charge_current_max_a,
                                &built.limits.discharge_current_max_a,
                                &built.limits.temperature_min_c,
                                &built.limits.temperature_max_c,
                                &built.capacity_ah};
  *values[value] = std::bit_cast<double>(std::bit_cast<std::uint64_t>(*values[value]) ^ std::uint64_t{1} << bit);
  return built;
}

template <class Of>
void one(Bytes payload, bool errors_are_states, unsigned bit) {
  const OfBuild built = built_for(payload, errors_are_states);
  Of contents;
  if (contents.read(payload, built) != Refusal::none) return;
  judge_numbers(payload);
  judge_tables(contents.tables());
  for (std::size_t value = 0; value < 7; ++value)
    require(contents.read(payload, other(built, value, bit)) == Refusal::other_limits);
}

}  // namespace
}  // namespace bms::cell_update

extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size, std::size_t most, unsigned seed) {
  std::mt19937 random(seed);
  if (size < 2 || random() % 2 == 0) return LLVMFuzzerMutate(data, size, most);
  const auto numbers = bms::cell_update::Places({data + 1, size - 1}).numbers;
  if (numbers.empty()) return LLVMFuzzerMutate(data, size, most);
  std::uint8_t* const at = data + 1 + numbers[random() % numbers.size()].at;
  double now = 0;
  std::memcpy(&now, at, sizeof now);
  const double any = std::uniform_real_distribution<>(0.5, 1.5)(random);
  using Limits = std::numeric_limits<double>;
  const double values[] = {Limits::quiet_NaN(),
                           Limits::infinity(),
                           -Limits::infinity(),
                           Limits::max(),
                           Limits::denorm_min(),
                           -now,
                           now * 1e30,
                           now * 1e3,
                           now * any,
                           now * (1 + 1e-3 * any),
                           0.0,
                           -0.0};
  const double value = values[random() % std::size(values)];
  std::memcpy(at, &value, sizeof value);
  return size;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace bms::cell_update;
  if (size == 0) return 0;
  const std::vector<std::uint8_t> payload(data + 1, data + size);  // of its own, so that nothing is read beyond
  const unsigned bit = data[0] / 2 % 52;
  if (data[0] % 2 == 0)
    one<Plain>(payload, false, bit);
  else
    one<Extended>(payload, true, bit);
  return 0;
}
