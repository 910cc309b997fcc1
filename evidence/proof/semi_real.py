#!/usr/bin/env python3
"""Runs the two benchmarks on real recordings and writes their counts as one JSON object.

  semi_real.py PROGRAMS DATA_FOLDER [--json F] [--only TEXT] [--times-limit X ...] [--quiet]

PROGRAMS: folder with the programs semi_real (healthy recordings as they are, and with faults of known size) and natural
(faults that nobody put in). A DATA_FOLDER with lists of its own, semi_real.toml and natural.toml, uses these; else
those of the repository, without what is not in the folder.
"""
import argparse
import json
import os
import pathlib
import subprocess
import sys
import tempfile

LISTS = pathlib.Path(__file__).resolve().parent
EPILOG = """A folder may bring its own lists, semi_real.toml and natural.toml (their format stands at the beginning of
those in evidence/proof/); else these are used, and what is not in the folder is skipped. A set
takes up to 25 diagnoses: of a NASA discharge a tenth of a second of processor time each, of an A123 drive of 20,000
rows and more about a minute each. So --only NASA takes two minutes, and all of ../shared/data takes hours.
Example: ./bms benchmark semi-real ../shared/data --only B0025 --json semi_real.json"""


def fail(message):
    print(message, file=sys.stderr)
    sys.exit(2)


def options_of():
    p = argparse.ArgumentParser(
        prog="./bms benchmark semi-real", epilog=EPILOG, formatter_class=argparse.RawDescriptionHelpFormatter,
        usage="%(prog)s DATA_FOLDER [--json F] [--only TEXT] [--times-limit X ...] [--quiet]",
        description="Diagnoses real recordings: healthy ones, the same with faults of known size, and faults that "
                    "nobody put in.")
    p.add_argument("programs", type=pathlib.Path, help=argparse.SUPPRESS)
    p.add_argument("data", metavar="DATA_FOLDER", type=pathlib.Path, help="folder with the recordings")
    p.add_argument("--json", metavar="F", help="write counts and every result to F; - for standard output")
    p.add_argument("--only", metavar="TEXT", default="", help="only sets and cases whose name contains TEXT")
    p.add_argument("--times-limit", metavar="X", type=float, nargs="+", default=[0.5, 2, 4],
                   help="sizes of the faults, in detection limits that the healthy recording states (0.5 2 4)")
    p.add_argument("--quiet", action="store_true", help="no progress and no summary")
    return p.parse_args()


def list_of(data, name):
    own = data / name
    return own if own.exists() else LISTS / name


def run(o, name, *options):
    """The JSON of a program. What it prints is progress here, so it goes to standard error."""
    with tempfile.TemporaryDirectory() as folder:
        out = pathlib.Path(folder) / "out.json"
        command = [o.programs / name, "--data", o.data, "--only", o.only, "--json", out, *options]
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE, "text": True}
        done = subprocess.run([str(c) for c in command], check=False, **(quiet if o.quiet else {"stdout": sys.stderr}))
        if done.returncode != 0:  # the program has said why
            if o.quiet:
                print(done.stderr.strip().splitlines()[-1], file=sys.stderr)
            sys.exit(done.returncode if done.returncode > 0 else 3)
        return json.loads(out.read_text(encoding="utf-8"))


def merged(o):
    faults = run(o, "semi_real", "--list", list_of(o.data, "semi_real.toml"), "--times-limit", *o.times_limit)
    natural = run(o, "natural", "--list", list_of(o.data, "natural.toml"), "--sets",
                  list_of(o.data, "semi_real.toml"), "--all")
    not_run = {f"{key}_{what}": part[key] for key in ("skipped", "without_cell_file")
               for what, part in (("sets", faults), ("cases", natural))}
    return {"nulls": faults["nulls"], "faults": faults["faults"], "probabilities": faults["probabilities"],
            "natural": natural["natural"], **not_run,
            "results": faults["results"] + natural["results"]}


def summary(r):
    nulls, faults, natural = r["nulls"], r["faults"], r["natural"]
    half, groups = faults["half_limit"], (natural["alone"], natural["with_recordings"], natural["with_references"])
    return "\n".join((
        "| figure | count |", "|---|---|",
        f"| healthy recordings in which a cause is named | {nulls['false']} of {nulls['cases']}, "
        f"{nulls['hours']:.1f} h |",
        f"| the same: UNKNOWN; more healthy data needed | {nulls['unknown']}; {nulls['not_testable']} |",
        f"| faults of twice the stated limit and above, within the bounds of a real instrument: detected "
        f"| {faults['detected']} of {faults['cases']} |",
        f"| the same: first name right; another name first | {faults['first_right']}; {faults['another_first']} |",
        f"| the same: size within two standard deviations | {faults['size_within_2_sigma']} of "
        f"{faults['size_compared']} |",
        f"| faults of half the limit and below: another name first | {half['another_first']} of {half['cases']} |",
        "| faults that nobody put in: right alone; with more recordings; with a reference | " +
        "; ".join(f"{g['right']} of {g['cases']}" for g in groups) + " |",
        "| the same: a wrong name | " + "; ".join(str(g["wrong"]) for g in groups) + " |",
        f"| not run: recordings are not in the folder; no cell file | {r['skipped_sets']} sets and "
        f"{r['skipped_cases']} cases; {r['without_cell_file_sets']} and {r['without_cell_file_cases']} |"))


def write(path, text):
    temporary = f"{path}.part"
    try:
        with open(temporary, "w", encoding="utf-8") as file:
            file.write(text)
        os.replace(temporary, path)
    except OSError as error:
        fail(f"{path}:1: cannot be written ({error.strerror}), expected a file to write to")


def main():
    o = options_of()
    r = merged(o)
    if not r["results"] and not r["without_cell_file_sets"] + r["without_cell_file_cases"]:
        fail(f"{o.data}:1: nothing to run, expected recordings of the lists"
             + (f" in sets or cases with '{o.only}' in the name" if o.only else ""))
    text = json.dumps(r, indent=1) + "\n"
    if o.json == "-":
        print(text, end="")
    elif not o.quiet:
        print(summary(r))
    if o.json and o.json != "-":
        write(o.json, text)


if __name__ == "__main__":
    main()
