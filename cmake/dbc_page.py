"""DBC file and what the firmware does (tests/firmware/vehicle_start.cpp, JSON on standard input) -> the page can/messages.md, by the template beside it.

    vehicle_start | dbc_page.py [--compare] IN.dbc J1939.dbc PAGE.md       template: PAGE.in.md

--compare: writes nothing; exit code 1 and one line when the page is another one. The CRC of the example is computed here a second time. Needs python3-canmatrix.
"""
import json
import os
import string
import sys

from dbc_file import load


def remainder(data):
    """Of the message's polynomial times x^8, divided by x^8 + x^4 + x^3 + x^2 + 1."""
    value = int.from_bytes(data, "big") << 8
    for bit in range(value.bit_length() - 1, 7, -1):
        if value >> bit & 1:
            value ^= 0x11D << (bit - 8)
    return value


def plain(number):
    """At most nine digits, no exponent."""
    text = f"{float(number):.9f}".rstrip("0").rstrip(".")
    return text or "0"


def cell(text):
    return " ".join((text or "").replace("|", "\\|").split())


def when(frame):
    if frame.cycle_time > 0:
        return f"{plain(frame.cycle_time)} ms"
    return "every sample" if "every sample" in (frame.comment or "") else "on occasion"


def signal_row(signal):
    invalid = (signal.attributes.get("Invalid") or "").strip('"')
    meaning = cell(signal.comment)
    if signal.values:
        meaning += " " + ", ".join(f"{raw} {cell(str(text))}" for raw, text in sorted(signal.values.items()))
    return f"| {signal.name} | {signal.start_bit} | {signal.size} | {'signed' if signal.is_signed else ''} | {plain(signal.factor)} | {plain(signal.offset)} | {plain(signal.min)} to {plain(signal.max)} | {signal.unit} | {invalid} | {meaning} |"


SIGNALS = ["", "| signal | first bit | length | | factor | offset | range | unit | not known (raw) | meaning |", "|---|---|---|---|---|---|---|---|---|---|"]


def profile(matrix):
    lines = []
    for f in sorted(matrix.frames, key=lambda f: -f.arbitration_id.id):
        if f.size != 8 or not f.arbitration_id.extended or any(not s.is_little_endian for s in f.signals):
            raise SystemExit(f"{f.name}: not as the page says of the profile: 29 bits, 8 bytes, little-endian")
        lines += ["", f"### {f.name}", "", f"{f.arbitration_id.id:#010x}, {when(f)}. {cell(f.comment)}"] + SIGNALS + [signal_row(s) for s in sorted(f.signals, key=lambda s: s.start_bit)]
    return "\n".join(lines)


def messages(matrix):
    frames = sorted(matrix.frames, key=lambda f: f.arbitration_id.id)
    lines = ["| id | message | from | when | what for |", "|---|---|---|---|---|"]
    lines += [f"| {f.arbitration_id.id:#05x} | [{f.name}](#{f.name.lower()}) | {', '.join(f.transmitters)} | {when(f)} | {cell(f.comment)} |" for f in frames]
    for f in frames:
        if any(not s.is_little_endian for s in f.signals) or f.size != 8 or int(f.attributes["E2EDataId"]) != f.arbitration_id.id:
            raise SystemExit(f"{f.name}: not as the page says of all messages: little-endian, 8 bytes, its id the data id")
        lines += ["", f"### {f.name}", "", f"{f.arbitration_id.id:#05x}, from {', '.join(f.transmitters)}, {when(f)}. {cell(f.comment)}"] + SIGNALS
        lines += [signal_row(s) for s in sorted(f.signals, key=lambda s: s.start_bit) if s.name not in ("Crc", "Counter")]
    return "\n".join(lines)


def facts(said):
    covered = bytes.fromhex(said["example_crc_over"])
    steps = [remainder(covered[: k + 1]) for k in range(len(covered))]
    if steps[-1] != said["example_crc"] or said["example_bytes"].split()[0] != f"{steps[-1]:02X}":
        raise SystemExit(f"the firmware's CRC is {said['example_crc']:02X}, the definition's {steps[-1]:02X}")
    if not said["clear_too_early"]:
        raise SystemExit("a fault went by a clear before its time, which the page says it does not")
    return {**said, "example_id_hex": f"{said['example_id']:#05x}", "example_id_digits": f"{said['example_id']:03X}", "example_crc_steps": " ".join(f"{s:02X}" for s in steps), "stale_sample_ms": 300}


def main():
    compare = sys.argv[1] == "--compare"
    dbc, profile_dbc, page = sys.argv[2 if compare else 1 :]
    with open(page.removesuffix(".md") + ".in.md") as template:
        text = string.Template(template.read()).substitute(facts(json.load(sys.stdin)), messages=messages(load(dbc)), profile=profile(load(profile_dbc))).rstrip("\n") + "\n"
    if compare:
        if not os.path.exists(page) or open(page).read() != text:
            raise SystemExit(f"{page} is not what the DBC file and the firmware say: ./bms messages writes it anew")
        return
    with open(page, "w") as out:
        out.write(text)


main()
