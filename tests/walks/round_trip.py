#!/usr/bin/env python3
"""Whether what one command writes is read by every other: cell files with random mechanisms.

    round_trip.py TOOL EXTENDED_CELLS [--first SEED] [--count N] [--diagnosed N]

EXTENDED_CELLS (extended_cells.cpp) writes a file. If it is possible, every command reads it, and the files that they
write are read again: simulate, replay, check, show, plot, header, ammeter, and for some of them a diagnosis whose cell
file goes the same way. If it is impossible, every command refuses it with the same line. Exit status 1 if one differs.
"""
import argparse
import os
import pathlib
import re
import subprocess
import sys
import tempfile

from finite import faults_of

ROOT = pathlib.Path(__file__).resolve().parents[2]
READERS = ("cell show {c} --json show.json", "cell plot {c} --report plot.html", "cell header {c} --out h.hpp",
           "cell scale {c} --capacity-ah 50 --out scaled.toml",
           "simulate --cell {c} --recording hour.csv --initial-soc 0.8 --noise-v 0.0005 --out s.csv --json s.json",
           "replay s.csv --cell {c} --initial-soc 0.8 --json r.json --trace t.csv --report r.html",
           "replay s.csv --cell {c} --scalar double --json r.json", "cell check scaled.toml",
           "simulate --cell scaled.toml --recording hour.csv --initial-soc 0.8 --out x.csv")
DIAGNOSES = "diagnose --cell {c} --recording s.csv --initial-soc 0.8 --out {to} --json d.json --report d.html"
CANNOT_DELIVER = "expected a current that the cell can deliver"
NO_FIRMWARE = "cell header"  # may say no: not every mechanism is computed on a board


class Trip:
    def __init__(self, tool, folder):
        self.tool, self.folder, self.faults, self.ran = tool, folder, [], 0

    def run(self, command):
        environment = dict(os.environ, BMS_PROGRESS="off")
        done = subprocess.run([self.tool, *command.split()], cwd=self.folder, capture_output=True, text=True,
                              timeout=900, env=environment)
        self.ran += 1
        return done.returncode, done.stdout, done.stderr

    def fails(self, what):
        self.faults.append(what)

    def reads(self, cell, command):
        command = command.format(c=cell)
        status, printed, errors = self.run(command)
        if status == 2 and CANNOT_DELIVER in errors:
            return CANNOT_DELIVER
        if status != 0 and not (command.startswith(NO_FIRMWARE) and status == 2):
            return self.fails(f"bms {command}: exit status {status}: {errors.strip()[-300:]}")
        for fault in faults_of("", printed):
            self.fails(f"bms {command}: printed {fault}")
        for path in sorted(self.folder.iterdir()):
            if path.suffix in (".json", ".html", ".toml", ".hpp") or path.name in ("s.csv", "t.csv"):
                for fault in faults_of(path.name, path.read_text()):
                    self.fails(f"bms {command}: {path.name}: {fault}")
        return None

    def all_read(self, cell):
        status, _, errors = self.run(f"cell check {cell}")
        if status == 2:  # impossible: everyone says so
            said = re.sub(r"^[^:]*:", "", errors.strip().splitlines()[-1])
            for command in READERS[:6]:
                other, _, text = self.run(command.format(c=cell))
                if other != 2 or said not in text:
                    self.fails(f"cell check refuses it ({said}), but bms {command}: {other} {text.strip()[-200:]}")
            return False
        if status not in (0, 1):
            self.fails(f"bms cell check: exit status {status}: {errors.strip()[-300:]}")
        for command in READERS:
            if self.reads(cell, command) == CANNOT_DELIVER:
                break  # a sensor so wrong that no cell has this current: nothing is written
        return True


def hour():
    """The first hour of the shift, a row every five seconds."""
    lines = (ROOT / "evidence/recordings/forklift_shift.csv").read_text().splitlines()
    rows = [line for line in lines if not line.startswith("#")]
    return "\n".join(rows[:1] + rows[1:3601:5]) + "\n"


def trip(tool, cells, seed, diagnosed):
    with tempfile.TemporaryDirectory(prefix="round_trip.") as name:
        folder = pathlib.Path(name)
        (folder / "hour.csv").write_text(hour())
        mechanisms = subprocess.run([cells, str(seed), "c.toml"], cwd=folder, capture_output=True, text=True,
                                    check=True).stdout.strip()
        t = Trip(tool, folder)
        possible = t.all_read("c.toml")
        if possible and diagnosed and not t.faults:
            if (folder / "s.csv").exists():
                t.reads("c.toml", DIAGNOSES.replace("{to}", "d.toml"))
            if (folder / "d.toml").exists():
                if not t.all_read("d.toml"):
                    t.fails("diagnose wrote a file that cell check refuses")
                t.reads("d.toml", DIAGNOSES.replace("{to}", "again.toml"))
        print(f"{seed}: {mechanisms}: {'possible' if possible else 'impossible'}, {t.ran} commands"
              + "".join("\n  FAILED " + fault for fault in t.faults), flush=True)
        return possible, len(t.faults)


def main():
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("tool")
    options.add_argument("cells")
    options.add_argument("--first", type=int, default=1)
    options.add_argument("--count", type=int, default=12)
    options.add_argument("--diagnosed", type=int, default=2)
    o = options.parse_args()
    tool, cells = (str(pathlib.Path(p).resolve()) for p in (o.tool, o.cells))
    possible, failed, diagnosed = 0, 0, 0
    for seed in range(o.first, o.first + o.count):
        is_possible, faults = trip(tool, cells, seed, diagnosed < o.diagnosed)
        possible, failed, diagnosed = possible + is_possible, failed + faults, diagnosed + is_possible
    print(f"{o.count} cell files, {possible} possible, {min(diagnosed, o.diagnosed)} diagnosed: {failed} faults")
    if 2 * possible < o.count:
        print("fewer than half of the files are possible: the test says little")
        failed += 1
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
