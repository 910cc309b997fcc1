#!/usr/bin/env python3
"""Whether the walks would notice: each finding's expectations against the answers of an earlier version that had it.

    breaches.py

The walks run without the tool: a command gets its recorded answer, or an empty one. Exit status 1 if an expectation
holds for an answer that it is there to refuse."""
import json
import re
import sys

import walks
from walk import Walk

# finding: [(command, exit status, output, files)], and [(command, expectation that must fail)]
MONDAY = "diagnose --cell table9 --recording monday.csv --holdout tuesday.csv"
SMALL = "diagnose --cell a123_26650_extended"
FINDINGS = {
    "diagnose and simulate start a hysteresis apart": (
        [(SMALL, 0, "NO_MISMATCH: The cell file reproduces the recording to 6.0 mV, which is within its tolerance.",
          {"d.json": json.dumps({"baseline": {"recording": {"rmse_v": 0.006}}})})],
        [(SMALL, "the same of diagnose")]),
    "the start of the recording is used for the hold-out": (
        [(MONDAY, 0, "CAUSE: The cell loses 250 +- 33 mA. On the hold-out recordings: 276.50 mV RMS before, 281.69 mV "
          "after; the 95 % interval contains 0.0 % of the readings",
          {"r.json": json.dumps({"holdouts": [{"initial_soc": 0.98}], "coverage": {"holdout": 0.0}})})],
        [(MONDAY, "the start of the hold-out"), (MONDAY, "readings of the hold-out in its interval")]),
    "ammeter blames the sensor for a leakage": (
        [("ammeter", 0, "The current sensor reads 228 mA +- 48 mA too high.\n"
          "this firmware: bms service can0 current-offset --value -227620 --key FILE", {})],
        [("ammeter", "charge balance is short"), ("ammeter", "leakage"),
         ("ammeter", "does not see `current-offset")]),
    "NO_MISMATCH while the hold-out contradicts": (
        [("later.csv --holdout now.csv", 0, "NO_MISMATCH: The cell file reproduces the recording to 1.0 mV, which is "
          "within its tolerance. No action is needed.", {})],
        [("--holdout now.csv", "But the prediction"), ("--holdout now.csv", "Diagnose both together")]),
    "a wrong start gives false causes": (
        [("healthy.csv --initial-soc 0.3", 0, "CAUSES: The model is off by 72.7 mV. Two causes together explain 98 % "
          "of it: the current sensor reads 652 +- 35 mA too low (53.8 mV) and the open-circuit voltage depends on "
          "whether the cell was charged or discharged last, by 67 +- 29 mV", {})],
        [("--initial-soc 0.3", "is contradicted"), ("--initial-soc 0.3", "sees `CAUSE: ")]),
    "readings that are not available become numbers": (
        [("import truck.log", 0, "", {"truck.csv": "time_s,current_a,v_3\n200,0,8.191\n"}),
         ("--recording truck.log", 0, "UNKNOWN: Cell 3 differs from its neighbours by 473.3 mV RMS", {})],
        [("import truck.log", "no cell reads 8.191 V"), ("--recording truck.log", "differs from its neighbours")]),
    "a missing cell is drawn at -2147 V": (
        [("--report loop.html", 0, "", {"loop.html": '"lowest, V":[3.31,-2147.483648,3.3]'})],
        [("--report loop.html", "a missing cell is missing")]),
    "limits of a pack that cannot be": (
        [("--recording good.csv", 0, "Smallest sizes that would be named: charge_imbalance 135608.6 %, leakage "
          "26521876.72 % a day, voltage_offset 665.0 mV", {})],
        [("--recording good.csv", "does not see `\\[0-9\\]\\{4,\\}")]),
    "a battery's own log cannot be read": (
        [("import truck.log", 2, "truck.log:1: a log of CAN frames, expected --dbc ... and --map", {}),
         ("--recording truck.log", 2, "truck.log:1: a log of CAN frames, expected --dbc ... and --map", {}),
         ("monitor file:", 0, "", {"monitor.csv": "time_s,CellVoltages1.Cell1 [V]\n1,3.3\n"}),
         ("--recording monitor.csv", 2, "monitor.csv:1: 0 columns of cell voltages, expected v_1 to v_N", {})],
        [("import truck.log", "exit status 0"), ("--recording truck.log", "exit status 0"),
         ("monitor file:", "the columns of a recording"), ("--recording monitor.csv", "exit status 0")]),
    "the same file as recording and hold-out": (
        [("--holdout monday.csv", 0, "CAUSE: ... the 95 % interval contains 100.0 % of the readings", {})],
        [("--holdout monday.csv", "exit status 2"), ("--holdout monday.csv", "the same readings")]),
    "the output of simulate warns in the next command": (
        [(MONDAY, 0, "warning: monday.csv: columns not used: 'soc'", {})],
        [(MONDAY, "does not see `not used")]),
    "information is called a warning": (
        [(MONDAY, 0, "warning: tuesday.csv: starts at the first value of soc_ref, 50.0 %", {})],
        [(MONDAY, "does not see `warning: ")]),
    "import writes millivolts unrounded": (
        [("import tester.csv", 0, "", {"recording.csv": "time_s,current_a,voltage_v\n0,0,3.2880000000000003\n"})],
        [("import tester.csv", "numbers like 3.446")]),
    "a cell number on a board with one cell": (
        [("--fault cell_open=3@10-20", 2, "--fault cell_open=3@10-20:1: cell_open=3, expected a cell, 1 to 1", {})],
        [("cell_open=3@10-20", "this board has one cell")]),
}


class Answered(Walk):
    """A walk whose commands are answered from a list."""

    answers = []

    def __init__(self, who, goal):
        super().__init__("bms", who, goal)

    def runs(self, command, interrupt_at_cpu_s=None):
        self.status, self.output = 0, ""
        for part, status, output, files in self.answers:
            if part not in command:
                continue
            self.status, self.output = status, output
            for name, text in files.items():
                self.writes(name, text)
        self.steps.append({"command": command, "status": self.status, "output": self.output, "expected": []})


def answered(answers):
    """All expectations of all walks, as (command, expectation, holds)."""
    Answered.answers = answers
    found = []
    for who, goal, _, steps in walks.WALKS:
        w = Answered(who, goal)
        try:
            steps(w)
        except FileNotFoundError:
            pass  # written by a command that has no answer here
        finally:
            found += [(s.get("command", ""), text, good) for s in w.steps for text, good in s["expected"]]
            w.close()
    return found


def main():
    unnoticed = 0
    for finding, (answers, refused) in FINDINGS.items():
        found = answered(answers)
        for command, expectation in refused:
            of = [good for c, text, good in found if command in c and re.search(expectation, text)]
            noticed = bool(of) and not any(of)
            unnoticed += not noticed
            print(f"{'noticed' if noticed else 'NOT NOTICED'}: {finding}: {command}: {expectation}")
    return 1 if unnoticed else 0


if __name__ == "__main__":
    sys.exit(main())
