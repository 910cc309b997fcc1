"""Compares the frames of a candump log, decoded by canmatrix, with the output of bms monitor for the same bus.

    compare_with_canmatrix.py DBC candump.log rows.csv monitor.json

At each Status frame the last received values must equal those of the monitor's row. A field must be empty if its last
frame is older than three cycle times, or 3 s without a cycle time. At the end the values must equal those of the JSON.
Prints what was compared. Exit code 1: a value differs.
"""
import contextlib
import csv
import json
import math
import os
import sys

with open(os.devnull, "w") as nowhere, contextlib.redirect_stdout(nowhere), contextlib.redirect_stderr(nowhere):
    import canmatrix.formats

    matrix = canmatrix.formats.loadp_flat(sys.argv[1])
frames = {f.arbitration_id.id: f for f in matrix.frames}
rows = list(csv.DictReader(open(sys.argv[3])))
report = json.load(open(sys.argv[4]))


def values_of(frame, data):
    decoded = frame.decode(data)
    values = {}
    for signal in frame.signals:
        if signal.name in ("Crc", "Counter"):
            continue
        invalid = (signal.attributes.get("Invalid") or "").strip('"')
        raw = int(decoded[signal.name].raw_value)
        values[signal.name] = None if invalid != "" and raw == int(invalid) else float(decoded[signal.name].phys_value)
    return values


def same(text, value):
    if text in ("", None) or value is None:
        return text in ("", None) and value is None
    return math.isclose(float(text), value, rel_tol=1e-12, abs_tol=1e-12)


received, received_us, count, at, compared, problems = {}, {}, {}, 0, 0, []
for line in open(sys.argv[2]):
    identity, data = line.split()[2].split("#")
    frame = frames.get(int(identity, 16))
    if frame is None:
        continue
    received[frame.name] = values_of(frame, bytes.fromhex(data))
    now_us = int(line[1:line.index(")")].replace(".", ""))
    received_us[frame.name] = now_us
    count[frame.name] = count.get(frame.name, 0) + 1
    if frame.name != "Status":
        continue
    if at >= len(rows):
        problems.append("more Status frames than rows")
        break
    for name, values in received.items():
        sender = next(f for f in frames.values() if f.name == name)
        stale = now_us - received_us[name] > (3_000 * sender.cycle_time or 3_000_000)
        for signal in sender.signals:
            if signal.name in values:
                column = f"{name}.{signal.name}" + (f" [{signal.unit}]" if signal.unit else "")
                compared += 1
                if not same(rows[at][column], None if stale else values[signal.name]):
                    problems.append(f"row {at}, {column}: {rows[at][column]!r} in the CSV, "
                                    f"{values[signal.name]} by canmatrix")
    at += 1
if at != len(rows):
    problems.append(f"{at} Status frames, {len(rows)} rows")
for name, values in received.items():
    message = report["messages"][name]
    if message["frames"] != count[name]:
        problems.append(f"{name}: {message['frames']} frames in the JSON, {count[name]} in candump's log")
    for signal, value in values.items():
        compared += 1
        if not same(message["signals"][signal]["value"], value):
            in_json = message["signals"][signal]["value"]
            problems.append(f"{name}.{signal}: {in_json} in the JSON, {value} by canmatrix")
print(f"{at} samples, {sum(count.values())} frames of {len(count)} messages, {compared} values, "
      f"{len(problems)} problems")
print("\n".join(problems[:20]))
sys.exit(1 if problems or at == 0 else 0)
