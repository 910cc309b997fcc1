"""Logs as people bring them, made by formulas: the shapes of public reports, with a truth that is known.

The cell is one resistance and one RC pair over a formula of its OCV. It shares nothing with the tool."""
import math
import random


def ocv_lfp(soc):
    """Iron phosphate: steep at both ends, nearly flat between them."""
    return 3.27 + 0.06 * soc + 0.07 * math.tanh((soc - 0.97) * 40) - 0.55 * math.exp(-soc * 28)


def ocv_nmc(soc):
    return 3.35 + 0.75 * soc - 0.35 * math.exp(-soc * 18) + 0.08 * math.tanh((soc - 0.55) * 6)


class Cell:
    """soc0, capacity and resistances may differ from cell to cell; joint_ohm adds to the reading."""

    def __init__(self, capacity_ah, soc, r0_ohm, r1_ohm=None, tau_s=40.0, joint_ohm=0.0, ocv=ocv_lfp):
        self.capacity_ah, self.soc, self.r0_ohm, self.joint_ohm = capacity_ah, soc, r0_ohm, joint_ohm
        self.r1_ohm = 0.6 * r0_ohm if r1_ohm is None else r1_ohm
        self.tau_s, self.ocv, self.v1 = tau_s, ocv, 0.0

    def step(self, current_a, dt_s):
        self.soc += current_a * dt_s / 3600 / self.capacity_ah
        self.v1 += (1 - math.exp(-dt_s / self.tau_s)) * (self.r1_ohm * current_a - self.v1)
        return self.ocv(self.soc) + (self.r0_ohm + self.joint_ohm) * current_a + self.v1


def pack(cells, seconds, row_s, load, noise_v=0.0005, step_v=0.001, seed=1, wire=None, read_a=None):
    """Rows of (time, current as read, [voltages]). load(t): true current; each row is sampled at its end.
    wire(t, voltages): what the channels read instead; read_a(t, a): what the sensor reads."""
    rng = random.Random(seed)
    rows, t, dt = [], 0.0, 1.0
    while t <= seconds:
        current = load(t)
        volts = [c.step(current, dt) for c in cells]
        if t % row_s == 0:
            volts = [v + rng.gauss(0, noise_v) for v in volts]
            if wire:
                volts = wire(t, volts)
            volts = [round(v / step_v) * step_v for v in volts]
            rows.append((t, round(read_a(t, current) if read_a else current + rng.gauss(0, 0.05), 2), volts))
        t += dt
    return rows


def duty(amplitude_a, seed=3, rest_s=300):
    """A vehicle: blocks of other currents every 20 to 90 s, mostly discharging, and ripple."""
    rng = random.Random(seed)
    state = {"until": rest_s, "a": 0.0}

    def load(t):
        if t >= state["until"]:
            state["a"] = amplitude_a * rng.choice([-1, -0.6, -0.3, 0, 0.4, -0.8, 0.2])
            state["until"] = t + rng.uniform(20, 90)
        return state["a"]
    return load


def table(columns, rows, separator=","):
    return "\n".join([separator.join(columns)] + [separator.join(str(x) for x in row) for row in rows]) + "\n"


def pack_csv(rows, soc=None):
    cells = len(rows[0][2])
    columns = ["time_s", "current_a"] + [f"v_{k + 1}" for k in range(cells)] + (["soc_ref"] if soc else [])
    return table(columns, [(f"{t:g}", f"{a:.2f}", *(f"{v:.4f}" for v in volts), *([f"{soc[k]:.3f}"] if soc else []))
                           for k, (t, a, volts) in enumerate(rows)])


def signal(rows=600):
    """One second a row: rest, load of 40 A, charge of 20 A; (time, current, voltage)."""
    cell, out = Cell(100, 0.6, 0.0006), []
    for k in range(rows):
        a = 0.0 if k < 60 else -40.0 if k < 400 else 20.0
        out.append((k, a, cell.step(a, 1.0)))
    return out


DBC_HEAD = """VERSION ""
NS_ :
\tNS_DESC_
\tCM_
\tBA_DEF_
\tBA_
\tVAL_
\tSIG_VALTYPE_
\tSG_MUL_VAL_

BS_:
BU_: BMS
"""
DBC_PACK = """BO_ 256 Pack: 8 BMS
 SG_ Current : 0|16@1- (0.1,0) [-3000|3000] "A" Vector__XXX
 SG_ CellVoltage : 16|16@1+ (0.0001,0) [0|5] "V" Vector__XXX

"""


def pack_bytes(a, v):
    return (round(a * 10) & 0xFFFF).to_bytes(2, "little") + round(v * 1e4).to_bytes(2, "little") + bytes(4)


def candump(rows, channel="can0", start_s=1727438342, ident="100"):
    return "".join(f"({start_s + t:.6f}) {channel} {ident}#{pack_bytes(a, v).hex().upper()}\n" for t, a, v in rows)
