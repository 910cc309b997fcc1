#!/usr/bin/env python3
"""Makes a drive at -25 degrees C from two real ones, and replays it.

No recording is that cold. dyn10 is one profile at -5 and at -15 degrees C: the overpotential of the colder drive grows
once more by the factor by which it grew there, at each state of charge. No law of the model is used. The drive ends
where the voltage stays below that of an empty cell.

  colder_drive.py TOOL DATA FOLDER CELL...

TOOL: bms. DATA: folder of the recordings. FOLDER: for the drive. CELL: cell files; prints a row of the table 'Colder
than any recording' of docs/figures/soc_trials.md for each.
"""
import bisect
import csv
import json
import pathlib
import subprocess
import sys

BINS = 50  # of the state of charge
LEAST_ROWS = 20  # of a bin under load
LOAD_A, LEAST_V, EMPTY_V, EMPTY_ROWS = -0.5, 0.005, 2.0, 5


def rows_of(path):
    with open(path, newline="", encoding="utf-8") as file:
        return [{name: float(value or "nan") for name, value in row.items()} for row in csv.DictReader(file)]


def ocv_of(slow_discharge):
    """Voltage of the slow discharge at 25 degrees C as a function of the state of charge."""
    points = sorted((row["soc_ref"], row["voltage_v"]) for row in slow_discharge)
    socs = [soc for soc, _ in points]

    def ocv_v(soc):
        right = min(max(bisect.bisect_left(socs, soc), 1), len(socs) - 1)
        (s0, v0), (s1, v1) = points[right - 1], points[right]
        return v0 if s1 == s0 else v0 + (v1 - v0) * (soc - s0) / (s1 - s0)

    return ocv_v


def mean_overpotential(drive, ocv_v):
    """By bin of the state of charge under load; None where the drive has too little of it."""
    sums = [(0, 0.0)] * (BINS + 1)
    for row in drive:
        if row["current_a"] < LOAD_A:
            k = round(BINS * min(max(row["soc_ref"], 0), 1))
            sums[k] = (sums[k][0] + 1, sums[k][1] + ocv_v(row["soc_ref"]) - row["voltage_v"])
    return [total / count if count > LEAST_ROWS else None for count, total in sums]


def growth(warmer, colder):
    """Factor by bin: of the nearest bin that has one, averaged over five."""
    known = {k: c / w for k, (w, c) in enumerate(zip(warmer, colder)) if w and c and w > LEAST_V}
    nearest = [known[min(known, key=lambda j, at=k: abs(j - at))] for k in range(BINS + 1)]
    windows = [nearest[max(0, k - 2):k + 3] for k in range(BINS + 1)]
    return [sum(window) / len(window) for window in windows]


def colder_drive(data):
    folder = data / "a123_26650"
    ocv_v = ocv_of(rows_of(folder / "ocv_P25_dis.csv"))
    warmer, colder = (rows_of(folder / f"dyn10_{name}_A002.csv") for name in ("N05", "N15"))
    factors = growth(mean_overpotential(warmer, ocv_v), mean_overpotential(colder, ocv_v))
    made, empty = [], 0
    for row in colder:
        at = BINS * min(max(row["soc_ref"], 0), 1)
        k = min(BINS - 1, int(at))
        factor = factors[k] + (factors[k + 1] - factors[k]) * (at - k)
        rested_v = ocv_v(row["soc_ref"])
        voltage_v = rested_v - (rested_v - row["voltage_v"]) * factor
        empty = empty + 1 if voltage_v < EMPTY_V else 0
        if empty > EMPTY_ROWS:
            break
        made.append({**row, "voltage_v": round(voltage_v, 5), "temperature_c": -25})
    return made


def replayed(tool, recording, cell, folder, *start):
    out = folder / "colder.json"
    command = [tool, "replay", recording, "--cell", cell, "--json", out, "--quiet", *start]
    done = subprocess.run([str(c) for c in command], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        sys.exit(f"{' '.join(map(str, command))}\n{done.stderr}")
    soc = json.loads(out.read_text())["soc"]
    return (f"{100 * soc['rmse']:.2f}, {100 * soc['max_error']:.1f} ({100 * soc['within_2_sigma']:.0f}) | "
            f"{100 * soc['final_sigma']:.1f}")


def main():
    tool, data, folder = (pathlib.Path(a) for a in sys.argv[1:4])
    folder.mkdir(parents=True, exist_ok=True)
    drive = colder_drive(data)
    recording = folder / "dyn10_N25_made.csv"
    with open(recording, "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, drive[0])
        writer.writeheader()
        writer.writerows(drive)
    print("| file | right | sigma at the end, % | by itself | sigma at the end, % |\n|---|---|---|---|---|")
    for cell in sys.argv[4:]:
        right = replayed(tool, recording, cell, folder, "--initial-soc", "1", "--initial-soc-sigma", "0.02")
        print(f"| {pathlib.Path(cell).stem} | {right} | {replayed(tool, recording, cell, folder)} |", flush=True)


if __name__ == "__main__":
    main()
