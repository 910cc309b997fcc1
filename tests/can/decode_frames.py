"""Frames of random_frames, decoded by canmatrix from the DBC file, must say what went in.

    random_frames SEED COUNT [j1939] | decode_frames.py DBC

The CRC is computed here a second time, bit by bit, by the polynomial's division.
"""
import contextlib
import json
import os
import sys

with open(os.devnull, "w") as nowhere, contextlib.redirect_stdout(nowhere), contextlib.redirect_stderr(nowhere):
    import canmatrix.formats

    matrix = canmatrix.formats.loadp_flat(sys.argv[1])
frames = {f.arbitration_id.id: f for f in matrix.frames}


def remainder(data):
    """Of the message's polynomial times x^8, divided by x^8 + x^4 + x^3 + x^2 + 1."""
    value = int.from_bytes(data, "big") << 8
    for bit in range(value.bit_length() - 1, 7, -1):
        if value >> bit & 1:
            value ^= 0x11D << (bit - 8)
    return value


checked = wrong = unknown = 0
seen = set()
for line in sys.stdin:
    said = json.loads(line)
    frame, data = frames[said["id"]], bytes.fromhex(said["data"])
    seen.add(said["id"])
    decoded = frame.decode(data)
    identity = int(frame.attributes.get("E2EDataId") or 0)
    problems = []
    if identity:
        if int(decoded["Crc"].raw_value) != remainder(bytes([identity & 255, identity >> 8]) + data[1:]):
            problems.append("Crc")
        if int(decoded["Counter"].raw_value) != said["counter"]:
            problems.append("Counter")
    elif (used := sum(((1 << s.size) - 1) << s.start_bit for s in frame.signals)) | int.from_bytes(data, "little") != (1 << 64) - 1:
        problems.append("a bit of no signal is 0")
    if set(said["values"]) | ({"Crc", "Counter"} if identity else set()) != {s.name for s in frame.signals}:
        problems.append("signals")
    for name, value in said["values"].items():
        signal = next(s for s in frame.signals if s.name == name)
        raw, physical = int(decoded[name].raw_value), float(decoded[name].phys_value)
        invalid = (signal.attributes.get("Invalid") or "").strip('"')
        if value is None:
            unknown += 1
            good = invalid != "" and raw == int(invalid)
        else:
            # half a step, and what a float of that size leaves
            good = abs(physical - value) <= 0.5 * float(signal.factor) * 1.02 + 1e-6 * abs(value) and (invalid == "" or raw != int(invalid))
            good = good and float(signal.min) - 1e-9 <= physical <= float(signal.max) + 1e-9
        checked += 1
        if not good:
            problems.append(f"{name}: {value} in, {physical} ({raw}) out")
    if problems:
        wrong += 1
        print(frame.name, said["data"], problems)
missing = set(frames) - seen
print(f"{checked} values of {len(seen)} messages, {unknown} of them not known, {wrong} frames wrong, {len(missing)} messages missing")
sys.exit(1 if wrong or missing or checked < 1000 or unknown < 50 else 0)
