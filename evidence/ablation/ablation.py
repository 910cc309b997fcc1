#!/usr/bin/env python3
"""Switches gates of the diagnosis off, alone and in groups, and counts what that changes.

  ablation.py PROGRAMS [--suite NAME ...] [--gate NAME ...] [--data FOLDER] [--seed N] [--count N] --json F

PROGRAMS: folder with benchmark_ablation, semi_real_ablation and natural_ablation
(cmake --build build/host --target benchmark_ablation semi_real_ablation natural_ablation). Every result is kept in F
as soon as it is there; what F has already is not run again. A table of all results is printed at the end.
"""
import argparse
import json
import os
import pathlib
import subprocess
import sys
import tempfile

LARGE = "1e9"
# a gate, and the numbers with which it never acts
GATES = {
    "nothing": "",
    "small next to others": "noticeable=0,noticeable_gain=0",
    "lasting error grows": f"error_may_grow={LARGE}",
    "contact's wander": "contact_wander=0",
    "end of a discharge": "end_share=0",
    "implausible shapes": f"capacity_lost_alone={LARGE},stages_closer={LARGE},slides_apart_soc={LARGE}",
    "own sigmas": "own_sigmas=0",
    "faint": "faint=0",
    "share explained": "explained=0,explained_by_bursts=0",
    "far out": f"far_out={LARGE}",
    "one place": f"in_one_place={LARGE}",
    "gross error": f"gross_v={LARGE},gross_times={LARGE}",
    "least gross error": "gross_v=0",
    "law explains more": "few_causes=0",
    "price of unknowns": "per_unknown=0",
    "price of bursts": "per_burst=0",
    "resumed": "elimination_resumed=0",
    "one class": "inseparable=2",
    "trades": "trades=2",
    "coverage": "covered_at_least=0",
    "beyond coverage": "log_spread_beyond=0",
    "error learned": "learned_within=2",
    "temper and cap": "temper=1,at_most=1",
}
GROUPS = {
    "sizes": ["small next to others", "lasting error grows"],
    "at one current": ["contact's wander", "end of a discharge"],
    "search": ["resumed", "trades", "one class"],
    "all of one current and sizes": ["small next to others", "lasting error grows",
                                     "contact's wander", "end of a discharge", "implausible shapes"],
    "adequacy": ["faint", "share explained", "far out"],
}


def fail(message):
    print(message, file=sys.stderr)
    sys.exit(2)


def numbers_of(gate):
    return ",".join(GATES[g] for g in GROUPS.get(gate, [gate]) if GATES[g])


def run(command, gate):
    with tempfile.TemporaryDirectory() as folder:
        out = pathlib.Path(folder) / "out.json"
        environment = {**os.environ, "BMS_THRESHOLDS": numbers_of(gate)}
        done = subprocess.run([*map(str, command), "--json", str(out)], check=False, env=environment,
                              stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        if done.returncode != 0:
            fail(f"{command[0]} ended with {done.returncode}: {done.stderr[-500:]}")
        return json.loads(out.read_text())


def share(flags):
    flags = list(flags)
    return f"{sum(flags)} of {len(flags)}"


def of_concealed(result):
    """Counts of concealed cases, and every answer by which two runs are compared."""
    cases = result["methods"]["greybox-bms"]
    named = [c for c in cases if c["verdict"] in ("CAUSE", "CAUSES", "AMBIGUOUS")]
    of = lambda kind: [c for c in cases if c["kind"] == kind]
    large = [c for c in of("single") if c["strength"] >= 2]
    true_ids = lambda c: set(c["ids"])
    counts = {
        "nulls named": share(c["verdict"] in ("CAUSE", "CAUSES", "AMBIGUOUS", "UNKNOWN") for c in of("null")),
        "detected": share(c["verdict"] not in ("NO_MISMATCH", "NOT_TESTABLE") for c in large),
        "right first": share(bool(c["found"]) and c["found"][0] in c["ids"] for c in large if c in named),
        "clean": share(c in named and len(c["sets"]) == 1 and true_ids(c) <= set(c["sets"][0]) for c in large),
        "pairs both": share(all(any(i in s for s in c["sets"]) for i in c["ids"]) for c in of("pair")),
        "pairs none wrong": share(bool(c["sets"]) and all(true_ids(c) & set(s) for s in c["sets"])
                                  for c in of("pair")),
        "outside UNKNOWN": share(c["verdict"] == "UNKNOWN" for c in of("outside")),
    }
    return counts, [[c["verdict"], c["sets"]] for c in cases]


def of_real(result):
    rows = result["results"]
    nulls = [r for r in rows if r["kind"] == "null"]
    faults = [r for r in rows if r["kind"] == "fault"]
    counts = {"nulls named": share(r["named"] for r in nulls),
              "UNKNOWN": share(r["verdict"] == "UNKNOWN" for r in nulls),
              "NOT_TESTABLE": share(r["verdict"] == "NOT_TESTABLE" for r in nulls)}
    if faults:
        counts["right"] = share(r["first_right"] for r in faults)
        counts["wrong"] = share(r["named"] and not r["first_right"] for r in faults)
    return counts, [[r["verdict"], r.get("found", "")] for r in rows]


def suites_of(o):
    real = [o.programs / "semi_real_ablation", "--data", o.data, "--only", o.only]
    concealed = [o.programs / "benchmark_ablation", "development", o.seed, "--no-baselines", "--no-experiments"]
    concealed += ["--first", o.first, "--count", o.count]
    return {"concealed": (concealed, of_concealed),
            "healthy": ([*real, "--nulls-only"], of_real),
            "without healthy data": ([*real, "--nulls-only", "--without-healthy"], of_real),
            "faults": ([*real, "--times-limit", "2"], of_real)}


def options_of():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("programs", metavar="PROGRAMS", type=pathlib.Path)
    p.add_argument("--suite", nargs="+", default=["concealed"])
    p.add_argument("--gate", nargs="+", default=[*GATES, *GROUPS])
    p.add_argument("--data", default="../shared/data", type=pathlib.Path)
    p.add_argument("--only", default="NASA", help="real sets whose name contains it (NASA)")
    p.add_argument("--seed", default=1, type=int)
    p.add_argument("--first", default=0, type=int)
    p.add_argument("--count", default=120, type=int, help="of concealed cases (120)")
    p.add_argument("--json", required=True, type=pathlib.Path, metavar="F")
    return p.parse_args()


def table(results, suite):
    if "nothing" not in results.get(suite, {}):
        return
    as_is = results[suite]["nothing"]
    print(f"\n{suite}:\n\n| without | answers changed | {' | '.join(as_is['counts'])} |")
    print("|---|---" + "|---" * len(as_is["counts"]) + "|")
    for gate, r in results[suite].items():
        changed = sum(a != b for a, b in zip(r["answers"], as_is["answers"]))
        print(f"| {gate} | {changed} of {len(r['answers'])} | {' | '.join(r['counts'].values())} |")


def main():
    o = options_of()
    results = json.loads(o.json.read_text()) if o.json.exists() else {}
    suites = suites_of(o)
    for name in o.suite + o.gate:
        if name not in suites and name not in GATES and name not in GROUPS:
            fail(f"ablation.py: no suite or gate {name!r}")
    for suite in o.suite:
        command, count = suites[suite]
        for gate in o.gate:
            if gate in results.setdefault(suite, {}):
                continue
            counts, answers = count(run(command, gate))
            results[suite][gate] = {"numbers": numbers_of(gate), "counts": counts, "answers": answers}
            o.json.write_text(json.dumps(results, indent=1))
            print(suite, gate, counts, flush=True)
    for suite in o.suite:
        table(results, suite)


if __name__ == "__main__":
    main()
