#include "tests/firmware/world/adc_model.hpp"

#include <algorithm>
#include <cmath>

namespace bms::world {

namespace {

constexpr std::uint32_t eoc = 1U << 1, jeoc = 1U << 2, jstrt = 1U << 3, strt = 1U << 4, ovr = 1U << 5;
constexpr std::uint32_t scan = 1U << 8, jauto = 1U << 10, resolution = 3U << 24;
constexpr std::uint32_t adon = 1, cont = 2, dma = 1U << 8, eocs = 1U << 10, align_left = 1U << 11, jswstart = 1U << 22,
                        swstart = 1U << 30;
constexpr std::uint32_t temperature_and_reference = 1U << 23, battery = 1U << 22;
constexpr double power_up_us = 3;         ///< t_STAB, DS8626, table 67: at most 3 us
constexpr double reference_up_us = 10;    ///< t_START of the reference, DS8626, table 69
constexpr double least_sampling_us = 10;  ///< T_S_vrefint
constexpr unsigned most_violations = 20;

}  // namespace

void AdcModel::wrong(const char* what) {
  if (violations.size() < most_violations) violations.emplace_back(what);
}

void AdcModel::reset() {
  sr_ = cr1_ = cr2_ = ccr_ = dr_ = jsqr_ = 0;
  smpr_ = {};
  offsets_ = injected_ = {};
  sqr_ = {};
  regular_ = injected_sequence_ = {};
  powered_us_ = reference_on_us_ = -1;
}

/// Sampling time and 12 cycles; ADCCLK is PCLK2 divided by 2, 4, 6 or 8 (RM0090, 13.5 and 13.13.16).
double AdcModel::conversion_us(unsigned channel) const {
  constexpr std::array<int, 8> cycles{3, 15, 28, 56, 84, 112, 144, 480};
  const double clock_mhz = 1e-6 * board_.rcc.apb2_hz() / (2.0 * (1 + (ccr_ >> 16 & 3)));
  const unsigned code =
      channel >= 10 ? smpr_[0] >> 3 * (channel - 10) & 7 : smpr_[1] >> 3 * channel & 7;  // SMPR1 is first
  return (cycles[code] + 12) / clock_mhz;
}

unsigned AdcModel::convert(unsigned channel) {
  ++conversions;
  double v = 0.76;  // temperature sensor at 25 degrees C
  if (channel == reference_channel) {
    if ((ccr_ & temperature_and_reference) == 0) wrong("the reference is converted while it is off");
    v = (ccr_ & temperature_and_reference) != 0 ? reference_v : 0;
  } else if (channel < temperature_channel) {
    if (!pin_is_analog(channel)) wrong("a pin is converted that is not analog");
    v = pin_v(channel);
  } else if (channel == battery_channel) {
    wrong("the channel of VBAT is not modelled");
  }
  if (vdda_v < 0.1) return 0;
  const double code = v / vdda_v * 4095 + offset_lsb + noise_lsb * random_.normal();
  return static_cast<unsigned>(std::clamp(std::round(code), 0.0, 4095.0));
}

void AdcModel::start(bool injected, double now_us) {
  if ((cr2_ & adon) == 0) return wrong("a conversion is started while the ADC is off");
  if (now_us < powered_us_ + power_up_us) wrong("a conversion is started before the ADC is stable");
  Sequence& s = injected ? injected_sequence_ : regular_;
  s = {};
  if (injected) {
    s.length = (jsqr_ >> 20 & 3) + 1;
    for (unsigned k = 0; k < s.length; ++k) s.channel[k] = jsqr_ >> 5 * (4 - s.length + k) & 31;
  } else {
    s.length = (sqr_[0] >> 20 & 15) + 1;
    for (unsigned k = 0; k < 16; ++k) s.channel[k] = sqr_[2 - k / 6] >> 5 * (k % 6) & 31;
  }
  if ((cr1_ & scan) == 0) s.length = 1;
  for (unsigned k = 0; k < s.length; ++k) {
    if (s.channel[k] != reference_channel) continue;
    if (now_us < reference_on_us_ + reference_up_us) wrong("the reference is converted before it is stable");
    if (conversion_us(reference_channel) < least_sampling_us) wrong("the reference is sampled for less than 10 us");
  }
  if (conversion_us(0) < 12 / 36.0) wrong("the ADC clock is above 36 MHz");
  s.done_us = now_us + conversion_us(s.channel[0]);
  sr_ |= injected ? jstrt : strt;
}

void AdcModel::ends(bool injected) {
  Sequence& s = injected ? injected_sequence_ : regular_;
  const unsigned code = convert(s.channel[s.at]);
  const bool last = s.at + 1 == s.length;
  if (injected) {
    injected_[s.at] =
        static_cast<std::uint32_t>(static_cast<int>(code) - static_cast<int>(offsets_[s.at] & 0xFFF)) & 0xFFFF;
    if (last) sr_ |= jeoc;
  } else {
    const bool each = (cr2_ & eocs) != 0;
    if (each && (sr_ & eoc) != 0) sr_ |= ovr;
    if (!each || (sr_ & ovr) == 0) dr_ = (cr2_ & align_left) != 0 ? code << 4 : code;
    if (each || last) sr_ |= eoc;
  }
  ++s.at;
  if (last && !injected && (cr2_ & cont) != 0) s.at = 0;
  const bool more = s.at < s.length && (sr_ & ovr) == 0;
  s.done_us = more ? s.done_us + conversion_us(s.channel[s.at]) : -1;
}

void AdcModel::update(double now_us) {
  while (injected_sequence_.runs() && injected_sequence_.done_us <= now_us) ends(true);
  while (regular_.runs() && regular_.done_us <= now_us) ends(false);
}

int AdcModel::interrupt(double now_us) {
  update(now_us);
  const bool requested = ((cr1_ & 1U << 5) != 0 && (sr_ & eoc) != 0) || ((cr1_ & 1U << 7) != 0 && (sr_ & jeoc) != 0) ||
                         ((cr1_ & 1U << 26) != 0 && (sr_ & ovr) != 0);
  return requested ? 18 : -1;
}

std::uint32_t AdcModel::read(std::uint32_t offset, double now_us) {
  if ((board_.register_value(0x40023844) >> 8 & 1) == 0) return 0;
  update(now_us);
  if (offset == 0x00) {
    const Sequence& s = regular_.runs() ? regular_ : injected_sequence_;
    if (s.runs() && ++idle_reads_ > 2) board_.stall_us = std::max(board_.stall_us, s.done_us - now_us);
    return sr_;
  }
  idle_reads_ = 0;
  if (offset == 0x04) return cr1_;
  if (offset == 0x08) return cr2_;
  if (offset == 0x0C || offset == 0x10) return smpr_[(offset - 0x0C) / 4];
  if (offset >= 0x14 && offset < 0x24) return offsets_[(offset - 0x14) / 4];
  if (offset >= 0x2C && offset < 0x38) return sqr_[(offset - 0x2C) / 4];
  if (offset == 0x38) return jsqr_;
  if (offset >= 0x3C && offset < 0x4C) return injected_[(offset - 0x3C) / 4];
  if (offset == 0x4C) {
    sr_ &= ~eoc;
    return dr_;
  }
  if (offset == 0x300) return sr_ & 0x3F;
  return offset == 0x304 ? ccr_ : 0;
}

void AdcModel::write_cr2(std::uint32_t value, double now_us) {
  if ((value & adon) != 0 && (cr2_ & adon) == 0) powered_us_ = now_us;
  if ((value & dma) != 0) wrong("DMA is not modelled");
  if ((value >> 28 & 3) != 0 || (value >> 20 & 3) != 0) wrong("external triggers are not modelled");
  cr2_ = value & ~(swstart | jswstart);
  if ((value & adon) == 0) regular_ = injected_sequence_ = {};
  if ((value & swstart) != 0 && !regular_.runs()) start(false, now_us);
  if ((value & jswstart) != 0) start(true, now_us);
}

void AdcModel::write(std::uint32_t offset, std::uint32_t value, double now_us) {
  if ((board_.register_value(0x40023844) >> 8 & 1) == 0) return wrong("the ADC is written without its clock");
  update(now_us);
  idle_reads_ = 0;
  if (offset >= 0x2C && offset <= 0x38 && regular_.runs()) wrong("a sequence is changed while it runs");
  if (offset == 0x00) {
    sr_ &= value;
  } else if (offset == 0x04) {
    if ((value & (resolution | jauto)) != 0) wrong("this mode is not modelled");
    cr1_ = value;
  } else if (offset == 0x08) {
    write_cr2(value, now_us);
  } else if (offset == 0x0C || offset == 0x10) {
    smpr_[(offset - 0x0C) / 4] = value;
  } else if (offset >= 0x14 && offset < 0x24) {
    offsets_[(offset - 0x14) / 4] = value;
  } else if (offset >= 0x2C && offset < 0x38) {
    sqr_[(offset - 0x2C) / 4] = value;
  } else if (offset == 0x38) {
    jsqr_ = value;
  } else if (offset == 0x304) {
    const bool on = (value & temperature_and_reference) != 0;
    if (on && (ccr_ & temperature_and_reference) == 0) reference_on_us_ = now_us;
    if (on && (value & battery) != 0) wrong("VBAT and the temperature sensor are on together");
    ccr_ = value;
  }
}

}  // namespace bms::world
