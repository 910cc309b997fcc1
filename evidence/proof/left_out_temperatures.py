#!/usr/bin/env python3
"""Predicts drives at a temperature from recordings at other temperatures.

For each temperature of two sets of recordings a cell file is identified without any recording of that temperature
(bms identify --extend), then the drive of that temperature is simulated open loop and replayed. A second file knows the
slow runs of that temperature, which give its OCV, but no drive. Prints the table 'Temperatures left out' of
docs/figures/soc_trials.md.

  left_out_temperatures.py TOOL DATA FOLDER [SET:TEMPERATURE ...]

TOOL: bms. DATA: folder of the recordings. FOLDER: for cell files and traces; what is there is used again.
"""
import csv
import math
import pathlib
import subprocess
import sys

# drives and other recordings by temperature in degrees C
SETS = {
    "a123_26650": {
        "ocv": (-15, -5, 5, 15, 25, 35, 45),
        "drives": {-15: "dyn10_N15_A002", -5: "dyn10_N05_A002", 5: "dyn10_P05_A002", 15: "dyn10_P15_A002",
                   25: "dyn20_P25_A002", 45: "dyn10_P45_A002"},
        "more": {25: ("pulse_P25_A002", "cccv2C_P25_A002")},
        "left_out": (-15, -5, 5, 15, 45),
    },
    "a123_esctoolbox": {
        "ocv": (-5, 5, 25, 45),
        "drives": {-5: "dyn30_N05", 5: "dyn45_P05", 25: "dyn50_P25"},
        "more": {},
        "left_out": (-5, 5, 25),
    },
}
SOC_RANGE = (0.10, 0.95)


def name_of(temperature):
    return f"{'N' if temperature < 0 else 'P'}{abs(temperature):02d}"


def run(*command):
    done = subprocess.run([str(c) for c in command], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        sys.exit(f"{' '.join(map(str, command))}\n{done.stderr}")


def columns(path, *names):
    with open(path, newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    return [[float(row[name] or "nan") for row in rows] for name in names]


def identified(tool, data, folder, name, left_out, with_slow_runs=False):
    """Path of the cell file identified without the temperature, or only without its drive."""
    what = "drive_" if with_slow_runs else ""
    cell = folder / f"{name}_without_{what}{name_of(left_out)}.toml"
    if cell.exists():
        return cell
    a_set = SETS[name]
    ocv = [data / name / f"ocv_{name_of(t)}_{way}.csv" for t in a_set["ocv"] if with_slow_runs or t != left_out
           for way in ("chg", "dis")]
    drives = [data / name / f"{drive}.csv" for t, drive in a_set["drives"].items() if t != left_out]
    more = [data / name / f"{m}.csv" for t, names in a_set["more"].items() if t != left_out for m in names]
    run(tool, "identify", "--extend", "--no-healthy", "--ocv", *ocv, "--recording", *drives, *more, "--start",
        "a123_26650", "--name", cell.stem, "--out", cell, "--quiet")
    return cell


def open_loop_mv(tool, cell, recording, folder):
    """RMS of the voltage's error in mV between the limits of SOC_RANGE."""
    out = folder / f"{cell.stem}_simulated.csv"
    run(tool, "simulate", "--cell", cell, "--recording", recording, "--out", out, "--quiet")
    (simulated,) = columns(out, "voltage_v")
    measured, soc = columns(recording, "voltage_v", "soc_ref")
    squares = [(a - b) ** 2 for a, b, s in zip(simulated, measured, soc) if SOC_RANGE[0] <= s <= SOC_RANGE[1]]
    return 1e3 * math.sqrt(sum(squares) / len(squares))


def estimate(tool, cell, recording, truth, folder, *start):
    """RMSE of the SOC, the share inside two sigma and the median of sigma, all in %."""
    out = folder / f"{cell.stem}_{len(start)}.csv"
    run(tool, "replay", recording, "--cell", cell, "--trace", out, "--quiet", *start)
    soc, sigma = columns(out, "soc", "soc_sigma")
    errors = [a - b for a, b in zip(soc, truth)]
    inside = sum(abs(e) <= 2 * s for e, s in zip(errors, sigma)) / len(errors)
    return (100 * math.sqrt(sum(e * e for e in errors) / len(errors)), 100 * inside,
            100 * sorted(sigma)[len(sigma) // 2])


def row(tool, data, folder, name, left_out):
    recording = data / name / f"{SETS[name]['drives'][left_out]}.csv"
    cell = identified(tool, data, folder, name, left_out)
    (truth,) = columns(recording, "soc_ref")
    right = estimate(tool, cell, recording, truth, folder, "--initial-soc", truth[0])
    alone = estimate(tool, cell, recording, truth, folder)
    with_ocv = identified(tool, data, folder, name, left_out, with_slow_runs=True)
    return (f"| {name} | {left_out} | {open_loop_mv(tool, cell, recording, folder):.1f} | "
            f"{open_loop_mv(tool, with_ocv, recording, folder):.1f} | {right[0]:.2f} | "
            f"{right[1]:.0f} | {right[2]:.2f} | {alone[0]:.2f} | {alone[1]:.0f} |")


def main():
    tool, data, folder = (pathlib.Path(a) for a in sys.argv[1:4])
    folder.mkdir(parents=True, exist_ok=True)
    wanted = sys.argv[4:]
    print("| set | temperature left out, °C | open loop, mV | with its slow runs, mV | SOC RMSE, started right, % | "
          "inside two sigma, % | median sigma, % | SOC RMSE, started by itself, % | inside two sigma, % |\n"
          "|---|---|---|---|---|---|---|---|---|")
    for name, a_set in SETS.items():
        for left_out in a_set["left_out"]:
            if not wanted or f"{name}:{left_out}" in wanted:
                print(row(tool, data, folder, name, left_out), flush=True)


if __name__ == "__main__":
    main()
