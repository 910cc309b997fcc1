#include "tests/firmware/rcc_model.hpp"

#include <algorithm>

#include <fmt/format.h>

namespace bms::firmware {

namespace {

constexpr std::uint32_t hsi_on = 1U << 0, hsi_ready = 1U << 1, hse_on = 1U << 16, hse_ready = 1U << 17,
                        security_on = 1U << 19, pll_on = 1U << 24, pll_ready = 1U << 25;  // RCC_CR, 7.3.1
constexpr std::uint32_t from_hse = 1U << 22, pllcfgr_reserved = 0xF0BC8000, pllcfgr_reset = 0x24003010;  // 7.3.2
constexpr std::uint32_t failure_flag = 1U << 7, clear_failure = 1U << 23;                                // 7.3.4
constexpr std::uint32_t switch_hsi = 0, switch_hse = 1, switch_pll = 2;
constexpr double hsi_hz = 16e6;

}  // namespace

void RccModel::reset() {
  cr_ = 0x83;
  pllcfgr_ = pllcfgr_reset;
  cfgr_ = 0;
  lsi_on_ = failed_ = false;
  lsi_since_us_ = stopped_since_us_ = -1;
}

bool RccModel::pll_runs_true() const {
  return pll_locks && ((pllcfgr_ & from_hse) == 0 || (crystal && (cr_ & hse_on) != 0));
}

double RccModel::system_hz() const {
  switch (cfgr_ >> 2 & 3) {
    case switch_hsi:
      return hsi_hz;
    case switch_hse:
      return crystal ? crystal_hz : 0;
    default:
      break;
  }
  if (!pll_runs_true()) return free_running_hz;
  const double in = (pllcfgr_ & from_hse) != 0 ? crystal_hz : hsi_hz;
  return in / (pllcfgr_ & 63) * (pllcfgr_ >> 6 & 511) / (2 * ((pllcfgr_ >> 16 & 3) + 1));
}

double RccModel::core_hz() const {
  constexpr unsigned shift[] = {1, 2, 3, 4, 6, 7, 8, 9};
  const std::uint32_t hpre = cfgr_ >> 4 & 15;
  return (hpre & 8) != 0 ? system_hz() / (1U << shift[hpre & 7]) : system_hz();
}

double RccModel::lsi_hz_now(double now_us) const {
  return lsi_since_us_ >= 0 && now_us >= lsi_since_us_ + lsi_after_us ? lsi_hz : 0;
}

void RccModel::force_lsi(double now_us) {
  if (lsi_since_us_ < 0) lsi_since_us_ = now_us;
}

void RccModel::advance(double now_us) {
  if (crystal && (cr_ & hse_on) != 0 && now_us >= crystal_since_us_ + crystal_after_us) cr_ |= hse_ready;
  if ((cr_ & pll_on) != 0 && pll_runs_true() && now_us >= pll_since_us_ + pll_after_us) cr_ |= pll_ready;
  const std::uint32_t watched = security_on | hse_ready | hse_on;
  if (crystal || (cr_ & watched) != watched || !security_works) {
    stopped_since_us_ = -1;
    return;
  }
  if (stopped_since_us_ < 0) stopped_since_us_ = now_us;
  if (now_us >= stopped_since_us_ + security_after_us) failure();
}

/// 7.2.7: the oscillator is switched off; if the system clock depends on it, the core continues on HSI without the PLL.
void RccModel::failure() {
  failed_ = true;
  cr_ &= ~(hse_on | hse_ready | security_on);
  const std::uint32_t used = cfgr_ >> 2 & 3;
  if (used == switch_hse || (used == switch_pll && (pllcfgr_ & from_hse) != 0)) {
    cfgr_ &= ~15U;
    cr_ = (cr_ & ~(pll_on | pll_ready)) | hsi_on | hsi_ready;
  }
}

std::uint32_t RccModel::read(std::uint32_t at, double now_us) {
  advance(now_us);
  switch (at) {
    case cr:
      return cr_;
    case pllcfgr:
      return pllcfgr_;
    case cfgr:
      return cfgr_;
    case cir:
      return failed_ ? failure_flag : 0;
    default:
      return reset_flags | (lsi_on_ ? 1U : 0U) | (lsi_hz_now(now_us) > 0 ? 2U : 0U);
  }
}

void RccModel::write_cr(std::uint32_t value, double now_us) {
  const std::uint32_t used = cfgr_ >> 2 & 3;
  if ((value & hse_on) != 0 && (cr_ & hse_on) == 0) crystal_since_us_ = now_us;
  if ((value & pll_on) != 0 && (cr_ & pll_on) == 0) {
    pll_since_us_ = now_us;
    check_pll();
  }
  if (used == switch_pll && (value & pll_on) == 0) violations.push_back("the PLL is stopped while the core needs it");
  constexpr std::uint32_t flags = hsi_ready | hse_ready | pll_ready | 0xFF00;
  cr_ = (cr_ & flags) | (value & ~flags);
  if ((cr_ & hse_on) == 0) cr_ &= ~hse_ready;
  if ((cr_ & pll_on) == 0) cr_ &= ~pll_ready;
}

void RccModel::write(std::uint32_t at, std::uint32_t value, double now_us) {
  advance(now_us);
  switch (at) {
    case cr:
      return write_cr(value, now_us);
    case pllcfgr:
      if ((cr_ & pll_on) != 0) violations.push_back("PLLCFGR is written while the PLL is on");
      if (((value ^ pllcfgr_reset) & pllcfgr_reserved) != 0) violations.push_back("a reserved bit of PLLCFGR changes");
      pllcfgr_ = value;
      return;
    case cfgr: {
      const std::uint32_t wanted = value & 3;
      const bool ready = wanted == switch_hsi || (wanted == switch_hse && (cr_ & hse_ready) != 0) ||
                         (wanted == switch_pll && (cr_ & pll_ready) != 0);
      cfgr_ = (value & ~12U) | (ready ? wanted << 2 : cfgr_ & 12U);
      return;
    }
    case cir:
      if ((value & clear_failure) != 0) failed_ = false;
      return;
    default:
      if ((value & 1U << 24) != 0) reset_flags = 0;  // RMVF
      lsi_on_ = (value & 1) != 0;
      if (lsi_on_) force_lsi(now_us);
  }
}

/// 7.3.2: input of the VCO 1 to 2 MHz, output 100 to 432 MHz, 48 MHz domain at most 48 MHz.
void RccModel::check_pll() {
  const double in = ((pllcfgr_ & from_hse) != 0 ? crystal_hz : hsi_hz) / (pllcfgr_ & 63);
  const double vco = in * (pllcfgr_ >> 6 & 511);
  const std::uint32_t q = pllcfgr_ >> 24 & 15;
  if (!(in >= 0.95e6 && in <= 2.1e6)) violations.push_back(fmt::format("the PLL gets {} MHz", 1e-6 * in));
  if (!(vco >= 100e6 && vco <= 432e6)) violations.push_back(fmt::format("the PLL makes {} MHz", 1e-6 * vco));
  if (q < 2 || vco / q > 48e6) violations.push_back(fmt::format("the 48 MHz domain gets {} MHz", 1e-6 * vco / q));
}

void RccModel::check(std::uint32_t flash_acr, std::uint32_t pwr_cr) {
  const double core = core_hz();
  if (core > 168e6) violations.push_back(fmt::format("the core runs at {} MHz", 1e-6 * core));
  if (apb1_hz() > 42e6) violations.push_back(fmt::format("APB1 runs at {} MHz", 1e-6 * apb1_hz()));
  if (apb2_hz() > 84e6) violations.push_back(fmt::format("APB2 runs at {} MHz", 1e-6 * apb2_hz()));
  // 3.5.1, table 10: a wait state for each 30 MHz at 2.7 to 3.6 V
  if (core > 30e6 * ((flash_acr & 7) + 1)) {
    violations.push_back(fmt::format("{} wait states at {} MHz", flash_acr & 7, 1e-6 * core));
  }
  if (core > 144e6 && (pwr_cr & 1U << 14) == 0) violations.push_back("above 144 MHz without voltage scale 1 (5.1.4)");
}

}  // namespace bms::firmware
