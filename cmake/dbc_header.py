"""DBC file -> C++ header: a struct per message, its values in physical units, packed and unpacked by can/codec.hpp.

    dbc_header.py IN.dbc OUT.hpp [NAMESPACE]        inside bms::can

A signal of more than 24 bits, or of factor 1 without a unit, is an integer, any other a float; of more than 24 bits with a factor it is the raw value. Its attribute Invalid is the raw value that says "not known", in C++
NaN. Signals Crc and Counter are not values: the codec fills them in. A message without them and without a data id is not protected, its bits that are no
signal are 1, as J1939 has it. Needs python3-canmatrix.
"""
import os
import re
import sys

from dbc_file import load


def snake(name):
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name).lower()


def is_integer(signal):
    return signal.size > 24 or (signal.factor == 1 and signal.offset == 0 and signal.unit == "")


def number(value):
    text = repr(float(value))
    return text if any(c in text for c in ".en") else text + ".0"


def quoted(text):
    return " ".join((text or "").replace("\\", "\\\\").replace('"', '\\"').split())


def layout(signal):
    invalid = (signal.attributes.get("Invalid") or "").strip('"')
    if invalid and int(invalid) >= 1 << 31:
        invalid = str(int(invalid) - (1 << 32))
    return "{{{}, {}, {}, {}F, {}F, {}F, {}F, {}, {}}}".format(
        signal.start_bit, signal.size, str(signal.is_signed).lower(), number(signal.factor), number(signal.offset), number(signal.min), number(signal.max),
        str(invalid != "").lower(), invalid or 0)


def message(frame):
    values = [s for s in frame.signals if s.name not in ("Crc", "Counter")]
    if frame.size != 8:
        raise SystemExit(f"{frame.name}: {frame.size} bytes, the codec's frames have 8")
    for s in frame.signals:
        if not s.is_little_endian:
            raise SystemExit(f"{frame.name}.{s.name}: not little-endian, which the codec is for")
    data_id, long_id = int(frame.attributes.get("E2EDataId") or 0), frame.arbitration_id.extended
    lines = [f"/// {frame.comment}", f"struct {frame.name} {{", f"  static constexpr const char* name = \"{frame.name}\";",
             f"  static constexpr std::uint{32 if long_id else 16}_t id = {frame.arbitration_id.id:#x};",
             f"  static constexpr std::uint32_t cycle_us = {frame.cycle_time * 1000};  ///< 0: not by time"]
    if data_id:
        lines.append(f"  static constexpr std::uint16_t data_id = {data_id};")
    for s in values:
        unit = f" [{s.unit}]" if s.unit else ""
        lines.append(f"  static constexpr SignalLayout {snake(s.name)}_layout = {layout(s)};")
        if is_integer(s):
            lines.append(f"  std::{'' if s.is_signed else 'u'}int32_t {snake(s.name)} = 0;  ///<{unit} {s.comment}")
        else:
            lines.append(f"  float {snake(s.name)} = unknown;  ///<{unit} {s.comment}")
        for raw, text in sorted(s.values.items()):
            lines.append(f"  static constexpr std::uint32_t {snake(s.name)}_{re.sub(r'[^a-z0-9]+', '_', str(text).lower())} = {raw};")
    unused = "" if data_id else ", ".join(["0xFF"] * frame.size)
    lines += ["", f"  constexpr can::Frame frame({'std::uint8_t counter' if data_id else ''}) const {{", f"    can::Frame out{{id, {frame.size}, {{{unused}}}, {str(long_id).lower()}}};"]
    lines += [f"    put<{snake(s.name)}_layout>(out, {snake(s.name)});" for s in values]
    lines += ["    protect(out, data_id, counter);"] if data_id else []
    lines += ["    return out;", "  }", f"  static constexpr {frame.name} of(const can::Frame& frame) {{", f"    {frame.name} out;"]
    lines += [f"    out.{snake(s.name)} = get<{snake(s.name)}_layout, decltype(out.{snake(s.name)})>(frame);" for s in values]
    lines += ["    return out;", "  }", "  /// see(name, unit, value, layout) for each.", "  template <class See>", "  constexpr void each(See&& see) {"]
    lines += [f'    see("{s.name}", "{s.unit}", {snake(s.name)}, {snake(s.name)}_layout);' for s in values]
    lines += ["  }", "  /// see(name, comment, names of values) for each: what a person reads.", "  template <class See>", "  static void each_in_words(See&& see) {"]
    for s in values:
        names = ", ".join(f'ValueName{{{raw}, "{quoted(str(text))}"}}' for raw, text in sorted(s.values.items()))
        lines.append(f'    {{ static constexpr std::array<ValueName, {len(s.values)}> names{{{{{names}}}}}; see("{s.name}", "{quoted(s.comment)}", std::span<const ValueName>(names)); }}' if names else
                     f'    see("{s.name}", "{quoted(s.comment)}", std::span<const ValueName>());')
    lines += ["  }", "};", ""]
    return lines


def main():
    source, target = sys.argv[1:3]
    namespace = "bms::can" + "".join("::" + word for word in sys.argv[3:])
    frames = load(source).frames
    lines = [f"// Made at build time from {os.path.basename(source)}; do not edit.", "#pragma once", "", "#include <array>", "#include <cstdint>", "#include <span>", "#include <tuple>", "", '#include "can/codec.hpp"', "", f"namespace {namespace} {{", ""]
    for frame in frames:
        lines += message(frame)
    names = ", ".join(f.name for f in frames)
    lines += ["/// All of them.", f"using Messages = std::tuple<{names}>;", "", f"}}  // namespace {namespace}", ""]
    text = "\n".join(lines)
    if os.path.exists(target) and open(target).read() == text:
        return
    with open(target, "w") as out:
        out.write(text)


main()
