"""Writes the page firmware/can/messages.md from its template, the DBC files and the firmware's own frames (the JSON of
tests/firmware/vehicle_start.cpp on standard input). Needs python3-canmatrix.

    vehicle_start | dbc_page.py [--compare] IN.dbc J1939.dbc PAGE.md       template: PAGE.in.md

--compare: writes nothing; exit code 1 and one line if the page differs. The CRC of the example is computed here a
second time.
"""
import json
import os
import string
import sys

from dbc_file import load


def crc_by_division(data):
    """Divides the data times x^8 by x^8 + x^4 + x^3 + x^2 + 1 and returns what the division leaves."""
    value = int.from_bytes(data, "big") << 8
    for bit in range(value.bit_length() - 1, 7, -1):
        if value >> bit & 1:
            value ^= 0x11D << (bit - 8)
    return value


def plain(number):
    """At most nine digits, without an exponent."""
    text = f"{float(number):.9f}".rstrip("0").rstrip(".")
    return text or "0"


def cell(text):
    return " ".join((text or "").replace("|", "\\|").split())


def when(frame):
    if frame.cycle_time > 0:
        return f"{plain(frame.cycle_time)} ms"
    return "every sample" if "every sample" in (frame.comment or "") else "on occasion"


def row(*cells):
    return "| " + " | ".join(str(c) for c in cells) + " |"


def signal_row(signal):
    invalid = (signal.attributes.get("Invalid") or "").strip('"')
    meaning = cell(signal.comment)
    if signal.values:
        meaning += " " + ", ".join(f"{raw} {cell(str(text))}" for raw, text in sorted(signal.values.items()))
    return row(signal.name, signal.start_bit, signal.size, "signed" if signal.is_signed else "", plain(signal.factor),
               plain(signal.offset), f"{plain(signal.min)} to {plain(signal.max)}", signal.unit, invalid, meaning)


SIGNALS = ["", row("signal", "first bit", "length", "", "factor", "offset", "range", "unit", "not known (raw)",
                   "meaning").replace("|  |", "| |"), "|---|---|---|---|---|---|---|---|---|---|"]


def signal_table(signals):
    return SIGNALS + [signal_row(s) for s in sorted(signals, key=lambda s: s.start_bit)]


def profile(matrix):
    lines = []
    for f in sorted(matrix.frames, key=lambda f: -f.arbitration_id.id):
        if f.size != 8 or not f.arbitration_id.extended or any(not s.is_little_endian for s in f.signals):
            raise SystemExit(f"{f.name}: the page says that the profile has 29 bits, 8 bytes and is little-endian")
        lines += ["", f"### {f.name}", "", f"{f.arbitration_id.id:#010x}, {when(f)}. {cell(f.comment)}"]
        lines += signal_table(f.signals)
    return "\n".join(lines)


def as_the_page_says(frame):
    data_id = int(frame.attributes["E2EDataId"])
    return all(s.is_little_endian for s in frame.signals) and frame.size == 8 and data_id == frame.arbitration_id.id


def messages(matrix):
    frames = sorted(matrix.frames, key=lambda f: f.arbitration_id.id)
    lines = [row("id", "message", "from", "when", "what for"), "|---|---|---|---|---|"]
    for f in frames:
        lines.append(row(f"{f.arbitration_id.id:#05x}", f"[{f.name}](#{f.name.lower()})", ", ".join(f.transmitters),
                         when(f), cell(f.comment)))
    for f in frames:
        if not as_the_page_says(f):
            raise SystemExit(f"{f.name}: the page says that messages have 8 bytes, are little-endian and have their "
                             "identifier as data id")
        lines += ["", f"### {f.name}", "",
                  f"{f.arbitration_id.id:#05x}, from {', '.join(f.transmitters)}, {when(f)}. {cell(f.comment)}"]
        lines += signal_table(s for s in f.signals if s.name not in ("Crc", "Counter"))
    return "\n".join(lines)


def facts(firmware):
    """The values for the template, after a check of the firmware's example frame."""
    covered = bytes.fromhex(firmware["example_crc_over"])
    steps = [crc_by_division(covered[: k + 1]) for k in range(len(covered))]
    if steps[-1] != firmware["example_crc"] or firmware["example_bytes"].split()[0] != f"{steps[-1]:02X}":
        raise SystemExit(f"the firmware's CRC is {firmware['example_crc']:02X}, the definition's {steps[-1]:02X}")
    if not firmware["clear_too_early"]:
        raise SystemExit("a fault was cleared before its time, which the page excludes")
    return {**firmware, "example_id_hex": f"{firmware['example_id']:#05x}",
            "example_id_digits": f"{firmware['example_id']:03X}",
            "example_crc_steps": " ".join(f"{s:02X}" for s in steps), "stale_sample_ms": 300}


def main():
    compare = sys.argv[1] == "--compare"
    dbc, profile_dbc, page = sys.argv[2 if compare else 1 :]
    with open(page.removesuffix(".md") + ".in.md") as file:
        template = string.Template(file.read())
    text = template.substitute(facts(json.load(sys.stdin)), messages=messages(load(dbc)),
                               profile=profile(load(profile_dbc))).rstrip("\n") + "\n"
    if compare:
        if not os.path.exists(page) or open(page).read() != text:
            raise SystemExit(f"{page} differs from the DBC file or the firmware: write it again with ./bms messages")
        return
    with open(page, "w") as out:
        out.write(text)


main()
