"""Further cases of field_cases.py: batteries with a known truth, pulse tests, logs with their own ways."""
import bisect
import random

import field_inputs as make
from field_steps import case, diagnoses_pack, lfp, mechanisms


def pulse_test(cell, capacity_ah, step=1.0, soc_step=0.1, spikes=(), noise_v=0.0003, seed=1):
    """HPPC from full: a rest of an hour at each state of charge, a discharge pulse, a rest, a charge pulse."""
    rng = random.Random(seed)
    rows, t = [], 0.0
    plan = []
    for _ in range(round(1 / soc_step) - 1):
        plan += [(0, 3600, 30), (-capacity_ah, 30, step), (0, 120, step), (0.5 * capacity_ah, 30, step),
                 (0, 120, step), (-capacity_ah / 2, soc_step * 7200, 10)]
    for a, seconds, row in plan:
        for _ in range(round(seconds / row)):
            v = cell.step(a, row)
            t += row
            rows.append([round(t, 3), a, round(v + rng.gauss(0, noise_v), 5)])
    for k in spikes:
        rows[k][2] = 0.1 if k % 2 else 4.9
    return rows


def identifies(w, name, rows, capacity_ah, limits):
    w.writes(name, make.table(["time_s", "current_a", "voltage_v"], rows))
    w.runs(f"bms identify --ocv-from-rests --capacity-ah {capacity_ah} --initial-soc 1 --recording {name} {limits} "
           "--out c.toml --json i.json")
    w.exits(0)


def parameter(w, name):
    """Median over the state of charge from 20 to 80 %."""
    values = sorted(p["value"] for p in w.json("i.json")["parameters"] if p["name"] == name and 0.2 <= p["soc"] <= 0.8)
    return values[len(values) // 2]


LFP_LIMITS = "--voltage-min-v 2.5 --voltage-max-v 3.6 --charge-current-max-a 100 --discharge-current-max-a 200"
NMC_LIMITS = "--voltage-min-v 2.5 --voltage-max-v 4.2 --charge-current-max-a 60 --discharge-current-max-a 120"


@case("09", "a pulse test of an NMC cell, with rests every 10 %", "between the rests no curve of an LFP cell",
      "the shape of table9")
def nmc_pulses(w):
    cell = make.Cell(31, 1.0, 0.0013, r1_ohm=0.001, tau_s=30, ocv=make.ocv_nmc)
    identifies(w, "hppc.csv", pulse_test(cell, 31), 31, NMC_LIMITS)
    w.runs("bms cell show c.toml --json s.json")
    w.exits(0)

    def worst_mv():
        curve = w.json("s.json")["ocv"]["curve"] if "curve" in w.json("s.json").get("ocv", {}) else None
        at = curve or list(zip(*ocv_of(w.text("c.toml"))))
        return max(1e3 * abs(interpolated(at, k / 100) - make.ocv_nmc(k / 100)) for k in range(15, 96))
    w.number("largest error of the OCV between 15 and 95 %, mV", worst_mv, 0, 15)


def ocv_of(toml):
    """Edges and OCV there of a cell file."""
    import tomllib
    ocv = tomllib.loads(toml)["ocv"]
    soc, b0, b1 = ocv["soc"], ocv["b0_v"], ocv["b1_v"]
    volts = [b0[k] + b1[k] * soc[k] for k in range(len(b0))] + [b0[-1] + b1[-1] * soc[-1]]
    return soc, volts


def interpolated(points, x):
    xs = [p[0] for p in points]
    k = min(max(bisect.bisect(xs, x), 1), len(xs) - 1)
    (x0, y0), (x1, y1) = points[k - 1], points[k]
    return y0 + (y1 - y0) * (x - x0) / (x1 - x0)


@case("16", "a current sensor with 6 % too little gain, next to a tester's", "the gain, and its correction", "right")
def gain_error(w):
    lfp(w, 30)
    rng = random.Random(16)
    cell, rows = make.Cell(30, 0.9, 0.0012), []
    for k in range(9000):
        a = 0.0 if k % 1500 < 300 else -20.0 if k % 1500 < 1100 else 10.0
        v = cell.step(a, 1.0)
        rows.append((k, round(0.94 * a + rng.gauss(0, 0.005), 3), a, round(v + rng.gauss(0, 0.001), 4)))
    w.writes("load.csv", make.table(["time_s", "current_a", "current_ref_a", "voltage_v"], rows))
    w.runs("bms ammeter load.csv --cell lfp.toml --json a.json")
    w.exits(0)
    w.sees(r"it reads (5\.9|6\.0)[0-9]* \+- [0-9.]+ % too little")


@case("18, constant", "the same sense wire, but its contact is bad all the time", "named, with its size",
      "size 15 % low")
def constant_wire(w):
    lfp(w, 105)
    def wire(t, volts):
        volts[6], volts[7] = volts[6] + 0.06, volts[7] - 0.06
        return volts
    pack = [make.Cell(105, 0.6 + 0.001 * c, 0.0004) for c in range(16)]
    diagnoses_pack(w, make.pack(pack, 3600, 2, make.duty(40, seed=8), wire=wire))
    w.exits(0)
    w.expects("the wire between cells 7 and 8 alone", mechanisms(w) == [("sense_wire", 7)])
    w.number("its size, mV", lambda: 1e3 * w.json("d.json")["mechanisms"][0]["parameters"][0]["value"], 60, 4)


@case("21", "0.4 A that the sensor does not see, and a dead band", "the drain, and the dead band", "right")
def hidden_drain(w):
    rng = random.Random(21)
    w.runs("bms cell scale nmc_lg_m50 --capacity-ah 65 --out nmc.toml")
    rows = []
    for k in range(1440):
        t = 120.0 * k
        a = -10.0 if (t % 43200) < 5400 else 8.0 if 21600 < t % 43200 < 26000 else 0.0
        rows.append((t, a))
    w.writes("load.csv", make.table(["time_s", "current_a"], [(t, a - 0.4) for t, a in rows]))
    w.runs("bms simulate --cell nmc.toml --profile load.csv --initial-soc 0.8 --noise-v 0.001 --out true.csv")
    w.exits(0)
    volts = [float(line.split(",")[2]) for line in w.text("true.csv").splitlines() if line[:1].isdigit()]
    w.writes("days.csv", make.table(["time_s", "current_a", "voltage_v"], [
        (t, round(a + rng.gauss(0, 0.02), 2) if a else 0.0, f"{v:.4f}") for (t, a), v in zip(rows, volts)]))
    w.runs("bms diagnose --cell nmc.toml --recording days.csv --initial-soc 0.8 --json d.json")
    w.exits(0)
    w.sees("loses [0-9.]+ ± [0-9.]+ mA all the time|reads high by|reads low by")
    w.number("the drain or the offset, A", lambda: abs(
        w.json("d.json")["mechanisms"][0]["parameters"][0]["value"]), 0.4, 0.05)


@case("23", "11.6 mohm in the lead of the pack's voltmeter", "named, and no cell", "right")
def lead(w):
    lfp(w, 60)
    pack = make.pack([make.Cell(60, 0.7 + 0.001 * c, 0.0008) for c in range(6)], 5400, 1, make.duty(40, seed=23))
    w.writes("pack.csv", make.table(["time_s", "current_a", "pack_voltage_v"] + [f"v_{k + 1}" for k in range(6)], [
        (f"{t:g}", f"{a:.2f}", f"{sum(v) + 0.0116 * a:.3f}", *(f"{x:.3f}" for x in v)) for t, a, v in pack]))
    w.runs("bms diagnose --pack lfp.toml --recording pack.csv --json d.json")
    w.exits(0)
    w.expects("the pack's connection alone", [(m["id"], m["cell"]) for m in w.json("d.json")["mechanisms"]] in (
        [("joint_resistance", None)], [("pack_joint", None)], [("pack_voltage", None)]))
    w.sees(r"a resistance in a connection \(11[0-9]{3} ± [0-9]+ µohm")


@case("24", "a pulse test with single odd readings", "they are left out, and counted", "right")
def spikes(w):
    cell = make.Cell(100, 1.0, 0.000204, r1_ohm=0.0009, tau_s=85)
    identifies(w, "hppc.csv", pulse_test(cell, 100, spikes=[200, 1501, 2900, 4003]), 100, LFP_LIMITS)
    w.sees("single voltages that differ from those before and after them under the same current, left out: 4")
    w.number("R0, mohm", lambda: 1e3 * parameter(w, "r0_ohm"), 0.204, 0.008)
    w.number("RMS error, mV", lambda: 1e3 * w.json("i.json")["estimation"]["rmse_v"], 0, 6)


@case("25", "a pulse test with rows from 10 ms to 600 s", "the same parameters", "right")
def fine_rows(w):
    cell = make.Cell(100, 1.0, 0.000204, r1_ohm=0.0009, tau_s=85)
    rows, t = [], 0.0
    plan = []
    for _ in range(9):
        plan += [(0, 3600, 600), (-100, 1, 0.01), (-100, 29, 1), (0, 1, 0.01), (0, 119, 1), (50, 30, 1), (0, 120, 1),
                 (-50, 720, 60)]
    for a, seconds, row in plan:
        for _ in range(round(seconds / row)):
            v = cell.step(a, row)
            t += row
            rows.append((round(t, 3), a, round(v, 5)))
    identifies(w, "hppc.csv", rows, 100, LFP_LIMITS)
    w.number("R0, mohm", lambda: 1e3 * parameter(w, "r0_ohm"), 0.204, 0.008)
    w.number("R1, mohm", lambda: 1e3 * parameter(w, "r1_ohm"), 0.9, 0.09)
    w.number("time constant, s", lambda: parameter(w, "r1_ohm") * parameter(w, "c1_f"), 85, 15)


@case("17, ThingSet", "lines of JSON of a controller", "refused, with what was expected", "refused")
def thingset(w):
    w.writes("log.jsonl", "".join(
        f'{{"rBat_V":23.19,"rBat_A":0.00,"rCells_V":[3.757,3.88{k % 3},3.888],"rSOC_pct":42.0}}\n' for k in range(20)))
    w.runs("bms import log.jsonl --out r.csv")
    w.exits(2)
    w.sees(r"log.jsonl:1: .*expected")
    w.expects("one line", len(w.output.strip().splitlines()) == 1)
    w.expects("nothing is left", not w.has("r.csv"))


@case("37, extended", "the empty cell, with the extended cell file", "below 5 %, and the capacity is said",
      "24 % at rows of 10 s, no word")
def empty_extended(w):
    w.runs("bms cell scale a123_26650_extended --capacity-ah 100 --out e.toml")
    w.runs("bms cell scale a123_26650 --capacity-ah 72 --out true.toml")
    for row in (1, 10):
        rows, soc, t = [], 1.0, 0
        while soc > -0.01:
            a = -30.0 if t % 900 < 600 else -10.0
            rows.append((t, a))
            soc += a * row / 3600 / 72
            t += row
        w.writes("profile.csv", make.table(["time_s", "current_a"], rows))
        w.runs("bms simulate --cell true.toml --profile profile.csv --initial-soc 1 --noise-v 0.001 --out log.csv")
        w.cuts("log.csv", "cut.csv", 1e9, lambda row: {k: row[k] for k in ("time_s", "current_a", "voltage_v")})
        w.runs("bms replay cut.csv --cell e.toml --initial-soc 1 --json r.json")
        w.exits(0)
        w.number(f"state of charge at the end, rows of {row} s, %", lambda: 100 * w.json("r.json")["soc"]["final"], 1,
                 4)
        w.number("capacity, Ah", lambda: w.json("r.json")["capacity"]["value_ah"], 72, 4)


@case("03, ESPHome", "the console of ESPHome", "read", "refused")
def console(w):
    text = ""
    for k in range(300):
        clock = f"{13 + k // 720:02}:{k * 5 // 60 % 60:02}:{k * 5 % 60:02}"
        a = 0.0 if k < 20 else -30.0 if k % 40 < 25 else 15.0
        values = [("current", a, "A", 2)] + [(f"cell voltage {c}", 3.3 + 0.001 * c + 0.0004 * a, "V", 3)
                                             for c in (1, 2, 3, 4)]
        for name, value, unit, digits in values:
            text += f"[{clock}][D][sensor:125]: 'jk-bms {name}': Sending state {value:.5f} {unit} with {digits} " \
                    "decimals of accuracy\n"
        text += f"[{clock}][D][text_sensor:064]: 'jk-bms errors': Sending state ''\n"
    w.writes("esphome.log", text)
    w.runs("bms import esphome.log --out r.csv")
    w.exits(0)
    w.sees(r"\b300 rows.*-30 to 15 A")
    w.expects("four cells", w.has("r.csv") and "v_4" in w.text("r.csv"))
