#!/usr/bin/env python3
"""Makes synthetic depots with planted faults, runs bms fleet on them and scores what its report says to visit.

  depots.py TOOL MAKE_DEPOT SEED [--depots 5 --trucks 14 --cells 4 --days 20 --hours 1 --step 5] [--folder DIR]

TOOL: bms. MAKE_DEPOT: the program that writes a depot. Depot k has the seed 1000 SEED + k. Each has four trucks with a
planted fault; the others are healthy. What is in --folder is used again, so an interrupted run continues.
The score reads the answer, which neither the diagnosis nor the report has seen.
"""
import argparse
import csv
import datetime
import json
import math
import os
import pathlib
import subprocess
import sys
import tempfile

CAUSES = ("contact_intermittent", "current_offset", "capacity_change", "leakage")
ONSET_DAYS = 3


def run(*command):
    done = subprocess.run([str(c) for c in command], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        sys.exit(f"{' '.join(map(str, command))}\n{done.stderr}")


def options_of():
    p = argparse.ArgumentParser(description="Runs bms fleet on synthetic depots and scores its report")
    p.add_argument("tool", type=os.path.abspath)
    p.add_argument("make_depot", type=os.path.abspath)
    p.add_argument("seed", type=int)
    for name, value in (("depots", 5), ("trucks", 14), ("cells", 4), ("days", 20), ("jobs", os.cpu_count())):
        p.add_argument(f"--{name}", type=int, default=value)
    p.add_argument("--hours", type=float, default=1)
    p.add_argument("--step", type=float, default=5)
    p.add_argument("--folder", type=pathlib.Path)
    p.add_argument("--readme", type=pathlib.Path, help="write the table between '<!-- figures: depot -->' and its end")
    return p.parse_args()


def report_of(o, folder, k):
    """The answer and the report of a depot; makes and runs what is not there yet."""
    depot = folder / f"depot_{k}"
    if not (depot / "manifest.csv").exists():  # is written last
        size = [f"--{name}={getattr(o, name)}" for name in ("trucks", "cells", "days", "hours", "step")]
        run(o.make_depot, depot, "--seed", 1000 * o.seed + k, *size)
    out = depot / "out"
    run(o.tool, "fleet", "run", "--manifest", depot / "manifest.csv", "--task", "diagnose", "--pages", "none", "--jobs",
        o.jobs, "--out", out, "--json", depot / "run.json")
    run(o.tool, "fleet", "report", out, "--json", depot / "report.json")
    with open(depot / "answer.csv", newline="", encoding="utf-8") as file:
        answer = list(csv.DictReader(file))
    report = json.loads((depot / "report.json").read_text(encoding="utf-8"))
    return answer, report, healthy_cells_of(out, answer)


def healthy_cells_of(out, answer):
    """Of each cell of the healthy trucks: recordings that name a cause or cannot explain a mismatch, and all."""
    faulty, cells = {f["truck"] for f in answer}, {}
    with open(out / "fleet.csv", newline="", encoding="utf-8") as file:
        for row in csv.DictReader(file):
            if row["kind"] == "verdict" and row["truck"] not in faulty:
                counts = cells.setdefault((row["truck"], row["cell_index"]), [0, 0])
                counts[0] += row["verdict"] != "NO_MISMATCH"
                counts[1] += 1
    return list(cells.values())


def correlation_of(cells):
    """Of two false alarms of one cell, by moments of a beta-binomial distribution; None without a false alarm."""
    alarms, of = sum(c[0] for c in cells), sum(c[1] for c in cells)
    if alarms == 0 or of == len(cells):
        return None
    p, each = alarms / of, of / len(cells)
    dispersion = sum((k - n * p) ** 2 / (n * p * (1 - p)) for k, n in cells) / len(cells)
    return (dispersion - 1) / (each - 1)


def days_between(first, last):
    return (datetime.date.fromisoformat(last) - datetime.date.fromisoformat(first)).days


def score(depot, answer, report, healthy_cells, trucks):
    """One row for each planted fault, one for each visit that is asked for at another place or for another cause."""
    visits = [i for i in report["issues"] if i["confirmed"]]
    planted, wrong = [], []
    for fault in answer:
        at_truck = [v for v in visits if v["truck"] == fault["truck"]]
        named = next((v for v in at_truck if v["cause"] == fault["cause"]), None)
        row = {"depot": depot, "truck": fault["truck"], "cause": fault["cause"], "named": named is not None,
               "other": [v["cause"] for v in at_truck if v is not named], "right_cell": None, "late": None}
        if named:
            row["right_cell"] = (named["cell"] or "") == fault["cell_index"]
            row["late"] = days_between(fault["onset"], named["onset"]) if named["onset"] else None
        planted.append(row)
    faults = {f["truck"]: f for f in answer}
    for v in visits:
        fault = faults.get(v["truck"])
        # "unknown" names no cause: where a fault was planted it is not wrong, but the fault is not named
        if fault is None or v["cause"] not in (fault["cause"], "unknown"):
            wrong.append({"depot": depot, "truck": v["truck"], "cell": v["cell"], "cause": v["cause"],
                          "planted": fault["cause"] if fault else None})
    named_trucks = {v["truck"] for v in visits}
    return {"planted": planted, "wrong": wrong, "healthy": trucks - len(faults),
            "healthy_named": len(named_trucks - set(faults)), "healthy_cells": healthy_cells}


def share(count, of):
    """A share with Wilson's interval of 95 %."""
    if of == 0:
        return "-"
    z, p = 1.96, count / of
    middle, width = p + z * z / (2 * of), z * math.sqrt(p * (1 - p) / of + z * z / (4 * of * of))
    low, high = (abs(middle + s * width) / (1 + z * z / of) for s in (-1, 1))
    return f"{count} of {of}: {100 * p:.0f} % ({100 * low:.0f}-{100 * high:.0f})"


def cause_rows(planted):
    lines = ["| planted | times | named | another visit at that truck | onset, days late |", "|---|---|---|---|---|"]
    for cause in CAUSES:
        of = [p for p in planted if p["cause"] == cause]
        others = sorted({other for p in of for other in p["other"]})
        late = " ".join(f"{p['late']:+d}" if p["late"] else "0" for p in of if p["late"] is not None)
        lines.append(f"| {cause} | {len(of)} | {sum(p['named'] for p in of)} | {', '.join(others) or '-'} "
                     f"| {late or '-'} |")
    return lines


def table(o, scores):
    planted = [p for s in scores for p in s["planted"]]
    wrong = [w for s in scores for w in s["wrong"]]
    named = [p for p in planted if p["named"]]
    in_time = [p for p in named if p["late"] is not None and abs(p["late"]) <= ONSET_DAYS]
    cells = [c for s in scores for c in s["healthy_cells"]]
    correlation = correlation_of(cells)
    healthy, healthy_named = (sum(s[key] for s in scores) for key in ("healthy", "healthy_named"))
    rows = [("planted faults named, by truck and cause (recall)", ">= 90 %", share(len(named), len(planted))),
            ("named causes that were planted (precision)", ">= 90 %", share(len(named), len(named) + len(wrong))),
            ("of those named: right cell, or the whole battery", "",
             share(sum(p["right_cell"] for p in named), len(named))),
            (f"of those named: onset within {ONSET_DAYS} days", "all", share(len(in_time), len(named))),
            ("healthy trucks with a visit", "<= 2 %", share(healthy_named, healthy)),
            ("healthy recordings that are off; correlation within a cell", "",
             share(sum(c[0] for c in cells), sum(c[1] for c in cells)) +
             ("" if correlation is None else f"; {correlation:.2f}"))]
    lines = [f"Seed {o.seed}: {o.depots} depots of {o.trucks} trucks x {o.cells} cells x {o.days} days, shifts of "
             f"{o.hours:g} h, a sample every {o.step:g} s. In brackets: Wilson's 95 % interval.", "",
             "| figure | required | measured |", "|---|---|---|"]
    lines += [f"| {' | '.join(row)} |" for row in rows] + [""] + cause_rows(planted)
    bad = [f"| depot {p['depot']}, {p['truck']} | {p['cause']} | not named; {', '.join(p['other']) or 'no visit'} |"
           for p in planted if not p["named"]]
    bad += [f"| depot {w['depot']}, {w['truck']}, {'cell ' + w['cell'] if w['cell'] else 'whole battery'} "
            f"| {w['planted'] or 'nothing'} | {w['cause']} |" for w in wrong]
    if bad:
        lines += ["", "| missed or wrong | planted | answer |", "|---|---|---|", *bad]
    return "\n".join(lines) + "\n"


def write_readme(path, text, name):
    page = path.read_text(encoding="utf-8")
    begin, end = f"<!-- figures: {name} -->\n", "<!-- end of figures -->"
    at = page.index(begin) + len(begin)
    path.write_text(page[:at] + text + page[page.index(end, at):], encoding="utf-8")


def main():
    o = options_of()
    with tempfile.TemporaryDirectory() as own:
        folder = o.folder or pathlib.Path(own)
        scores = []
        for k in range(o.depots):
            scores.append(score(k + 1, *report_of(o, folder, k), o.trucks))
            said = {key: scores[-1][key] for key in ("planted", "wrong", "healthy_named")}
            print(f"depot {k + 1} of {o.depots}: {json.dumps(said)}", file=sys.stderr, flush=True)
    text = table(o, scores)
    print(text, end="")
    if o.readme:
        write_readme(o.readme, text, "depot")


if __name__ == "__main__":
    main()
