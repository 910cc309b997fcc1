#!/usr/bin/env python3
"""The tables of targets: what targets.toml asks for, next to what was measured last. All of them stand in README.md,
those of real cells also at the top of inference/diagnosis/README.md.

  targets.py keep RESULT.json --command TEXT [--on TEXT]   takes the figures of a result into measured.json
  targets.py write                                         writes the tables
  targets.py check                                         exit code 1 if a table is not what `write` would write

RESULT.json is what `benchmark`, `outside` (their --json), `semi_real`, `natural` or `./bms benchmark semi-real` have
written. --on says on which cases, if the result does not: "NASA". A figure is kept once for each. The commit is the one
that is checked out, so keep a result before the sources change; with changed files it is refused.
"""
import argparse
import datetime
import json
import pathlib
import subprocess
import sys
import tomllib

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parents[1]
MEASURED = HERE / "measured.json"
REAL = "real: "  # begins the names of figures of real cells
TABLES = ((HERE / "README.md", "targets", ""),  # file, its mark, what the names begin with
          (ROOT / "inference/diagnosis/README.md", "real cells", REAL))

# Counts in the results of the programs for real recordings: figure, hits, cases
COUNTS = (
    (REAL + "false alarms on healthy recordings", ("nulls", "false"), ("nulls", "cases")),
    (REAL + "faults put in, twice the stated limit and above: detected", ("faults", "detected"), ("faults", "cases")),
    (REAL + "faults put in, twice the stated limit and above: right first", ("faults", "first_right"),
     ("faults", "cases")),
    (REAL + "faults put in: size within two sigma", ("faults", "size_within_2_sigma"), ("faults", "size_compared")),
    (REAL + "faults that nobody put in: right, recording alone", ("natural", "alone", "right"),
     ("natural", "alone", "cases")),
    (REAL + "the same, with other recordings", ("natural", "with_recordings", "right"),
     ("natural", "with_recordings", "cases")),
    (REAL + "the same, with a reference", ("natural", "with_references", "right"),
     ("natural", "with_references", "cases")))
PROBABILITIES = REAL + "expected calibration error of the probabilities"
BANDS = REAL + "readings within the 95 % band, mean of the sets"


def fail(message):
    print(message, file=sys.stderr)
    sys.exit(2)


def at(result, keys):
    for key in keys:
        result = result.get(key) if isinstance(result, dict) else None
    return result


def figures_of(result):
    """Each figure of a result, as {"name", "hits" and "of", or "value"}."""
    figures = list(result.get("figures", []))
    for name, hits, of in COUNTS:
        if at(result, of):
            figures.append({"name": name, "hits": at(result, hits), "of": at(result, of)})
    if at(result, ("probabilities", "named")) and at(result, ("faults", "cases")):
        figures.append({"name": PROBABILITIES, "value": result["probabilities"]["calibration_error"]})
    bands = [r["band_within"] for r in result.get("results", ()) if r.get("band_within") is not None]
    if bands:
        figures.append({"name": BANDS, "value": 100 * sum(bands) / len(bands)})
    return [f for f in figures if f.get("of", 1)]


def git(*arguments):
    return subprocess.run(("git", "-C", HERE, *arguments), check=True, capture_output=True, text=True).stdout.strip()


def keep(o):
    try:
        result = json.loads(pathlib.Path(o.result).read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        fail(f"{o.result}:1: no result ({error}), expected JSON of a benchmark")
    on = o.on or result.get("on")
    if not on:
        fail(f"{o.result}:1: does not say on which cases, expected --on")
    if git("status", "--porcelain", "--untracked-files=no", "--", ":/", f":(exclude,top){MEASURED.relative_to(ROOT)}"):
        fail("not everything is committed: the commit would not be that of the figures")
    order = [t["name"] for t in targets()]
    new = {f["name"]: f for f in figures_of(result) if f["name"] in order}
    source = {"on": on, "commit": git("rev-parse", "--short=8", "HEAD"), "date": datetime.date.today().isoformat(),
              "command": o.command}
    kept = [m for m in measured() if m["on"] != on or m["name"] not in new] + [{**f, **source} for f in new.values()]
    kept.sort(key=lambda m: (order.index(m["name"]), m["on"]))
    MEASURED.write_text("[\n" + ",\n".join(json.dumps(m) for m in kept) + "\n]\n", encoding="utf-8")


def targets():
    return tomllib.loads((HERE / "targets.toml").read_text(encoding="utf-8"))["target"]


def measured():
    return json.loads(MEASURED.read_text(encoding="utf-8"))


def value_of(m):
    """In the unit of its target: shares in percent."""
    return 100 * m["hits"] / m["of"] if "of" in m else m["value"]


def is_met(target, value):
    low, high = {"at most": (None, target["value"]), "at least": (target["value"], None)}.get(
        target["direction"]) or target["value"]
    return (low is None or value >= low) and (high is None or value <= high)


def rounded(target, value, digits):
    """With so many digits, or as many more as it takes to stay on its side of the target and off 100."""
    for more in range(digits, 6):
        text = f"{value:.{more}f}"
        if is_met(target, float(text)) == is_met(target, value) and (float(text) == 100) == (value == 100):
            break
    return text


def text_of(m, target):
    unit = " %" if target["unit"] == "%" else ""
    if "of" in m:
        return f"{m['hits']} of {m['of']} ({rounded(target, value_of(m), 0)} %)"
    return rounded(target, m["value"], 1 if unit else 2) + unit


def target_text(target):
    unit = " %" if target["unit"] == "%" else ""
    if target["direction"] == "between":
        return f"{target['value'][0]} to {target['value'][1]}{unit}"
    return {"at most": "<= ", "at least": ">= "}[target["direction"]] + f"{target['value']}{unit}"


def table(begin):
    lines = ["| figure | target | measured | on | measured by | commit | result |", "|---|---|---|---|---|---|---|"]
    for t in targets():
        if not t["name"].startswith(begin):
            continue
        head = f"| {t['name'].removeprefix(begin)} | {target_text(t)} |"
        rows = [m for m in measured() if m["name"] == t["name"]]
        for m in rows:
            met = "met" if is_met(t, value_of(m)) else "**not met**"
            lines.append(f"{head} {text_of(m, t)} | {m['on']} | `{m['command']}` | "
                         f"{m['commit']}, {m['date']} | {met} |")
        if not rows:
            lines.append(f"{head} | | | | not measured |")
    return "\n".join(lines) + "\n"


def with_table(text, mark, begin):
    opening, end = f"<!-- figures: {mark} -->\n", "<!-- end of figures -->"
    before, rest = text.split(opening)
    return before + opening + table(begin) + end + rest.split(end, 1)[1]


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    sub = p.add_subparsers(dest="what", required=True)
    k = sub.add_parser("keep", help="take the figures of a result")
    k.add_argument("result")
    k.add_argument("--command", required=True, help="that made it")
    k.add_argument("--on", help="on which cases")
    sub.add_parser("write", help="write the tables")
    sub.add_parser("check", help="compare the tables")
    o = p.parse_args()
    if o.what == "keep":
        keep(o)
        return 0
    stale = False
    for readme, mark, begin in TABLES:
        text = readme.read_text(encoding="utf-8")
        new = with_table(text, mark, begin)
        if o.what == "write":
            readme.write_text(new, encoding="utf-8")
        elif new != text:
            stale = True
            print(f"{readme}:1: its table is not that of measured.json, expected: targets.py write")
    return 1 if stale else 0


if __name__ == "__main__":
    sys.exit(main())
