#!/usr/bin/env python3
"""Writes the cell files that come from published parameters of electrodes, not from a recording of a cell.

    published.py [--check]        --check: writes nothing; exit status 1 if a file differs

    OCV      U_p(y) - U_n(x) along the lithium that moves from one electrode to the other
    R0       electrolyte, and charge transfer of both electrodes: R T / (F i0 a L A)
    R1, C1   diffusion in the particles: dU/dx R_p / (5 D a L A F c_max), slowest time R_p^2 / (20.19 D)

Such a file has the right shape of the chemistry. What it says of a single cell of another maker is wide: its tolerance
is the difference between cells of a chemistry. Scale it to a pack (bms cell scale), compare the pack's cells with each
other, and identify a file of your own for anything else (docs/your_own_cell.md)."""
import math
import pathlib
import sys

FARADAY, GAS, KELVIN = 96485.33, 8.314463, 298.15
HERE = pathlib.Path(__file__).resolve().parent


def graphite_chen(x):
    return 1.9793 * math.exp(-39.3631 * x) + 0.2482 - 0.0909 * math.tanh(29.8538 * (x - 0.1234)) \
        - 0.04478 * math.tanh(14.9159 * (x - 0.2769)) - 0.0205 * math.tanh(30.4444 * (x - 0.6103))


def nmc811_chen(y):
    return -0.8090 * y + 4.4875 - 0.0428 * math.tanh(18.5138 * (y - 0.5542)) \
        - 17.7326 * math.tanh(15.7890 * (y - 0.3117)) + 17.5842 * math.tanh(15.9308 * (y - 0.3120))


def graphite_kim(x):
    parts = ((-0.0351, 0.286, 0.083), (-0.0045, 0.9, 0.119), (-0.035, 0.99, 0.05), (-0.0147, 0.5, 0.034),
             (-0.102, 0.194, 0.142), (-0.022, 0.98, 0.0164), (-0.011, 0.124, 0.0226), (0.0155, 0.105, 0.029))
    return 0.124 + 1.5 * math.exp(-70 * x) + sum(a * math.tanh((x - b) / c) for a, b, c in parts)


def nca_kim(y):
    powers = (11.8058, -66.3691, 264.427, -554.774, 621.3475, -344.566, 81.246, -23.488, 15.056, -2.222, 1.638)
    return sum(a * y ** n for n, a in enumerate(powers)) - 0.61386 * math.exp(5.8201 * y ** 136.4)


class Electrode:
    def __init__(self, ocp, length_m, area_m2, active, c_max, radius_m, diffusivity, i0):
        self.ocp, self.radius_m, self.diffusivity, self.i0, self.c_max = ocp, radius_m, diffusivity, i0, c_max
        self.surface_m2 = 3 * active / radius_m * length_m * area_m2
        self.capacity_ah = active * length_m * area_m2 * c_max * FARADAY / 3600

    def transfer_ohm(self, x):
        return GAS * KELVIN / (FARADAY * self.i0(x) * self.surface_m2)

    def diffusion_ohm(self, x):
        slope = abs(self.ocp(x + 0.01) - self.ocp(x - 0.01)) / 0.02
        return slope * self.radius_m / (5 * self.diffusivity * self.surface_m2 * FARADAY * self.c_max)

    def slowest_s(self):
        return self.radius_m ** 2 / (20.19 * self.diffusivity)


def i0_of(m_ref, c_e, c_max):
    """Exchange current from a rate constant in (A/m2)(m3/mol)^1.5."""
    return lambda x: m_ref * math.sqrt(c_e * (x * c_max) * (1 - x) * c_max)


def electrolyte_ohm(layers, conductivity, area_m2):
    """layers: length, porosity, exponent, share that the current crosses on average."""
    return sum(share * length / (conductivity * porosity ** exponent) for length, porosity, exponent, share in layers) \
        / area_m2


class Full:
    """x_full, y_full: at 100 %; the rest follows from the charge between the limits."""

    def __init__(self, negative, positive, x_full, y_full, low_v, series_ohm):
        self.n, self.p, self.x_full, self.y_full, self.series_ohm = negative, positive, x_full, y_full, series_ohm
        self.capacity_ah = 1.0
        low, high = 0.0, min(negative.capacity_ah * x_full, positive.capacity_ah * (0.9999 - y_full))
        for _ in range(80):
            middle = (low + high) / 2
            self.capacity_ah = middle
            if self.ocv(0) > low_v:
                low = middle
            else:
                high = middle

    def x(self, soc):
        return self.x_full - (1 - soc) * self.capacity_ah / self.n.capacity_ah

    def y(self, soc):
        return self.y_full + (1 - soc) * self.capacity_ah / self.p.capacity_ah

    def ocv(self, soc):
        return self.p.ocp(self.y(soc)) - self.n.ocp(self.x(soc))

    def rc(self, soc):
        inside = min(max(soc, 0.05), 0.97)  # at the very ends the formulas go to infinity
        x, y = self.x(inside), self.y(inside)
        r0 = self.series_ohm + self.n.transfer_ohm(x) + self.p.transfer_ohm(y)
        r1 = self.n.diffusion_ohm(x) + self.p.diffusion_ohm(y)
        return r0, r1, max(self.n.slowest_s(), self.p.slowest_s()) / r1


def pieces(curve, within_v):
    """Edges so that straight lines between them are within this of the curve, and rise."""
    edges, start, n = [0], 0, 1000
    while start < n:
        end = start + 1
        while end < n:
            a, b = curve(start / n), curve((end + 1) / n)
            if max(abs(curve(k / n) - a - (b - a) * (k - start) / (end + 1 - start))
                   for k in range(start, end + 2)) > within_v:
                break
            end += 1
        edges.append(end)
        start = end
    return [k / n for k in edges]


def lg_m50():
    area = 0.065 * 1.58
    negative = Electrode(graphite_chen, 85.2e-6, area, 0.75, 33133, 5.86e-6, 3.3e-14, i0_of(6.48e-7, 1000, 33133))
    positive = Electrode(nmc811_chen, 75.6e-6, area, 0.665, 63104, 5.22e-6, 4e-15, i0_of(3.42e-6, 1000, 63104))
    series = electrolyte_ohm([(85.2e-6, 0.25, 1.5, 1 / 3), (12e-6, 0.47, 1.5, 1), (75.6e-6, 0.335, 1.5, 1 / 3)],
                             0.1297 - 2.51 + 3.329, area)
    return Full(negative, positive, 0.9106, 0.2638, 2.5, series)


def kim_nca():
    def referred(i0_ref, x_ref):
        return lambda x: i0_ref * math.sqrt(x * (1 - x) / (x_ref * (1 - x_ref)))
    area = 0.2 * 0.14
    negative = Electrode(graphite_kim, 70e-6, area, 0.51, 28700, 5.083e-7, 9e-14, referred(36, 0.36))
    positive = Electrode(nca_kim, 50e-6, area, 0.41, 49000, 1.633e-6, 3e-15, referred(4, 0.41))
    t = KELVIN
    conductivity = 3.45 * math.exp(-798 / t) * 1.2 ** 3 - 48.5 * math.exp(-1080 / t) * 1.2 ** 2 + \
        244 * math.exp(-1440 / t) * 1.2
    series = electrolyte_ohm([(70e-6, 0.4, 2, 1 / 3), (25e-6, 0.4, 2, 1), (50e-6, 0.4, 2, 1 / 3)], conductivity, area)
    return Full(negative, positive, 18081 / 28700, 20090 / 49000, 2.7, series)


def list_text(values, digits):
    return "[" + ", ".join(f"{v:.{digits}g}" for v in values) + "]"


def cell_text(name, chemistry, source, cell, low_v, high_v, charge_c, discharge_c):
    edges = pieces(cell.ocv, 0.0015)
    at = [cell.ocv(s) for s in edges]
    b1 = [(v1 - v0) / (s1 - s0) for s0, s1, v0, v1 in zip(edges, edges[1:], at, at[1:])]
    b0 = [v - slope * s for v, slope, s in zip(at, b1, edges)]
    nodes = [0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9]
    rc = [cell.rc(s) for s in nodes]
    q = cell.capacity_ah
    return f"""# {chemistry} from published parameters of its electrodes, not from a cell. Written by published.py.
name = "{name}"
chemistry = "{chemistry}"
source = "{source}"
capacity_ah = {q:.4g}

[limits]
source = "voltages: of the parameters; currents and temperatures: usual for this chemistry, the data sheet decides"
voltage_min_v = {low_v}
voltage_max_v = {high_v}
charge_current_max_a = {charge_c * q:.3g}
discharge_current_max_a = {discharge_c * q:.3g}
temperature_min_c = -20.0
temperature_max_c = 60.0

[ocv]
source = "difference of the electrodes' open-circuit potentials; {len(b1)} straight pieces, within 1.5 mV"
soc = {list_text(edges, 6)}
b0_v = {list_text(b0, 8)}
b1_v = {list_text(b1, 8)}

[rc]
source = "R0: electrolyte and charge transfer; R1, C1: diffusion in the particles, by the formulas of published.py"
soc = {list_text(nodes, 3)}
r0_ohm = {list_text([r[0] for r in rc], 5)}
r1_ohm = {list_text([r[1] for r in rc], 5)}
c1_f = {list_text([r[2] for r in rc], 5)}

[noise]
source = "a 1 mV, 0.2 %C measuring chain; model: what cells of one chemistry differ by"
voltage_v = 0.001
model_v = 0.015
model_correlation_s = 1800.0
v_rc_v = 0.005
rest_v = 0.015
current_a = {0.002 * q:.3g}
current_offset_a = {0.004 * q:.3g}
current_offset_correlation_s = 3600.0
current_unknown_a = {0.5 * q:.3g}

[tolerance]
source = "judgement: cells of one chemistry differ so much from each other"
ocv_v = 0.015
resistance_fraction = 0.5
initial_soc = 0.02
drift_v = 0.005
"""


FILES = {
    "nmc_lg_m50": lambda: cell_text(
        "nmc_lg_m50", "NMC",
        "C.-H. Chen et al., J. Electrochem. Soc. 167 (2020) 080534, graphite and NMC 811 of an LG M50",
        lg_m50(), 2.5, 4.2, 0.7, 1.5),
    "nca_kim2011": lambda: cell_text(
        "nca_kim2011", "NCA",
        "G.-H. Kim et al., J. Electrochem. Soc. 158 (2011) A955, graphite and NCA of a pouch cell",
        kim_nca(), 2.7, 4.2, 1, 3),
}


def main():
    check, wrong = "--check" in sys.argv[1:], 0
    for name, text in FILES.items():
        path, new = HERE / f"{name}.toml", text()
        if check and (not path.exists() or path.read_text() != new):
            print(f"{path}: differs from what published.py writes")
            wrong = 1
        elif not check:
            path.write_text(new)
    return wrong


if __name__ == "__main__":
    sys.exit(main())
