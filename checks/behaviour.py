#!/usr/bin/env python3
"""Shows that a change of the code has not changed its behaviour.

    checks/behaviour.py capture BEFORE        in a checkout of the code before the change, built
    checks/behaviour.py capture AFTER         in a checkout of the code after the change, built
    checks/behaviour.py compare BEFORE AFTER  exit code 0: same; 1: something differs; 2: wrong usage or missing input

`capture` runs the programs below build/host of a checkout (--root, by default the one that holds this script) and
writes one file per part, PART.json.gz. `compare` prints one line per item: "same", "same to" the largest difference,
or "differs" and the first difference.

    replay       estimates of evidence/recordings/forklift_shift.csv and of real recordings, in all three scalars
    simulate     open-loop voltage of each built-in cell and of each mechanism
    headers      C++ constants of each built-in cell: numbers, fields, names and flags in their order
    experiments  each current profile
    identify     cell files from recordings
    diagnose     verdict, causes and all numbers, from NO_MISMATCH to DATA_FAULT
    study        the tables of the paper
    images       flash and static RAM of bms_BOARD.elf with cell table9, the newest one below build/, if it was built:
                 cmake --preset PRESET && cmake --build build/PRESET --target bms_BOARD.elf
    step         instructions of an estimator step, by `write_figures step` if it was built; it builds its own images
    benchmark    only if --parts names it: the first --cases of the 120 cases of `benchmark development 1`, all of which
                 take seven minutes on two free cores (all other parts two)

Traces, profiles and headers must be the same, bit by bit. Other numbers may differ by 1e-12 (--tolerance), relative to
the larger one where that is above 1. Simulated columns have ten digits: a difference of 1e-12 changes the last one in
one row of a thousand, so two in a thousand are accepted. Instructions must not grow. Bytes may grow by 5 %, within the
board's budget (boards/README.md). Not compared: wall times, rates, sentences (of a warning, only the code at its
start), paths, the hash of a cell file in its header, and fields that only AFTER has.
"""
import argparse
import concurrent.futures
import csv
import functools
import gzip
import hashlib
import json
import math
import os
import pathlib
import re
import shlex
import subprocess
import sys
import tempfile
import time
import tomllib

PARTS = ("replay", "simulate", "headers", "experiments", "identify", "diagnose", "study", "images", "step", "benchmark")
CELLS = ("table9", "a123_26650", "a123_26650_extended", "a123_esctoolbox_extended")
BOARDS = ("netduinoplus2", "microbit", "stm32f405_forklift", "stm32f405_cell")
DRIVES = (  # real recordings, from -15 to 45 degrees C
    "a123_26650/udds_P25_A002", "a123_26650/dyn20_P25_A002", "a123_26650/dyn10_N15_A002", "a123_26650/dyn10_P45_A002",
    "a123_esctoolbox/dyn30_N05", "a123_esctoolbox/dyn50_P25")
HYSTERESIS = "ocv_hysteresis:half_gap_v=0.008,decay=40,ocv_at=0.2,initial=-0.5"
MECHANISMS = (  # all of the catalogue, with values that a cell of 6 Ah might have
    "channel_skew:delay_s=1.5", "current_offset:offset_a=0.03", "current_gain:gain_error=0.02", HYSTERESIS,
    "current_clipping:excess_a=2,limit_a=7,knee=0.1", "temperature_sensor:offset_k=3,lag_s=200",
    "initial_soc:shift=0.05", "capacity_change:loss_fraction=0.1", "coulombic_loss:loss_fraction=0.004",
    "leakage:current_a=0.002", "fast_polarisation:resistance_ohm=0.002,time_constant_s=1.5",
    "load_memory:charge_ohm=0.003,discharge_ohm=-0.002,time_constant_s=900",
    "slow_polarisation:resistance_ohm=0.004,time_constant_s=600,faster_share=0.2,surface_lag_s=150",
    "self_heating:thermal_resistance_k_per_w=8,time_constant_s=900,activation_j_per_mol=25000",
    "resistance_growth:fraction=0.3", "polarisation_growth:r1_fraction=0.2,c1_fraction=-0.3",
    "direction_asymmetry:charge_fraction=0.2", "contact_step:resistance_ohm=0.003,onset_s=60",
    "temperature_resistance:r0_activation_j_per_mol=40000,r1_activation_j_per_mol=35000,reference_c=23,r0_share=0.4",
    "charge_transfer:r0_share=0.4,r1_share=0.6,exchange_current_a=2", "ocv_shape:slide_at_20=0.03,slide_at_80=-0.02",
    "branch_temperature:gap_at_10=0.9,gap_at_50=0.25,shift_at_10_v=0.006,energy_at_10_j_per_mol=60000,reference_c=23",
    "entropic_ocv:at_10_v_per_k=1e-4,at_40_v_per_k=-2e-4,at_70_v_per_k=1e-4,at_95_v_per_k=2e-4,reference_c=24",
    "contact_intermittent:resistance_ohm=0.01,share=0.1", "voltage_offset:offset_v=0.004",
    "voltage_gain:gain_error=0.002")
EXPERIMENTS = (
    "rest_30s", "rest_18s", "rest_5s", "high_1m_low_30s", "high_30s_low_30s", "high_30s_low_1m", "ocv_1h_rest",
    "ocv_10min_rest", "forklift_shift", "fast_pulses", "zero_current", "shunt_check", "terminal_check", "meter_check",
    "rate_steps", "climate_steps", "full_cycle", "loops_and_rests", "charge_turns", "long_rest_open")


def items_of(o):
    """The items of each part: command lines that run one after the other, in a folder of their own. What they print and
    the files out.* and printed.csv that they leave are compared."""
    shift, data = (shlex.quote(str(path)) for path in (o.root / "evidence/recordings/forklift_shift.csv", o.data))
    udds, dyn20, hwycol, pulse, discharge, charge = (f"{data}/a123_26650/{name}.csv" for name in (
        "udds_P25_A002", "dyn20_P25_A002", "hwycol_P25_A004", "pulse_P25_A002", "ocv_P25_dis", "ocv_P25_chg"))
    drives = [("forklift_shift", shift, "table9")]
    drives += [(d, f"{data}/{d}.csv", cell) for d in DRIVES for cell in ("a123_26650", d.split("/")[0] + "_extended")]
    settings = [scalar + start for scalar in ("float", "double", "fixed") for start in ("", " --initial-soc 0.9")]
    invert = "awk -F, 'BEGIN {OFS = \",\"} $1 + 0 == $1 {$2 = -$2} {print}'"  # the sign of current_a
    profile = "bms experiment --out profile.csv"
    simulate = "bms simulate --initial-soc 0.95 --out printed.csv --cell"
    identify = "bms identify --out out.toml --recording"
    diagnose = "bms diagnose --out out.toml --cell"
    made = "bms simulate --cell table9 --profile profile.csv --initial-soc 0.9 --noise-v 0.001 --out made.csv --with"
    diagnose_made = f"{diagnose} table9 --recording made.csv --initial-soc 0.9"
    preset = r"\w+|\w+-table9-\w+"  # folders of presets, and of images that bms has built for table9
    images = {board: newest(o.root / "build", f"bms_{board}.elf", preset) for board in BOARDS}
    return {
        "replay": {f"{name} {cell} {setting}": [f"bms replay {path} --cell {cell} --trace out.csv --scalar {setting}"]
                   for name, path, cell in drives for setting in settings},
        "simulate": {f"{c} forklift_shift": [f"{simulate} {c} --recording {shift}"] for c in CELLS}
        | {f"{c} climate_steps": [f"{profile} climate_steps", f"{simulate} {c} --profile profile.csv"] for c in CELLS}
        | {m.partition(":")[0]: [f"{simulate} table9 --recording {shift} --with {m}"] for m in MECHANISMS}
        | {"all mechanisms": [f"{simulate} table9 --recording {shift} --with {' --with '.join(MECHANISMS)}"],
           "noise": [f"{simulate} table9 --recording {shift} --noise-v 0.001 --noise-a 0.01 --seed 3"]},
        "headers": {f"{c} {scalar}": [f"cell_header {c} out.hpp {scalar}"] for c in CELLS for scalar in ("", "fixed")},
        "experiments": {name: [f"bms experiment {name} --out out.csv"] for name in EXPERIMENTS},
        "identify": {
            "forklift_shift": [f"{identify} {shift} --window 0.9:0.6 --validate {shift} --validate-window 0.6:0.3"],
            "pulse --extend": [f"{identify} {pulse} --ocv {discharge} {charge} --start a123_26650 --window 0.95:0.1"
                               f" --extend --no-healthy --validate {udds}"]},
        "diagnose": {
            "forklift_shift": [f"{diagnose} table9 --initial-soc 0.98 --recording {shift}"],
            "udds, hold-out dyn20": [f"{diagnose} a123_26650 --recording {udds} --holdout {dyn20}"],
            "hwycol": [f"{diagnose} a123_26650_extended --recording {hwycol}"],
            "inverted current": [f"sh -c {shlex.quote(f'{invert} {udds} > made.csv')}",
                                 f"{diagnose} a123_26650 --recording made.csv"],
            "two causes": [f"{profile} forklift_shift", f"{made} {HYSTERESIS} --with {MECHANISMS[1]}", diagnose_made],
            **{f"growth in {name}": [f"{profile} {name}", f"{made} resistance_growth:fraction=0.3", diagnose_made]
               for name in ("zero_current", "rest_30s", "rate_steps")}},
        "study": {"simulated plant": ["bms study --out tables"]},
        "images": {board: [f"arm-none-eabi-size {shlex.quote(path)}"] for board, path in images.items()},
        "step": {"netduinoplus2": ["write_figures step"]},
        "benchmark": {f"case {k}": [f"benchmark development 1 --no-baselines --first {k} --count 1 --json out.json"]
                      for k in range(o.cases)},
    }


@functools.cache
def newest(folder, name, parents=".*"):
    """The newest program of that name, in whatever folder the build has put it; empty if missing."""
    found = [p for p in folder.rglob(name) if p.is_file() and re.fullmatch(parents, p.parent.name)]
    return str(max(found, key=lambda p: p.stat().st_mtime, default=""))


def facts(value):
    """What is compared of a JSON or TOML value: numbers, flags and identifiers, not sentences, paths and wall times."""
    if isinstance(value, dict):
        ignored = r".*wall_s|.*_per_second|created|reason" + ("|name" if "id" in value else "")
        named = {key: facts(v) for key, v in value.items() if not re.fullmatch(ignored, key)}
        return {key: v for key, v in named.items() if v != "a text"}
    if isinstance(value, list):
        return [facts(v) for v in value]
    if isinstance(value, str) and (" " in value or "/" in value):
        code = re.match(r"(\w+): ", value)  # of a warning
        return code[1] if code else "a text"
    return value


def columns(text, printed=()):
    """Numbers of the printed columns, and the SHA-256 of the others."""
    names, *rows = csv.reader(line for line in text.splitlines() if not line.startswith("#"))
    table = dict(zip(names, zip(*rows)))
    hashes = {name: hashlib.sha256("\n".join(values).encode()).hexdigest() for name, values in table.items()}
    return hashes | {name: [float(v) for v in table[name]] for name in printed}


def header_tokens(text):
    code = re.sub(r"//.*|^#.*|.*cell_hash.*", "", text, flags=re.MULTILINE)
    return re.findall(r'(?<![\w)])\.[a-z]\w*|"\w*"|\btrue\b|\bfalse\b|-?\b\d+(?:\.\d+(?:e[-+]?\d+)?|e[-+]?\d+)', code)


def outcome(text):
    """One case of the benchmark, with the numbers in its text `figures`."""
    [[case]] = json.loads(text)["methods"].values()
    return facts(case) | {"figures": [float(n) for n in re.findall(r"(?<!\w)-?\d[\d.]*(?:e[-+]\d+)?", case["figures"])]}


READERS = {"out.csv": columns, "printed.csv": functools.partial(columns, printed=("voltage_v", "soc")),
           "out.toml": lambda text: facts(tomllib.loads(text)), "out.hpp": header_tokens, "out.json": outcome}


def step_costs(text):
    """What, how much, and the most that it may become."""
    rows = re.findall(r"^\| (.*?) \| (\d+)(?: \| (\d+))? \|$", text, re.MULTILINE)
    return [[what, int(v), int(v) * (1.05 if "[bytes]" in what else 1)] for what, *values in rows for v in values if v]


def image_costs(text, root, board):
    code, data, bss = map(int, text.splitlines()[1].split()[:3])
    settings = (root / "boards" / board / "board.cmake").read_text()
    budget = dict(re.findall(r"set\(BMS_BUDGET_(FLASH|RAM) (\d+)\)", settings))
    used = {"FLASH": code + data, "RAM": data + bss}
    return [[f"{what} [bytes]", size, min(int(budget[what]), 1.05 * size)] for what, size in used.items()]


def run(o, item, command, folder):
    name, *arguments = shlex.split(command) + (["--quiet", "--json", "-"] if command.startswith("bms ") else [])
    path = name if name in ("sh", "arm-none-eabi-size") else newest(o.root / "build" / "host", name)
    if not path or arguments == [""]:
        return {"missing": f"{'image' if path else name} is not built"}
    done = subprocess.run([path, *arguments], cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode not in (0, 1, 2):
        raise RuntimeError(f"'{command}' ended with exit code {done.returncode}: {done.stderr}")
    readers = {"bms": lambda: facts(json.loads(done.stdout)), "write_figures": lambda: step_costs(done.stdout),
               "arm-none-eabi-size": lambda: image_costs(done.stdout, o.root, item)}
    return {"exit_code": done.returncode, "output": readers[name]() if done.stdout and name in readers else None}


def capture_item(o, item, commands):
    with tempfile.TemporaryDirectory() as folder:
        steps = [run(o, item, command, folder) for command in commands]
        files = {name: pathlib.Path(folder, name) for name in READERS}
        return {"steps": steps, **{name: READERS[name](f.read_text()) for name, f in files.items() if f.exists()}}


def capture(o, results):
    if not o.data.is_dir() or not newest(o.root / "build" / "host", "bms"):
        raise FileNotFoundError(f"expected bms below {o.root}/build/host and real recordings in {o.data}")
    results.mkdir(parents=True, exist_ok=True)
    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        for part in o.parts or PARTS[:-1]:
            start = time.monotonic()
            items = items_of(o)[part]
            done = dict(zip(items, pool.map(functools.partial(capture_item, o), items, items.values())))
            with gzip.open(results / f"{part}.json.gz", "wt") as file:
                json.dump(done, file)
            print(f"{part}: {len(done)} items in {time.monotonic() - start:.1f} s", flush=True)
            for name, step in ((name, s) for name, r in done.items() for s in r["steps"] if s.get("exit_code") != 0):
                print(f"  {name}: {step.get('missing', 'refused')}")
    return 0


def differences(before, after, path=""):
    """Path, before, after and difference of what is unequal; the difference is infinite unless both are numbers."""
    if isinstance(before, dict) and isinstance(after, dict):
        for key, value in before.items():
            yield from differences(value, after.get(key, "missing"), f"{path}/{key}")
    elif isinstance(before, list) and isinstance(after, list) and len(before) == len(after):
        for index, pair in enumerate(zip(before, after)):
            yield from differences(*pair, f"{path}/{index}")
    elif type(before) in (int, float) and type(after) in (int, float):
        if before != after:
            yield path, before, after, abs(after - before) / max(1, abs(before), abs(after))
    elif before != after or type(before) is not type(after):
        yield path, before, after, math.inf


def compare_costs(before, after):
    rows = [(*b, a[1]) for b, a in zip(before, after)]
    lines = [f"{what} {'grew' if now > was else 'shrank'}, {was} -> {now}" for what, was, _, now in rows if was != now]
    good = len(before) == len(after) and all(now <= most for *_, most, now in rows)
    return good, ("" if good else "differs: ") + ("; ".join(lines) or "same")


def compare_item(before, after, part, tolerance):
    if not before or not after:
        return False, f"differs: only in {'BEFORE' if before else 'AFTER'}"
    first = before["steps"][0], after["steps"][0]
    if "missing" in first[0]:
        return True, f"skipped: {first[0]['missing']} in BEFORE"
    if part in ("images", "step") and "missing" not in first[1]:
        return compare_costs(first[0]["output"], first[1]["output"])
    found = list(differences(before, after))
    last_digit = [f for f in found if f[0].startswith("/printed.csv/") and f[3] < 1.1e-9]
    if 0 < len(last_digit) <= 2 * len(before["printed.csv"]["soc"]) // 1000:
        found = [f for f in found if f not in last_digit] + [("last digit in printed.csv", 0, 0, 1e-12)]
    if not found:
        return True, "same"
    path, *_, largest = max(found, key=lambda f: f[3])
    if largest <= tolerance:
        return True, f"same to {largest:.1e} ({path})"
    path, was, now, _ = next(f for f in found if f[3] > tolerance)
    return False, f"differs: {path}: {was!s:.70} -> {now!s:.70} ({len(found)} differences, largest {largest:.1e})"


def compare(o, *folders):
    verdicts = []
    for part in o.parts or PARTS:
        files = (folder / f"{part}.json.gz" for folder in folders)
        before, after = (json.loads(gzip.decompress(f.read_bytes())) if f.exists() else {} for f in files)
        for name in {**before, **after}:
            verdict, line = compare_item(before.get(name), after.get(name), part, o.tolerance)
            verdicts.append(verdict)
            print(f"{part:12}{name:68} {line}")
    if not verdicts:
        raise FileNotFoundError(f"no results in {folders[0]} and {folders[1]}")
    print(f"{verdicts.count(False)} of {len(verdicts)} items differ")
    return 0 if all(verdicts) else 1


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("command", choices=("capture", "compare"))
    parser.add_argument("folders", nargs="+", type=pathlib.Path, help="capture: one to write to; compare: two")
    parser.add_argument("--parts", type=lambda text: text.split(","), help="some of " + ",".join(PARTS))
    parser.add_argument("--root", type=pathlib.Path, default=pathlib.Path(__file__).parents[1], help="built checkout")
    parser.add_argument("--data", type=pathlib.Path, help="real recordings, by default ROOT/../shared/data")
    parser.add_argument("--cases", type=int, default=120, help="how many cases of the benchmark")
    parser.add_argument("--tolerance", type=float, default=1e-12, help="where no bits are promised")
    o = parser.parse_args()
    o.root, o.data = o.root.resolve(), (o.data or o.root / ".." / "shared" / "data").resolve()
    if set(o.parts or ()) - set(PARTS) or len(o.folders) != (1 if o.command == "capture" else 2):
        parser.error("expected: capture DIR, or compare BEFORE AFTER, and parts that --help names")
    try:
        return (capture if o.command == "capture" else compare)(o, *o.folders)
    except (FileNotFoundError, RuntimeError) as error:
        print(f"behaviour: {error}", file=sys.stderr)
        return 2


if __name__ == "__main__":
    sys.exit(main())
