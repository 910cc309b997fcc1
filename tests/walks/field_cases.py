#!/usr/bin/env python3
"""What people bring to the tool, as public reports describe it: each kind of log, what came before, what comes now.

    field_cases.py TOOL [--only ID ...] [--page FILE.md] [--shared FOLDER]

More cases are in field_batteries.py; field_inputs.py makes the inputs. Logs that people published are used as well
where a folder has them (--shared), and are skipped with a word where it has not. Exit status 1 if an expectation
failed."""
import argparse
import gzip
import importlib
import pathlib
import random
import sys

import field_inputs as make
from field_steps import BUS, CASES, bus, case, column, diagnoses_pack, lfp, mechanisms, reads
from walk import ROOT, Walk

# --- CAN


@case("36", "DBC file as editors write it, with the list NS_ and SG_MUL_VAL_ in it", "read", "refused: not a DBC line")
def standard_dbc(w):
    bus(w)
    w.writes("bus.log", make.candump(make.signal()))
    reads(w, f"bms import bus.log {BUS} --out r.csv")


@case("31", "extended multiplexing (m1M, SG_MUL_VAL_)", "each cell from its page", "refused; the first multiplexor")
def extended_multiplexing(w):
    bus(w, 'BO_ 257 Info: 8 BMS\n SG_ Page M : 0|8@1+ (1,0) [0|255] "" X\n SG_ Cell m1M : 8|8@1+ (1,0) [0|255] "" X\n'
        ' SG_ Serial m0 : 16|16@1+ (1,0) [0|65535] "" X\n SG_ V1 m0 : 16|16@1+ (1,0) [0|5000] "mV" X\n'
        ' SG_ V2 m1 : 16|16@1+ (1,0) [0|5000] "mV" X\n\nSG_MUL_VAL_ 257 Cell Page 1-1;\n'
        "SG_MUL_VAL_ 257 Serial Page 0-0;\nSG_MUL_VAL_ 257 V1 Cell 0-0;\nSG_MUL_VAL_ 257 V2 Cell 1-1;\n")
    text = ""
    for t, a, v in make.signal(60):
        text += make.candump([(t, a, v)])
        for page, cell, value in ((0, 0, 999), (1, 0, 3301), (1, 1, 3302)):
            data = bytes([page, cell]) + value.to_bytes(2, "little") + bytes(4)
            text += f"({1727438342 + t + 0.1:.6f}) can0 101#{data.hex().upper()}\n"
    w.writes("bus.log", text)
    reads(w, "bms import bus.log --dbc bus.dbc --map current_a=Current --map v_1=V1 --map v_2=V2 --out r.csv",
          "60 rows")
    w.number("last v_1", lambda: column(w, "r.csv", "v_1")[-1], 3.301, 1e-9)
    w.number("last v_2", lambda: column(w, "r.csv", "v_2")[-1], 3.302, 1e-9)


@case("28", "two batteries with the same identifiers on two channels", "refused, or --channel", "mixed silently")
def two_channels(w):
    bus(w)
    rows = make.signal()
    text = make.candump(rows) + make.candump([(t + 0.5, 2 * a, v) for t, a, v in rows], "can1")
    w.writes("two.log", "\n".join(sorted(text.splitlines())) + "\n")
    w.runs(f"bms import two.log {BUS} --out r.csv")
    w.exits(2)
    w.sees("is on several channels, expected --channel with one of: can0, can1")
    reads(w, f"bms import two.log {BUS} --channel can1 --out r.csv", "600 rows, .*-80 to 40 A")


@case("32", "J1939 values that mean 'not available'", "missing", "1,676 A, integrated")
def not_available(w):
    w.writes("bus.dbc", 'BU_: BMS\nBO_ 2566844926 Battery: 8 BMS\n'
             ' SG_ Current : 0|16@1+ (0.05,-1600) [-1600|1612.75] "A" X\n'
             ' SG_ CellVoltage : 16|16@1+ (0.001,0) [0|64.255] "V" X\n')
    text = ""
    for t, a, v in make.signal(120):
        data = b"\xff" * 8 if t % 20 == 5 else round((a + 1600) / 0.05).to_bytes(2, "little") + \
            round(v * 1e3).to_bytes(2, "little") + b"\xff" * 4
        text += f"({1727438342 + t}.000000) can0 18FEF1FE#{data.hex().upper()}\n"
    w.writes("j.log", text)
    reads(w, f"bms import j.log {BUS} --out r.csv", "120 rows, .*-40 to 0 A")
    w.sees("'not available', or are outside the range in the DBC file: 12 of 240")


@case("12", "cells that are sent 20 to 44 ms after the current", "paired with it", "paired 0.98 s late")
def pairing(w):
    bus(w, 'BO_ 257 Cells: 8 BMS\n SG_ V1 : 0|16@1+ (1,0) [0|6000] "mV" X\n')
    text = ""
    for t, a, v in make.signal(600):
        text += make.candump([(t, a, v)])
        cell = round(v * 1e3).to_bytes(2, "little") + bytes(6)
        text += f"({1727438342 + t + 0.03:.6f}) can0 101#{cell.hex().upper()}\n"
    w.writes("mux.log", text)
    reads(w, "bms import mux.log --dbc bus.dbc --map current_a=Current --map voltage_v=V1 --out r.csv")
    w.sees("to 0.03 s after its current")
    a, v = column(w, "r.csv", "current_a"), column(w, "r.csv", "voltage_v")
    k = a.index("-40")
    w.number("fall of the voltage in the row of the step, mV", lambda: 1e3 * (float(v[k - 1]) - float(v[k])), 24, 2)


@case("14", "PEAK, BUSMASTER and GVRET texts", "read", "refused, misleading hint")
def can_texts(w):
    bus(w)
    rows = make.signal(60)
    spaced = [(t, " ".join(f"{b:02X}" for b in make.pack_bytes(a, v))) for t, a, v in rows]
    w.writes("b.log", "***BUSMASTER Ver 3.2.2***\n***HEX***\n***SYSTEM MODE***\n" +
             "".join(f"10:{t // 60:02}:{t % 60:02}:0000 Rx 1 0x100 s 8 {b}\n" for t, b in spaced))
    w.writes("p.trc", ";$FILEVERSION=1.1\n" +
             "".join(f"{k + 1})  {1e3 * t:.1f}  Rx  0100  8  {b}\n" for k, (t, b) in enumerate(spaced)))
    w.writes("g.csv", "Time Stamp,ID,Extended,Dir,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8\n" +
             "".join(f"{t * 1000000},00000100,false,Rx,0,8,{b.replace(' ', ',')},\n" for t, b in spaced))
    for name in ("b.log", "p.trc", "g.csv"):
        reads(w, f"bms import {name} {BUS} --out r.csv", "60 rows")


@case("11", "candump with flags, error frames and CAN FD", "read", "partly refused")
def candump_variants(w):
    bus(w)
    rows = make.signal(60)
    w.writes("fd.log", "".join(f"({1727438342 + t}.000000) can0 100##1{make.pack_bytes(a, v).hex().upper()}\n"
                               for t, a, v in rows))
    w.writes("view.log", "".join(f" ({1727438342 + t}.000000)  can0  100   [8]  " + " ".join(
        f"{b:02X}" for b in make.pack_bytes(a, v)) + "\n" for t, a, v in rows) +
        " (1727438999.000000)  can0  20000080   [8]  00 00 00 00 00 00 00 00   ERRORFRAME\n")
    for name in ("fd.log", "view.log"):
        reads(w, f"bms import {name} {BUS} --out r.csv", "60 rows")


@case("13", "29-bit identifiers with their flag in the DBC file", "read", "read")
def extended_ids(w):
    w.writes("bus.dbc", make.DBC_HEAD + make.DBC_PACK.replace("BO_ 256", "BO_ 2147486001"))
    w.writes("fox.log", make.candump(make.signal(60), ident="00000931"))
    reads(w, f"bms import fox.log {BUS} --out r.csv", "60 rows")


# --- tables


@case("08", "a header that ends with a tab, and rows that do not", "read", "refused: 32 fields, expected 33")
def trailing_separator(w):
    w.writes("t.txt", "time_s\tcurrent_a\tvoltage_v\t\n" + "".join(f"{t}\t{a}\t{v:.4f}\n" for t, a, v in make.signal()))
    reads(w, "bms import t.txt --out r.csv")


@case("04", "single rows with time 0, or a little back", "left out, and said", "whole file refused")
def time_zero(w):
    rows = make.signal()
    w.writes("t.csv", make.table(["time_s", "current_a", "voltage_v"],
                                 [(0 if t == 300 else t - 1.4 if t == 400 else t, a, f"{v:.4f}") for t, a, v in rows]))
    reads(w, "bms import t.csv --out r.csv", "598 rows")
    w.sees("rows whose time is 0 or a little before that of the row above: 2")
    w.expects("the written file says what was repaired",
              w.has("r.csv") and w.text("r.csv").startswith("# repaired: rows"))


@case("06", "a clock without a date over midnight; daylight saving", "read, said", "refused")
def midnight(w):
    def clock(t):
        return f"{(23 * 3600 + 3000 + t) // 3600 % 24:02}:{(3000 + t) // 60 % 60:02}:{t % 60:02}"
    head = ["Time", "Current (A)", "Voltage (V)"]
    rows = make.signal()
    w.writes("m.csv", make.table(head, [(clock(2 * t), a, f"{v:.4f}") for t, a, v in rows]))
    reads(w, "bms import m.csv --out r.csv", r"600 rows, 0.33 h")
    w.sees("midnights that the clock passes without a date: 1")

    def autumn(t):
        s = 2 * 3600 + 3000 + 2 * t
        s -= 3600 if s >= 3 * 3600 else 0
        return f"2025-10-26 {s // 3600:02}:{s // 60 % 60:02}:{s % 60:02}"
    w.writes("a.csv", make.table(["timestamp"] + head[1:], [(autumn(t), a, f"{v:.4f}") for t, a, v in rows]))
    reads(w, "bms import a.csv --out r.csv", r"600 rows, 0.33 h")
    w.sees("hours by which the clock goes back")


@case("27", "date and time in two columns, cA and cV", "joined; units", "date dropped silently")
def units_and_dates(w):
    rows = make.signal()
    days = [("09.01.2023" if k < 300 else "10.01.2023", f"08:{t % 300 // 60:02}:{t % 60:02}") for k, (t, _, _) in
            enumerate(rows)]
    w.writes("d.csv", "Date;Time;Current[A];Voltage[V]\n" + "".join(
        f"{d};{c};{a:.1f};{v:.4f}\n".replace(".", ",").replace(d.replace(".", ","), d)
        for (d, c), (_, a, v) in zip(days, rows)))
    reads(w, "bms import d.csv --out r.csv", r"600 rows, 24\.08 h")
    w.writes("c.csv", make.table(["interval", "current (cA)", "voltage (cV)"],
                                 [(1000 * t, round(100 * a), round(100 * v)) for t, a, v in rows]))
    reads(w, "bms import c.csv --map time_s=interval --unit time_s=ms --out r.csv", "600 rows, .*-40 to 20 A, 3.2")


@case("overflow", "a tester's overflow (3.4e38) in its first row", "missing, with a warning", "refused")
def overflow(w):
    rows = make.signal()
    w.writes("o.csv", make.table(["time_s", "current_a", "voltage_v"],
                                 [(t, "3.4028235E+38" if t == 0 else a, f"{v:.4f}") for t, a, v in rows]))
    reads(w, "bms import o.csv --out r.csv")
    w.sees("overflow")


@case("02", "current and cells in different rows", "aligned, or said", "nan to nan V")
def different_rows(w):
    lines = ["Time,Battery voltage,Battery current,Cell temp min,Cell  1 voltage,Cell  2 voltage"]
    for t, a, v in make.signal():
        lines.append(f"{1000 * t + 123},{2 * v:.2f},{-a},,,")
        if t % 2 == 0:
            lines.append(f"{1000 * t + 333},,,21.5,{v:.4f},{v:.4f}")
    w.writes("s.csv", "\n".join(lines) + "\n")
    reads(w, "bms import s.csv --discharge-positive --out r.csv", "600 rows, .*-40 to 20 A, 3.1")
    w.sees("current and voltages are in different rows")
    w.does_not_see("nan to nan")


@case("01", "LeafSpy: cells in mV, 'none' as missing", "one unit for all cells", "the hint leads back to itself")
def leafspy(w):
    rows = make.signal()
    head = ["Date/Time", "Gids", "Pack Volts", "Pack Amps"] + [f"CP{k}" for k in range(1, 13)]
    w.writes("l.csv", make.table(head, [
        (f"01/02/2024 10:{t // 60:02}:{t % 60:02}", 620000, f"{12 * v:.2f}", -a,
         *("none" if t == 9 else round(1e3 * v) for _ in range(12))) for t, a, v in rows]))
    reads(w, "bms import l.csv --discharge-positive --out r.csv", r"600 rows, .*3\.[12]\d+ to 3\.\d+ V, 12 cells")
    w.writes("l.map", "time_s=Date/Time\ncurrent_a=Pack Amps\nv_*=CP*\n")
    reads(w, "bms import l.csv --map-file l.map --unit v_*=mV --unit current_a=A --discharge-positive --out r.csv",
          r"600 rows, .*3\.[12]\d+ to 3\.\d+ V, 12 cells")


@case("03", "a long table of a home (entity_id, state, last_changed)", "pivoted", "refused, misleading hint")
def long_table(w):
    lines = ["entity_id,state,last_changed"]
    for t, a, v in make.signal(120):
        at = f"2025-08-31T22:{t // 12:02}:{5 * t % 60:02}.301Z"
        lines += [f"sensor.bms_current,{'unavailable' if t == 7 else a},{at}",
                  f"sensor.bms_cell_voltage_1,{v:.3f},{at}", f"sensor.bms_cell_voltage_2,{v:.3f},{at}"]
    w.writes("h.csv", "\n".join(lines) + "\n")
    reads(w, "bms import h.csv --out r.csv", r"120 rows, 0\.17 h, -40 to 0 A, .*2 cells")


@case("pack voltage", "voltage_v is the pack's, next to v_1 to v_N", "read", "refused with a hint to what is there")
def pack_voltage(w):
    w.writes("p.csv", make.table(["time_s", "current_a", "voltage_v", "v_1", "v_2", "v_3"],
                                 [(t, a, f"{3 * v:.3f}", *(3 * [f"{v:.4f}"])) for t, a, v in make.signal()]))
    reads(w, "bms import p.csv --out r.csv", r"600 rows, .*3\.[12]\d+ to 3\.\d+ V, 3 cells")
    w.sees("it is used as pack_voltage_v")


# --- judgements


@case("37", "an empty cell with 28 % less capacity, rows of 10 s", "below 5 %, and the capacity is said",
      "23.7 ± 5.1 %, no word")
def empty_cell(w):
    lfp(w, 100)
    w.runs("bms cell scale a123_26650 --capacity-ah 72 --out true.toml")
    rows, soc, t = [], 1.0, 0
    while soc > -0.01:
        a = -30.0 if t % 900 < 600 else -10.0
        rows.append((t, a))
        soc += a * 10 / 3600 / 72
        t += 10
    w.writes("profile.csv", make.table(["time_s", "current_a"], rows))
    w.runs("bms simulate --cell true.toml --profile profile.csv --initial-soc 1 --noise-v 0.001 --out log.csv")
    w.cuts("log.csv", "cut.csv", 1e9, lambda row: {k: row[k] for k in ("time_s", "current_a", "voltage_v")})
    w.runs("bms replay cut.csv --cell lfp.toml --initial-soc 1 --json r.json")
    w.exits(0)
    w.number("state of charge at the end, %", lambda: 100 * w.json("r.json")["soc"]["final"], 1.5, 3.5)
    w.number("capacity, Ah", lambda: w.json("r.json")["capacity"]["value_ah"], 72, 3)
    w.sees("The cell holds 7[0-4]")


def soc_log(w, fault):
    cell, soc, rows = make.Cell(100, 0.5, 0.0006), 0.5, []
    load = make.duty(60, seed=5)
    for t in range(0, 7200, 2):
        a = load(t)
        soc += a * 2 / 3600 / 100
        soc -= 0.15 if fault and t == 6000 else 0
        rows.append((t, a, f"{cell.step(a, 2.0):.4f}", f"{soc:.3f}"))
    w.writes("log.csv", make.table(["time_s", "current_a", "voltage_v", "soc_ref"], rows))


@case("22", "the BMS's own state of charge leaps without a charge", "said, with time and size",
      "taken as a reference: error 58.91 %; the cell blamed")
def soc_jump(w):
    lfp(w, 100)
    soc_log(w, True)
    w.runs("bms replay log.csv --cell lfp.toml --initial-soc 0.5 --json r.json")
    w.exits(0)
    w.sees(r"The SOC column of the log is not a count of its current: it jumps by -15\.[0-9] % at 6000 s\.")
    found = w.json("r.json") if w.has("r.json") else {"soc_column": {}, "soc": {}}
    events = [(e["kind"], e["time_s"], round(e["size"], 2)) for e in found["soc_column"].get("events", [])]
    w.expects("JSON: no count, one jump at 6,000 s",
              found["soc_column"].get("is_count") is False and events == [("jump", 6000, -0.15)])
    w.expects("no errors against such a reference", all(found["soc"].get(k, 0) is None for k in (
        "rmse", "max_error", "rmse_after_30min", "max_error_after_30min", "within_2_sigma")))
    w.runs("bms diagnose --cell lfp.toml --recording log.csv --initial-soc 0.5 --json d.json")
    w.sees("jumps by -15")
    w.expects("the same in the diagnosis", w.has("d.json") and w.json("d.json")["soc_column"] == found["soc_column"])
    soc_log(w, False)
    w.runs("bms replay log.csv --cell lfp.toml --initial-soc 0.5 --json s.json")
    w.does_not_see("SOC column")
    w.expects("a count is a reference", w.has("s.json") and w.json("s.json")["soc_column"]["is_count"] and
              w.json("s.json")["soc"]["rmse"] is not None)


@case("22, pack", "the same in the log of a pack whose sensor is reversed", "the count is sound", "not judged")
def soc_of_pack(w):
    lfp(w, 100)
    rows = make.pack([make.Cell(100, 0.5, 0.0006) for _ in range(4)], 3600, 2, make.duty(80, seed=6))
    soc = [0.5]
    for (t0, _, _), (t1, a, _) in zip(rows, rows[1:]):
        soc.append(soc[-1] + a * (t1 - t0) / 3600 / 100)
    diagnoses_pack(w, [(t, -a, v) for t, a, v in rows], soc=soc)
    w.sees("a current sensor with a reversed sign")
    w.does_not_see("SOC column")
    w.expects("JSON: a count", w.has("d.json") and w.json("d.json")["soc_column"]["is_count"])


@case("15", "a log of rest alone", "the zero and its correction, 'if nothing flows'", "171 mA ± 471 mA, no correction")
def rest_alone(w):
    lfp(w, 280)
    rng = random.Random(1)
    w.writes("night.csv", make.table(["time_s", "current_a", "v_1", "v_2", "v_3", "v_4"], [
        (60 * k, round(0.122 + rng.gauss(0, 0.004), 3), *(f"{3.333 + 0.001 * c:.3f}" for c in range(4)))
        for k in range(600)]))
    w.runs("bms ammeter night.csv --cell lfp.toml --json a.json")
    w.exits(0)
    w.sees(r"The current sensor reads 122 mA \+- [0-9]+ mA too high, if nothing flowed during the 10.0 h of this log")
    w.sees("current-offset --value -122")
    w.number("correction, mA", lambda: 1e3 * w.json("a.json")["correction"]["offset_a"], -122, 2)


@case("34", "the current reads exactly 0 for hours under load", "said, with its times",
      "10.17 ± 5.55 A too low; UNKNOWN")
def silent_sensor(w):
    lfp(w, 280)
    def load(t):
        return (-40 if t % 7200 < 5400 else 45) + (12 if t % 240 < 120 else -12)
    for cells, row in ((4, 20), (8, 5)):
        pack = [make.Cell(280, 0.5 + 0.002 * c, 0.0002) for c in range(cells)]
        diagnoses_pack(w, make.pack(pack, 20000, row, load, read_a=lambda t, a: 0 if 7200 <= t <= 16180 else a))
        w.exits(0)
        w.sees(r"reads exactly 0 from 7200 to 16180 s while the voltage has [0-9]+ steps")
        w.expects("no offset, and no cell", mechanisms(w) == [("current_silent", None)])
    w.runs("bms ammeter pack.csv --cell lfp.toml")
    w.sees("The sensor is not always read: the current reads exactly 0 from 7200 to 16180 s")
    w.does_not_see("too low|too high")
    w.runs("bms replay pack.csv --cell lfp.toml")
    w.sees("warning: .*reads exactly 0 from 7200 to 16180 s")


@case("34, sound", "the same log with rests in place of the fault", "nothing", "")
def silent_healthy(w):
    lfp(w, 280)
    def load(t):
        return 0 if 7200 <= t <= 16180 else (-40 if t % 7200 < 5400 else 45) + (12 if t % 240 < 120 else -12)
    pack = [make.Cell(280, 0.5 + 0.002 * c, 0.0002) for c in range(4)]
    diagnoses_pack(w, make.pack(pack, 20000, 20, load, read_a=lambda t, a: a))
    w.does_not_see("reads exactly 0")
    w.expects("nothing named", mechanisms(w) == [])


@case("18", "a sense wire with an intermittent contact", "named with its times",
      "'missing readings'; UNKNOWN; NO_MISMATCH")
def loose_wire(w):
    lfp(w, 105)
    for size_v, row in ((1.15, 1), (0.06, 2), (0.02, 5)):
        def wire(t, volts, size_v=size_v):
            if t > 450 and t % 97 < 33:
                volts[6] += size_v
                volts[7] -= size_v
            return volts
        pack = [make.Cell(105, 0.6 + 0.001 * c, 0.0004) for c in range(16)]
        diagnoses_pack(w, make.pack(pack, 3600, row, make.duty(40, seed=8), wire=wire))
        w.exits(0)
        w.expects("the wire between cells 7 and 8 alone", mechanisms(w) == [("sense_wire", 7)])
        w.sees("Its contact is intermittent: bad in (29|3[0-9])[0-9.]* % of the rows, from 4[0-9]+ to")
        w.number("its size, mV", lambda: 1e3 * w.json("d.json")["mechanisms"][0]["parameters"][0]["value"],
                 1e3 * size_v, 30 * size_v + 0.5)


@case("18, sound", "readings that a balancer disturbs, and single leaps in neighbouring channels", "left in peace", "")
def balancer(w):
    lfp(w, 105)
    def wire(t, volts):
        if t % 60 < 30:  # the cell's own resistor loads both of its wires
            volts[4] -= 0.012
            volts[3] += 0.006
            volts[5] += 0.006
        if t in (500, 1500):
            volts[9], volts[10] = volts[9] + 0.4, volts[10] - 0.37
        return volts
    pack = [make.Cell(105, 0.6 + 0.001 * c, 0.0004) for c in range(12)]
    diagnoses_pack(w, make.pack(pack, 3600, 2, make.duty(40, seed=8), wire=wire))
    w.exits(0)
    w.expects("nothing named", mechanisms(w) == [])


@case("38", "packs of 3 and 4 cells", "an answer", "1.5e18 mV, probability nan %, CAUSES, exit 0")
def small_packs(w):
    lfp(w, 280)
    for cells in (3, 4):
        pack = [make.Cell(280, 0.6 + 0.001 * c, 0.0002) for c in range(cells)]
        diagnoses_pack(w, make.pack(pack, 7200, 5, make.duty(90, seed=9)))
        w.exits(0)
        w.does_not_see(r"\bnan\b|e1[0-9]")
        w.expects("nothing named", mechanisms(w) == [])


@case("29", "a joint of 0.3 mohm, rows of 5 s", "the joint, or the interval that would show it",
      "57.8 ± 2.5 % less capacity; NO_MISMATCH")
def bad_joint(w):
    lfp(w, 280)
    for row in (1, 5):
        pack = [make.Cell(280, 0.6 + 0.0005 * c, 0.0002, joint_ohm=0.0003 if c == 7 else 0) for c in range(16)]
        diagnoses_pack(w, make.pack(pack, 7200, row, make.duty(180, seed=row)))
        w.exits(0)
        w.expects("the joint at cell 8", mechanisms(w) == [("joint_resistance", 8)])
        w.number("its size, µohm", lambda: 1e6 * w.json("d.json")["mechanisms"][0]["parameters"][0]["value"], 300, 60)


@case("17", "a wrong channel; cells whose resistance is 40 % below the file's", "the channel alone",
      "an offset of the current sensor as well, p 99 %")
def wrong_channel(w):
    lfp(w, 105)
    def wire(t, volts):
        return [volts[0] - 0.13] + volts[1:]
    pack = [make.Cell(105, 0.6, 0.6 * 0.00025) for _ in range(6)]
    diagnoses_pack(w, make.pack(pack, 3600, 2, make.duty(60, seed=4), wire=wire))
    w.exits(0)
    found = mechanisms(w)
    w.expects("the channel of cell 1 alone, its offset or its gain", found in (
        [("voltage_offset", 1)], [("voltage_gain", 1)]))


@case("35", "single odd readings", "left out", "right")
def glitches(w):
    lfp(w, 280)
    def wire(t, volts):
        if t in (600, 1800, 3000):
            volts[int(t) // 600] = 0.5
        return volts
    pack = [make.Cell(280, 0.6 + 0.001 * c, 0.0002) for c in range(8)]
    diagnoses_pack(w, make.pack(pack, 7200, 2, make.duty(80, seed=2), wire=wire))
    w.exits(0)
    w.expects("nothing named", mechanisms(w) == [])


@case("extended", "a cell file that diagnose wrote", "every command reads it", "refused by simulate")
def written_file(w):
    w.cuts("evidence/recordings/forklift_shift.csv", "hour.csv", 7200)
    w.runs("bms simulate --cell table9 --recording hour.csv --initial-soc 0.9 --noise-v 0.001 --out r.csv "
           "--with slow_polarisation:resistance_ohm=0.006,time_constant_s=900")
    w.runs("bms diagnose --cell table9 --recording r.csv --initial-soc 0.9 --out e.toml")
    w.runs("bms simulate --cell e.toml --recording hour.csv --initial-soc 0.9 --out s.csv")
    w.exits(0)
    w.runs("bms replay hour.csv --cell e.toml")
    w.exits(0)
    w.runs("bms cell check e.toml")
    w.exits(0)


# --- logs that people published


PUBLISHED = [
    ("08_real_exports/p492-13-raw.csv", "", "399 rows"), ("08_real_exports/arbin_example.csv", "", "1199 rows"),
    ("08_real_exports/sample_data_maccor.csv", "", "15 rows"),
    ("08_real_exports/sample_data_novonix.csv", "", "207 rows"),
    ("08_real_exports/sample_data_basytec.txt", "", "74 rows"),
    ("08_real_exports/Sample_data_biologic_no_header.mpt", "", "13 rows"),
    ("04_neware_time_zero/neware.bdf.csv", "", "1697 rows"),
    ("09_bitrode_cell/bitrode_hppc_25c.csv.gz", "", "13248 rows"),
]


def published(w, shared):
    for name, options, pattern in PUBLISHED:
        source = shared / name
        if not source.exists():
            w.does(f"{name}: not on this machine, skipped.")
            continue
        copy = name.rsplit("/", 1)[-1]
        (w.folder / copy).write_bytes(source.read_bytes())
        reads(w, f"bms import {copy} {options} --out r.csv".replace("  ", " "), pattern)


def now_of(w):
    """What came, for the table: the statements, shortened."""
    last = next((s for s in reversed(w.steps) if s.get("command")), None)
    lines = [line for line in (last["output"].splitlines() if last else []) if line and not line.startswith("warning")]
    return (lines[0] if lines else "")[:110].replace("|", "/")


def run_case(tool, entry):
    ident, what, hoped, before, steps = entry
    w = Walk(tool, what, hoped)
    try:
        steps(w)
    except (OSError, KeyError, IndexError, ValueError, TypeError) as error:
        w.expects(f"the case runs to its end, not {error!r}", False)
    finally:
        w.close()
    good = sum(holds for s in w.steps for _, holds in s["expected"])
    count = sum(len(s["expected"]) for s in w.steps)
    print(f"{ident}: {good} of {count}" + ("" if good == count else "   FAILED"))
    for s in w.steps:
        for text, holds in s["expected"]:
            if not holds:
                print("  FAILED " + text + "\n    " + s.get("output", "")[:900].replace("\n", "\n    "))
    sys.stdout.flush()
    return f"| {ident} | {what} | {hoped} | {before or '-'} | {'as hoped' if good == count else '**not as hoped**'}: " \
           f"{good} of {count} expectations |", w.failed


def main():
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("tool")
    options.add_argument("--only", nargs="*")
    options.add_argument("--page")
    options.add_argument("--shared", default=ROOT.parent / "shared" / "field_cases", type=pathlib.Path)
    o = options.parse_args()
    importlib.import_module("field_batteries")
    lines, failed = [], 0
    entries = CASES + [("published", "exports of testers that people published", "read", "partly refused",
                        lambda w: published(w, o.shared))]
    for entry in entries:
        if o.only and entry[0] not in o.only:
            continue
        line, wrong = run_case(o.tool, entry)
        lines.append(line)
        failed += wrong
    if o.page:
        pathlib.Path(o.page).write_text("\n".join(
            ["# What people bring", "", "Written by `tests/walks/field_cases.py`, which makes the logs and has the "
             "expectations. Before: version 5f2ef848.", "", "| case | log | hoped for | before | now |",
             "|---|---|---|---|---|"] + lines) + "\n")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
