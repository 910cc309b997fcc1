"""Generates a C++ header from a DBC file: one struct per message with its values in physical units, packed and
unpacked by can/codec.hpp. Needs python3-canmatrix.

    dbc_header.py IN.dbc OUT.hpp [NAMESPACE]        NAMESPACE inside bms::can

* A signal of more than 24 bits, or of factor 1 without a unit, becomes an integer; every other signal a float. A signal
  of more than 24 bits with a factor is its raw value.
* The attribute Invalid is the raw value for "not known", which is NaN in C++.
* The codec fills in the signals Crc and Counter; they are not values. A message without them and without a data id is
  not protected, and its unused bits are 1, as J1939 requires.
"""
import hashlib
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
    floats = [number(value) + "F" for value in (signal.factor, 0 - signal.offset, signal.min, signal.max)]
    words = [signal.start_bit, signal.size, str(signal.is_signed).lower(), *floats, str(invalid != "").lower(),
             invalid or 0]
    return "{" + ", ".join(str(word) for word in words) + "}"


def member_lines(signal):
    """Layout, value and named raw values of a signal."""
    name, unit = snake(signal.name), f" [{signal.unit}]" if signal.unit else ""
    lines = [f"  static constexpr SignalLayout {name}_layout = {layout(signal)};"]
    if is_integer(signal):
        lines.append(f"  std::{'' if signal.is_signed else 'u'}int32_t {name} = 0;  ///<{unit} {signal.comment}")
    else:
        lines.append(f"  float {name} = unknown;  ///<{unit} {signal.comment}")
    for raw, text in sorted(signal.values.items()):
        value = re.sub(r"[^a-z0-9]+", "_", str(text).lower())
        lines.append(f"  static constexpr std::uint32_t {name}_{value} = {raw};")
    return lines


def pack_lines(frame, values, data_id):
    """The functions frame() and of()."""
    names = [snake(s.name) for s in values]
    unused = "" if data_id else ", ".join(["0xFF"] * frame.size)
    long_id = str(frame.arbitration_id.extended).lower()
    lines = ["", f"  constexpr can::Frame frame({'std::uint8_t counter' if data_id else ''}) const {{",
             f"    can::Frame out{{id, {frame.size}, {{{unused}}}, {long_id}}};"]
    lines += [f"    put<{name}_layout>(out, {name});" for name in names]
    lines += ["    protect(out, data_id, counter);"] if data_id else []
    lines += ["    return out;", "  }"]
    lines += [f"  static constexpr {frame.name} of(const can::Frame& frame) {{", f"    {frame.name} out;"]
    lines += [f"    out.{name} = get<{name}_layout, decltype(out.{name})>(frame);" for name in names]
    return lines + ["    return out;", "  }"]


def in_words(signal):
    """The call see(name, comment, names of values) of one signal."""
    begin = f'see("{signal.name}", "{quoted(signal.comment)}", std::span<const ValueName>('
    if not signal.values:
        return f"    {begin}));"
    names = ", ".join(f'ValueName{{{raw}, "{quoted(str(text))}"}}' for raw, text in sorted(signal.values.items()))
    array = f"static constexpr std::array<ValueName, {len(signal.values)}> names{{{{{names}}}}};"
    return f"    {{ {array} {begin}names)); }}"


def visit_lines(values):
    """The functions each() and each_in_words()."""
    lines = ["  /// Calls see(name, unit, value, layout) for each signal.", "  template <class See>",
             "  constexpr void each(See&& see) {"]
    for s in values:
        name = snake(s.name)
        lines.append(f'    see("{s.name}", "{s.unit}", {name}, {name}_layout);')
    lines += ["  }", "  /// Calls see(name, comment, names of values) for each signal: texts for people.",
              "  template <class See>", "  static void each_in_words(See&& see) {"]
    return lines + [in_words(s) for s in values] + ["  }"]


def message(frame):
    if frame.size != 8:
        raise SystemExit(f"{frame.name}: {frame.size} bytes, but the codec needs frames of 8")
    for s in frame.signals:
        if not s.is_little_endian:
            raise SystemExit(f"{frame.name}.{s.name}: not little-endian, which the codec needs")
    values = [s for s in frame.signals if s.name not in ("Crc", "Counter")]
    data_id = int(frame.attributes.get("E2EDataId") or 0)
    bits = 32 if frame.arbitration_id.extended else 16
    cycle_us = frame.cycle_time * 1000
    lines = [f"/// {frame.comment}", f"struct {frame.name} {{",
             f'  static constexpr const char* name = "{frame.name}";',
             f"  static constexpr std::uint{bits}_t id = {frame.arbitration_id.id:#x};",
             f"  static constexpr std::uint32_t cycle_us = {cycle_us};  ///< 0: not cyclic"]
    if data_id:
        lines.append(f"  static constexpr std::uint16_t data_id = {data_id};")
    for s in values:
        lines += member_lines(s)
    return lines + pack_lines(frame, values, data_id) + visit_lines(values) + ["};", ""]


def main():
    source, target = sys.argv[1:3]
    namespace = "bms::can" + "".join("::" + word for word in sys.argv[3:])
    frames = load(source).frames
    with open(source, "rb") as dbc:
        sha256 = hashlib.sha256(dbc.read()).hexdigest()
    lines = [f"// Generated from {os.path.basename(source)} by ./bms messages. Do not edit.",
             f"// SHA-256 of that file: {sha256}", "#pragma once", ""]
    lines += [f"#include <{name}>" for name in ("array", "cstdint", "span", "tuple")]
    lines += ["", '#include "can/codec.hpp"', "", f"namespace {namespace} {{", ""]
    for frame in frames:
        lines += message(frame)
    names = ", ".join(f.name for f in frames)
    lines += ["/// All messages.", f"using Messages = std::tuple<{names}>;", "", f"}}  // namespace {namespace}", ""]
    text = "\n".join(lines)
    if os.path.exists(target) and open(target).read() == text:
        return
    with open(target, "w") as out:
        out.write(text)


main()
