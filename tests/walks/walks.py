#!/usr/bin/env python3
"""The first minutes of ten people with the tool: what each types, and what he must and must not see.

    walks.py TOOL [--board] [--only NUMBER ...] [--page walks.md]

--board: the walks that need an emulated board, and not the others. The page has all commands with their output. Exit
status 1 if an expectation failed."""
import argparse
import sys

from walk import Walk

WALKS = []


def walk(who, goal, board=False):
    def register(steps):
        WALKS.append((who, goal, board, steps))
        return steps
    return register


def first_hour(w):
    w.does("Takes the first hour of the recorded shift.")
    w.cuts("evidence/recordings/forklift_shift.csv", "hour.csv", 3600)


def simulates(w, out, more, recording="hour.csv", initial_soc="0.98"):
    w.runs(f"bms simulate --cell table9 --recording {recording} --initial-soc {initial_soc} {more} --out {out}")
    w.exits(0)


@walk("A battery scientist with the tester's export", "Reads a log with other units, and identifies his cell.")
def scientist(w):
    w.does("Has a log in milliampere and millivolt, with temperatures in kelvin.")
    w.cuts("evidence/recordings/forklift_shift.csv", "tester.csv", 3600, lambda row: {
        "Time (s)": row["time_s"], "Current (mA)": f"{1000 * float(row['current_a']):.0f}",
        "Voltage (mV)": f"{1000 * float(row['voltage_v']):.0f}",
        "Temperature (K)": f"{273.15 + float(row['temperature_c']):.2f}"})
    w.runs("bms import tester.csv --out recording.csv")
    w.exits(0)
    values = w.text("recording.csv").split("\n")[1].split(",") if w.has("recording.csv") else []
    w.expects("numbers like 3.446, not 3.4460000000000002", values and all(len(v) <= 8 for v in values))
    w.runs("bms replay recording.csv --cell table9 --initial-soc 0.98 --repot page.html")
    w.exits(2)
    w.sees("did you mean --report\\?")
    w.runs("bms cell scale table9 --capacity-ah 100 --out truck.toml")
    w.runs("bms experiment forklift_shift --capacity-ah 100 --out profile.csv")
    w.runs("bms simulate --cell truck.toml --profile profile.csv --initial-soc 0.95 --noise-v 0.0005 --out truck.csv")
    w.runs("bms replay truck.csv --cell truck.toml --cuts 3")
    w.sees("3 cuts of ")
    w.does_not_see("\\|.*\\|.*\\|")
    w.does_not_see("not used")
    w.runs("bms identify --recording truck.csv --start truck.toml --window 0.6:0.4 --nodes 0.5 --out found.toml "
           "--json found.json")
    w.exits(0)
    parameters = {p["name"]: p for p in w.json("found.json")["parameters"]} if w.has("found.json") else {}
    w.number("R0 at 50 % in mOhm", lambda: 1000 * parameters["r0_ohm"]["value"], 0.794, 0.01)


@walk("A technician with a battery that loses charge", "Diagnoses a recording, with a later one as a check.")
def technician(w):
    first_hour(w)
    simulates(w, "monday.csv", "--with leakage:current_a=0.25 --noise-v 0.001")
    simulates(w, "tuesday.csv", "--with leakage:current_a=0.25 --noise-v 0.001 --seed 2", initial_soc="0.5")
    w.runs("bms diagnose --cell table9 --recording monday.csv --holdout tuesday.csv --initial-soc 0.98 --json r.json "
           "--report why.html")
    w.exits(0)
    w.sees("the cell loses 2[0-9][0-9] ")
    w.sees("This recording cannot distinguish them")
    w.does_not_see("not used")
    w.does_not_see("warning: .*starts at the first value")
    w.number("the start of the hold-out", lambda: w.json("r.json")["holdouts"][0]["initial_soc"], 0.5, 0.001)
    w.number("readings of the hold-out in its interval", lambda: w.json("r.json")["coverage"]["holdout"], 1, 0.06)
    w.runs("bms diagnose --cell table9 --recording monday.csv --holdout monday.csv")
    w.exits(2)
    w.sees("the same readings as in monday.csv")
    w.does("Mistypes the start of a healthy hour: 30 % for 98 %.")
    simulates(w, "healthy.csv", "--noise-v 0.001")
    w.runs("bms diagnose --cell table9 --recording healthy.csv --initial-soc 0.3")
    w.sees("the start of 30.0 % \\(--initial-soc\\) is contradicted")
    w.sees("CAUSE: .*6[78]\\.[0-9]")


@walk("A technician who suspects the current sensor", "Must not correct a good sensor.")
def ammeter(w):
    w.does("A cell with an internal short circuit; the sensor is perfect.")
    simulates(w, "shift.csv", "--with leakage:current_a=0.25 --noise-v 0.001", "evidence/recordings/forklift_shift.csv")
    w.runs("bms ammeter shift.csv --cell table9")
    w.exits(0)
    w.sees("The charge balance is short by 2[0-9][0-9] mA")
    w.sees("leakage, internal short circuit")
    w.does_not_see("current-offset")
    w.does_not_see("CURRENT_MEASURED_BY_USER")


@walk("The owner of an extended cell file", "One cell and one start in all commands; the findings are visible.")
def extended(w):
    first_hour(w)
    for cell in ("a123_26650_extended", "a123_esctoolbox_extended"):
        w.cuts("evidence/recordings/forklift_shift.csv", "small.csv", 3000, lambda row: {
            "time_s": row["time_s"], "current_a": f"{0.4 * float(row['current_a']):.4f}",
            "temperature_c": row["temperature_c"]})
        w.runs(f"bms simulate --cell {cell} --profile small.csv --initial-soc 1 --out z.csv")
        w.runs(f"bms replay z.csv --cell {cell} --json z.json")
        w.number("open-loop error in mV", lambda: 1000 * w.json("z.json")["voltage"]["open_loop_rmse_v"], 0, 0.001)
        w.runs(f"bms diagnose --cell {cell} --recording z.csv --json d.json")
        w.sees("NO_MISMATCH")
        w.number("the same of diagnose", lambda: 1000 * w.json("d.json")["baseline"]["recording"]["rmse_v"], 0, 0.001)
    simulates(w, "now.csv", "--with resistance_growth:fraction=0.3 --noise-v 0.001")
    simulates(w, "later.csv", "--noise-v 0.001 --seed 2")
    w.runs("bms diagnose --cell table9 --recording now.csv --initial-soc 0.98 --out extended.toml")
    w.sees("29\\.[0-9] ± 1\\.[0-9] %")
    w.runs("bms cell show extended.toml")
    w.sees("fraction 0?\\.?(0\\.29|0\\.3)")
    w.does("A hold-out that contradicts: healthy on Monday, 30 % more resistance on Tuesday.")
    w.runs("bms diagnose --cell table9 --recording later.csv --holdout now.csv --initial-soc 0.98")
    w.sees("NO_MISMATCH")
    w.sees("But the prediction of the hold-out now.csv is off by")
    w.sees("Diagnose both together")


@walk("An impatient user", "Ctrl-C gives no verdict.")
def impatient(w):
    w.cuts("evidence/recordings/forklift_shift.csv", "morning.csv", 12000)
    simulates(w, "monday.csv", "--with leakage:current_a=0.12 --noise-v 0.001", "morning.csv")
    w.runs("bms diagnose --cell table9 --recording monday.csv --initial-soc 0.98 --out x.toml --json r.json",
           interrupt_at_cpu_s=0.6)
    w.exits(130)
    w.sees("UNFINISHED")
    w.does_not_see("probability|No other known mechanism|CAUSE")
    w.expects("no cell file", not w.has("x.toml"))


def pack_csv(recording_rows, cells, change):
    head = ["time_s", "current_a", *[f"v_{n}" for n in range(1, cells + 1)], "temperature_c"]
    lines = [",".join(head)]
    for k, row in enumerate(recording_rows):
        volts = [change(n, k, float(row["current_a"]), float(row["voltage_v"])) for n in range(1, cells + 1)]
        lines.append(",".join([row["time_s"], row["current_a"], *[f"{v:.4f}" for v in volts], "20"]))
    return "\n".join(lines) + "\n"


@walk("A technician with a pack of eight cells", "Finds the cell, and reads no limit that no cell can have.")
def pack(w):
    first_hour(w)
    rows = []
    w.cuts("evidence/recordings/forklift_shift.csv", "hour.csv", 3600, lambda row: rows.append(row) or row)
    spread = lambda n, k: 1e-3 * (((7919 * n + 104729 * k) % 2001) / 1000 - 1) + 2e-4 * n
    w.writes("good.csv", pack_csv(rows, 8, lambda n, k, a, v: v + spread(n, k)))
    w.writes("bad.csv", pack_csv(rows, 8, lambda n, k, a, v: v + spread(n, k) + (0.006 * a if n == 3 else 0)))
    w.runs("bms diagnose --pack table9 --recording bad.csv --initial-soc 0.98")
    w.exits(0)
    w.sees("[Cc]ell 3")
    w.runs("bms diagnose --pack table9 --recording good.csv --initial-soc 0.98 --json p.json")
    w.exits(0)
    w.does_not_see("[0-9]{4,}\\.?[0-9]* (%|mV)")
    w.does_not_see("\\b(nan|inf)\\b")
    w.does("Gives the voltage of all cells, and times in milliseconds.")
    w.writes("whole.csv", "time_s,current_a,voltage_v\n" + "".join(
        f"{k},{row['current_a']},{16 * float(row['voltage_v']):.3f}\n" for k, row in enumerate(rows)))
    w.runs("bms diagnose --cell table9 --recording whole.csv")
    w.sees("DATA_FAULT")
    w.sees("16 cells in series")
    w.writes("milli.csv", "time_s,current_a,voltage_v\n" + "".join(
        f"{1000 * k},{row['current_a']},{row['voltage_v']}\n" for k, row in enumerate(rows)))
    w.runs("bms diagnose --cell table9 --recording milli.csv")
    w.sees("DATA_FAULT")
    w.sees("milliseconds")


@walk("A fleet operator", "Three trucks, a broken file: every finding is listed, with what is certain of it.")
def fleet(w):
    first_hour(w)
    manifest = ["recording,cell,truck,cell_index,started_at"]
    for k, growth in enumerate((0.1, 0.25, 0.4)):
        simulates(w, f"t1_{k}.csv", f"--with resistance_growth:fraction={growth} --noise-v 0.001 --seed {k}")
        manifest.append(f"t1_{k}.csv,table9,T1,1,2026-0{1 + 2 * k}-10")
    simulates(w, "t2.csv", "--noise-v 0.001 --seed 7")
    simulates(w, "t3.csv", "--with leakage:current_a=0.25 --noise-v 0.001 --seed 8")
    w.writes("broken.csv", "time_s,current_a\n0,1\n")
    manifest += ["t2.csv,table9,T2,1,2026-05-10", "t3.csv,table9,T3,1,2026-05-10", "broken.csv,table9,T2,1,2026-05-11"]
    w.writes("depot.csv", "\n".join(manifest) + "\n")
    w.runs("bms fleet run --manifest depot.csv --task diagnose --out depot -- --initial-soc 0.98")
    w.exits(0)
    w.sees("6 recordings: 0 finished before, 6 now, 1 of these with an error")
    w.sees("Verdicts: [0-9]+ [A-Z_]+.*1 without a verdict")
    w.runs("bms fleet report depot --report depot.html --json depot.json")
    w.exits(0)
    w.sees("Truck T1, cell 1: ")
    w.sees("Truck T3, cell 1: .*1 of 1 shift.*error of the size.*not confirmed: a healthy one is named")
    w.does_not_see("more often than chance")
    w.sees("broken.csv: .*no column 'voltage_v'")
    w.sees("T1, cell 1: growth of the resistance .*50 %.*a trend needs 4")


@walk("Somebody in a hurry", "Each mistake is one line that says what was expected.")
def mistakes(w):
    first_hour(w)
    for command, pattern in (
            ("bms replay nothing.csv --cell table9", "nothing.csv:1: .*expected"),
            ("bms diagnos --recording hour.csv", "did you mean"),
            ("bms diagnose --cell tabel9 --recording hour.csv", "table9"),
            ("bms diagnose --cell table9 --recording hour.csv --initial-soc 95", "95.*expected|0"),
            ("bms simulate --cell table9 --recording hour.csv --with hysteresis:half_gap_v=0.01 --out x.csv",
             "no such mechanism 'hysteresis'"),
            ("bms fleet report hour.csv", "expected"),
            ("bms hil --board netduinoplus2 --profile hour.csv --fault cell_open=3@10-20", "this board has one cell")):
        w.runs(command)
        w.exits(2)
        w.sees(pattern)
        w.expects("one line", len(w.output.strip().splitlines()) == 1)
    w.does("Has a download that broke off.")
    whole = (w.folder / "evidence/recordings/a123_26650/udds_P25_A002.csv.gz").read_bytes()
    (w.folder / "cut.csv.gz").write_bytes(whole[:20000])
    w.runs("bms replay cut.csv.gz --cell a123_26650")
    w.exits(2)
    w.sees("truncated gzip input")


@walk("A technician with the battery's own CAN log", "The log needs no options; missing readings are missing.", True)
def own_log(w):
    w.cuts("evidence/recordings/forklift_shift.csv", "part.csv", 400)
    w.runs("bms hil --board stm32f405_forklift --cell table9 --cells 8 --profile part.csv --sample-s 1 "
           "--fault cell_open=3@200-260 --candump truck.log")
    w.runs("bms import truck.log --out truck.csv")
    w.exits(0)
    rows = w.text("truck.csv").split("\n") if w.has("truck.csv") else []
    w.expects("no cell reads 8.191 V", rows and not any("8.19" in row for row in rows))
    w.runs("bms diagnose --pack table9 --recording truck.log --initial-soc 0.95")
    w.exits(0)
    w.does_not_see("differs from its neighbours by 4[0-9][0-9]")
    w.runs("bms monitor file:truck.log --csv monitor.csv --quiet")
    w.exits(0)
    w.expects("the columns of a recording of a pack", w.text("monitor.csv").find("v_1") > 0)
    w.runs("bms diagnose --pack table9 --recording monitor.csv --initial-soc 0.95")
    w.exits(0)


@walk("A firmware engineer", "Runs the firmware in the loop with a broken wire, and looks at the page.", True)
def firmware(w):
    w.cuts("evidence/recordings/forklift_shift.csv", "part.csv", 400)
    w.runs("bms hil --board stm32f405_forklift --cell table9 --profile part.csv --sample-s 1 "
           "--fault cell_open=3@200-260 --report loop.html --json loop.json")
    w.exits(0)
    w.sees("reported every injected fault in time")
    page = w.text("loop.html") if w.has("loop.html") else "-2147"
    w.expects("a missing cell is missing in the page, not -2147 V", "-2147" not in page)
    w.expects("the page says that the board is emulated", "Emulated board in the loop" in page)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("tool")
    parser.add_argument("--board", action="store_true")
    parser.add_argument("--only", type=int, nargs="+", help="numbers of walks")
    parser.add_argument("--page")
    options = parser.parse_args()
    lines, failed, expected = [], 0, 0
    for number, (who, goal, board, steps) in enumerate(WALKS, 1):
        if (number not in options.only) if options.only else board != options.board:
            continue
        w = Walk(options.tool, who, goal)
        try:
            steps(w)
            lines += w.page(number)
            checks = [good for step in w.steps for good in step["expected"]]
            expected, failed = expected + len(checks), failed + w.failed
            print(f"{number:2} {who}: {len(checks) - w.failed} of {len(checks)}")
            for step in w.steps:
                for text, good in step["expected"]:
                    if not good:
                        print(f"   FAILED after '{step.get('command', step.get('text'))}': {text}\n"
                              f"      {step.get('output', '').strip()[:600]}")
        finally:
            w.close()
    about = "The first minutes of ten people with the tool: what each types, what he sees, and what was expected of it."
    title = ["# Ten walks", "", about, "Written by `tests/walks/walks.py`.", ""]
    if options.page:
        with open(options.page, "w", encoding="utf-8") as page:
            page.write("\n".join(title + lines))
    print(f"{expected - failed} of {expected} expectations hold")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
