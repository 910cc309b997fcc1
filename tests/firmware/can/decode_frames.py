"""Decodes the frames of random_frames with canmatrix and the DBC file, and compares the values with the input.

    random_frames SEED COUNT [j1939] | decode_frames.py DBC

The CRC is computed here a second time, bit by bit, by polynomial division. Exit code 1 if a frame is wrong or a message
is missing.
"""
import contextlib
import json
import os
import sys


def load(path):
    with open(os.devnull, "w") as nowhere, contextlib.redirect_stdout(nowhere), contextlib.redirect_stderr(nowhere):
        import canmatrix.formats

        return canmatrix.formats.loadp_flat(path)


def crc_by_division(data):
    """Divides the data times x^8 by x^8 + x^4 + x^3 + x^2 + 1 and returns what the division leaves."""
    value = int.from_bytes(data, "big") << 8
    for bit in range(value.bit_length() - 1, 7, -1):
        if value >> bit & 1:
            value ^= 0x11D << (bit - 8)
    return value


def protection_problems(frame, data, decoded, counter):
    """Checks CRC and counter, or the unused bits of a message without protection."""
    data_id = int(frame.attributes.get("E2EDataId") or 0)
    if not data_id:
        used = sum(((1 << s.size) - 1) << s.start_bit for s in frame.signals)
        return [] if used | int.from_bytes(data, "little") == (1 << 64) - 1 else ["an unused bit is 0"]
    problems = []
    if int(decoded["Crc"].raw_value) != crc_by_division(bytes([data_id & 255, data_id >> 8]) + data[1:]):
        problems.append("Crc")
    if int(decoded["Counter"].raw_value) != counter:
        problems.append("Counter")
    return problems


def is_right(signal, decoded, value):
    """Compares a decoded signal with the input value; None means not known."""
    raw, physical = int(decoded.raw_value), float(decoded.phys_value)
    invalid = (signal.attributes.get("Invalid") or "").strip('"')
    if value is None:
        return invalid != "" and raw == int(invalid)
    # half a step, plus the rounding of a float of that size
    close = abs(physical - value) <= 0.5 * float(signal.factor) * 1.02 + 1e-6 * abs(value)
    in_range = float(signal.min) - 1e-9 <= physical <= float(signal.max) + 1e-9
    return close and in_range and (invalid == "" or raw != int(invalid))


def frame_problems(frame, given):
    data = bytes.fromhex(given["data"])
    decoded = frame.decode(data)
    problems = protection_problems(frame, data, decoded, given["counter"])
    unnamed = {"Crc", "Counter"} if int(frame.attributes.get("E2EDataId") or 0) else set()
    if set(given["values"]) | unnamed != {s.name for s in frame.signals}:
        problems.append("signals")
    for name, value in given["values"].items():
        signal = next(s for s in frame.signals if s.name == name)
        if not is_right(signal, decoded[name], value):
            problems.append(f"{name}: {value} in, {decoded[name].phys_value} ({decoded[name].raw_value}) out")
    return problems


def main():
    frames = {f.arbitration_id.id: f for f in load(sys.argv[1]).frames}
    checked = wrong = unknown = 0
    seen = set()
    for line in sys.stdin:
        given = json.loads(line)
        frame = frames[given["id"]]
        seen.add(given["id"])
        checked += len(given["values"])
        unknown += sum(value is None for value in given["values"].values())
        problems = frame_problems(frame, given)
        if problems:
            wrong += 1
            print(frame.name, given["data"], problems)
    missing = set(frames) - seen
    print(f"{checked} values of {len(seen)} messages, {unknown} of them not known, {wrong} frames wrong, "
          f"{len(missing)} messages missing")
    return 1 if wrong or missing or checked < 1000 or unknown < 50 else 0


sys.exit(main())
