// The plan of the protections with the parameters that are active now, in RAM. Its check code is computed again in the
// background, a part with every sample: a flipped bit is an internal fault, as one in the image would be.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>

#include "parameters/tightened_plan.hpp"
#include "storage/crc32.hpp"

namespace bms::parameters {

class ActivePlan {
 public:
  /// Call with open contactors. The plan changes in place, so references to it stay valid.
  void build(const protection::ProtectionPlan& of_build, const Values& values, const Ranges& ranges,
             std::uint32_t sample_us) {
    plan_ = of_build;
    tighten(plan_, values, ranges, sample_us);
    code_ = storage::crc32(bytes());
    running_ = {};
    at_ = 0;
    intact_ = true;
  }
  const protection::ProtectionPlan& plan() const { return plan_; }
  /// Call with every sample: checks a further part. Returns false from the first pass on that found another code.
  bool intact() {
    const auto all = bytes();
    const std::size_t count = std::min(part_bytes, all.size() - at_);
    running_.add(all.subspan(at_, count));
    at_ += count;
    if (at_ == all.size()) {
      intact_ = intact_ && running_.value() == code_;
      running_ = {};
      at_ = 0;
    }
    return intact_;
  }
  /// For tests of flipped bits.
  protection::ProtectionPlan& disturb() { return plan_; }

 private:
  static constexpr std::size_t part_bytes = 8;  ///< a pass takes some 180 samples

  std::span<const std::uint8_t> bytes() const { return {reinterpret_cast<const std::uint8_t*>(&plan_), sizeof(plan_)}; }

  protection::ProtectionPlan plan_{};
  storage::Crc32 running_;
  std::size_t at_ = 0;
  std::uint32_t code_ = 0;
  bool intact_ = true;
};

}  // namespace bms::parameters
