"""The list of the cases, and steps that several of them take."""
import field_inputs as make

CASES = []
BUS = "--dbc bus.dbc --map current_a=Current --map voltage_v=CellVoltage"


def case(ident, what, hoped, before):
    def register(steps):
        CASES.append((ident, what, hoped, before, steps))
        return steps
    return register


def bus(w, text="", name="bus.dbc"):
    w.writes(name, make.DBC_HEAD + make.DBC_PACK + text)


def reads(w, command, pattern=r"\b600 rows"):
    w.runs(command)
    w.exits(0)
    w.sees(pattern)


def column(w, name, heading):
    lines = [line for line in w.text(name).splitlines() if not line.startswith("#")]
    at = lines[0].split(",").index(heading)
    return [line.split(",")[at] for line in lines[1:]]


def lfp(w, capacity_ah):
    w.runs(f"bms cell scale a123_26650 --capacity-ah {capacity_ah} --out lfp.toml")


def diagnoses_pack(w, rows, more="", cell="lfp.toml", soc=None):
    w.writes("pack.csv", make.pack_csv(rows, soc))
    w.runs(f"bms diagnose --pack {cell} --recording pack.csv --json d.json {more}".rstrip())


def mechanisms(w):
    return [(m["id"], m["cell"]) for m in w.json("d.json")["mechanisms"]] if w.has("d.json") else None
