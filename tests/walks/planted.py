#!/usr/bin/env python3
"""Whether a number that is not finite, planted in the tool's computation, ever leaves it as a result.

    planted.py TOOL LIBRARY

LIBRARY (planted_nan.cpp) is preloaded: functions of the mathematics library return NaN from one of their calls on. A
command then ends with exit status 3, or the number did not matter: its outputs are those of a run without it. Exit
status 1 if an output has such a number, if an answer changed without a word, if a command is ended by a signal, or if
one of NOTICES did not notice it."""
import os
import pathlib
import re
import subprocess
import sys
import tempfile

from finite import faults_of, write_inputs

FROM = (0, 3000)  # calls of the mathematics library before the first NaN
COMMANDS = {
    "replay": "replay in.csv --cell table9 --json out.json --report out.html --trace out.csv",
    "simulate": "simulate --cell table9 --recording in.csv --initial-soc 0.5 --json out.json --out out.csv",
    "diagnose": "diagnose --cell table9 --recording in.csv --initial-soc 0.5 --json out.json --out out.toml",
    "diagnose --pack": "diagnose --pack table9 --recording pack.csv --initial-soc 0.5 --json out.json",
    "identify": "identify --recording in.csv --start table9 --initial-soc 0.5 --json out.json --out out.toml",
    "ammeter": "ammeter in.csv --cell table9 --json out.json",
    "experiment": "experiment forklift_shift --out out.csv --json out.json",
    "cell scale": "cell scale table9 --capacity-ah 50 --out out.toml --json out.json",
}

NOTICES = ("replay", "simulate", "diagnose", "diagnose --pack", "identify", "ammeter")
VARIES = re.compile(r'"(wall_s|created|[a-z_]*_per_second)": *[^,}\n]*')  # from run to run
REPORT = re.compile(r"[0-9.]+ million steps/s")


def write_loads(folder):
    rows, pack = ["time_s,current_a,voltage_v"], ["time_s,current_a,v_1,v_2,v_3,v_4"]
    relaxing_v = 0
    for k in range(1200):
        a = -3 if k // 60 % 2 else 0.0
        relaxing_v += (0.015 * a - relaxing_v) / 20
        v = 3.3 + 0.02 * a + relaxing_v - 1e-5 * k + 1e-4 * (k % 3)
        rows.append(f"{k},{a},{v:.4f}")
        pack.append(f"{k},{a}," + ",".join(f"{v + 1e-3 * c + 1e-4 * ((k + c) % 5):.4f}" for c in range(4)))
    (folder / "in.csv").write_text("\n".join(rows) + "\n")
    (folder / "pack.csv").write_text("\n".join(pack) + "\n")


def outputs(folder):
    """The outputs by name, without what varies; a page has the values of the JSON."""
    return {path.name: VARIES.sub("", REPORT.sub("", path.read_text())) for path in folder.glob("out.*")
            if path.suffix != ".html"}


def run(tool, command, folder, environment, expected=None):
    """The exit status, what is wrong with the outputs, and the outputs. expected: those without the number."""
    for path in folder.glob("out.*"):
        path.unlink()
    try:
        done = subprocess.run([tool, *command.split()], cwd=folder, capture_output=True, text=True, timeout=300,
                              env=environment)
    except subprocess.TimeoutExpired:
        return None, ["does not end"], {}
    faults = [] if 0 <= done.returncode <= 3 else [f"ended by signal {-done.returncode}"]
    if done.returncode == 0:
        faults += [f"printed: {f}" for f in faults_of("", done.stdout)]
        for path in folder.glob("out.*"):
            faults += [f"{path.name}: {f}" for f in faults_of(path.name, path.read_text())]
        if expected is not None and outputs(folder) != expected:
            faults.append("the answer is another one, without a word")
    elif done.returncode == 3:
        faults += [f"{p.name} was left behind" for p in folder.glob("out.*") if faults_of(p.name, p.read_text())]
    return done.returncode, faults, outputs(folder)


def main():
    tool, library = (str(pathlib.Path(a).resolve()) for a in sys.argv[1:3])
    failed, noticed = 0, {}
    with tempfile.TemporaryDirectory(prefix="planted.") as name:
        folder = pathlib.Path(name)
        write_inputs(folder)
        write_loads(folder)
        for kind, command in COMMANDS.items():
            environment = dict(os.environ, BMS_PROGRESS="off")
            status, faults, expected = run(tool, command, folder, environment)
            if status != 0 or not expected or faults:
                print(f"bms {command}, without a planted number: exit status {status}, outputs {sorted(expected)}",
                      *faults, sep="\n    ", flush=True)
                return 1
            for call in FROM:
                environment = dict(environment, LD_PRELOAD=library, PLANT_FROM=str(call))
                status, faults, _ = run(tool, command, folder, environment, expected)
                noticed.setdefault(kind, []).append(status)
                failed += len(faults)
                for fault in faults:
                    print(f"bms {command} (from call {call}), exit status {status}\n    {fault}", flush=True)
    for kind, statuses in noticed.items():
        print(f"{kind}: exit status {statuses} with NaN from call {list(FROM)}")
    for kind in NOTICES:
        if noticed[kind] != [3] * len(FROM):
            print(f"{kind}: the planted number was not always noticed")
            failed += 1
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
