#!/usr/bin/env python3
"""Whether an output of a command holds an invalid number: nan, inf, or the bits of a missing reading.

    finite.py TOOL

Runs the commands on input that is valid and says little: a constant current, rest only, two rows, missing readings, a
single temperature. An error of one line with exit status 1 or 2 is an answer as well. Exit status 1 if an output has
such a number."""
import json
import os
import pathlib
import re
import subprocess
import sys
import tempfile

WORD = r"(?<![\w.$'-])[-+]?(nan|inf(inity)?)(?![\w(.'-])"
SENTINEL = r"(?<!\w)(-?2147\.?48\d+|\d+(\.\d+)?e\+?[1-9]\d\d)(?!\w)"
NOT_A_NUMBER = re.compile(f"{WORD}|{SENTINEL}", re.IGNORECASE)
COMMANDS = (
    "replay {in} --cell table9 --json {out}.json --report {out}.html --trace {out}.csv",
    "replay {in} --cell table9 --initial-soc 0.5 --json {out}.json --cuts 2",
    "simulate --cell table9 --recording {in} --initial-soc 0.5 --interval --json {out}.json --report {out}.html "
    "--out {out}.csv",
    "diagnose --cell table9 --recording {in} --initial-soc 0.5 --json {out}.json --report {out}.html --out {out}.toml",
    "diagnose --cell table9 --recording {in} --holdout other.csv --json {out}.json --report {out}.html",
    "identify --recording {in} --start table9 --initial-soc 0.5 --json {out}.json --report {out}.html --out {out}.toml",
    "ammeter {in} --cell table9 --json {out}.json --report {out}.html",
    "import {in} --out {out}.csv",
    "diagnose --pack table9 --recording pack_{in} --initial-soc 0.5 --json {out}.json --report {out}.html",
)


def recordings():
    """Rows of time, current, voltage and temperature, by name."""
    def rows(count, current, voltage, temperature=lambda k: "20"):
        return [(k, current(k), voltage(k), temperature(k)) for k in range(count)]

    def load(k):
        return -3 if k // 60 % 2 else 0

    def volts(k):
        return f"{3.3 + 0.025 * load(k) - 1e-6 * k + 1e-4 * (k % 3):.4f}"

    return {"constant": rows(900, lambda k: -2, lambda k: f"{3.28 - 1e-5 * k:.4f}"),
            "rest": rows(900, lambda k: 0, lambda k: "3.3000"),
            "two": rows(2, lambda k: -1, lambda k: "3.3"),
            "missing": rows(900, load, lambda k: "" if k % 7 == 0 or k > 600 else volts(k),
                            lambda k: "" if k % 2 else "20"),
            "no_temperature": rows(900, load, volts, lambda k: ""),
            "still": rows(900, load, lambda k: "3.3")}


def write_inputs(folder):
    for name, rows in recordings().items():
        head = "time_s,current_a,voltage_v,temperature_c\n"
        (folder / f"{name}.csv").write_text(head + "".join(f"{t},{a},{v},{c}\n" for t, a, v, c in rows))
        head = "time_s,current_a,v_1,v_2,v_3,temperature_c\n"
        (folder / f"pack_{name}.csv").write_text(head + "".join(f"{t},{a},{v},{v},{v},{c}\n" for t, a, v, c in rows))
    (folder / "other.csv").write_text("time_s,current_a,voltage_v\n0,0,3.3\n1,0,3.3\n2,-1,3.27\n")
    (folder / "fleet.csv").write_text("recording,cell,truck,cell_index,started_at\n" + "".join(
        f"{name}.csv,table9,T{k},1,2026-05-{10 + k}\n" for k, name in enumerate(recordings())))


def refuse(constant):
    raise ValueError(constant)


def faults_of(name, text):
    if name.endswith(".json"):
        try:
            json.loads(text, parse_constant=refuse)
        except ValueError as error:
            return [f"not JSON: {error}"]
    if name.endswith(".html"):
        text = re.sub(r"<script(?![^>]*json).*?</script>", "", text, flags=re.DOTALL)
    return [text[max(0, m.start() - 60):m.end() + 20].replace("\n", " ") for m in NOT_A_NUMBER.finditer(text)][:3]


def run(tool, command, folder):
    done = subprocess.run([tool, *command.split()], cwd=folder, capture_output=True, text=True, timeout=1200,
                          env=dict(os.environ, BMS_PROGRESS="off"))
    faults = [f"exit status {done.returncode}: {done.stderr[-200:]}"] if done.returncode not in (0, 1, 2) else []
    return faults + [f"printed: {f}" for f in faults_of("", done.stdout + done.stderr)]


def main():
    tool, failed, outputs = str(pathlib.Path(sys.argv[1]).resolve()), 0, 0
    with tempfile.TemporaryDirectory(prefix="finite.") as name:
        folder = pathlib.Path(name)
        write_inputs(folder)
        commands = [c.format_map({"in": f"{r}.csv", "out": f"out_{r}_{k}"}) for r in recordings()
                    for k, c in enumerate(COMMANDS)]
        commands += ["fleet run --manifest fleet.csv --task diagnose --out fleet -- --initial-soc 0.5",
                     "fleet report fleet --report out_fleet.html --json out_fleet.json"]
        for command in commands:
            for fault in run(tool, command, folder):
                failed += 1
                print(f"bms {command}\n    {fault}")
        for path in sorted(p for p in folder.rglob("*") if p.suffix in (".json", ".csv", ".html", ".toml", ".jsonl")):
            outputs += 1
            for fault in faults_of(path.name, path.read_text()):
                failed += 1
                print(f"{path.relative_to(folder)}: {fault}")
    print(f"{len(commands)} commands, {outputs} files, {failed} faults")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
