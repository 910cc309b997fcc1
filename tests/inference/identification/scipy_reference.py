"""Optimum of a step response's fit by scipy.optimize.least_squares, as lines "name value".

    scipy_reference.py DATA.csv R0_LOWER R1_LOWER C1_LOWER R0_UPPER R1_UPPER C1_UPPER

DATA.csv: time_s,current_a,voltage_v with that header. The current is a step: v = R0 i + R1 (1 - exp(-t / (R1 C1))) i.
`trf` keeps the bounds; `lm` knows none.
"""
import sys

import numpy
from scipy.optimize import least_squares

START = [0.02, 0.005, 500.0]
SCALE = [1e-2, 1e-2, 1e3]
TOLERANCE = 1e-15  # above the machine's epsilon, or scipy refuses

time_s, current_a, voltage_v = numpy.loadtxt(sys.argv[1], delimiter=",", skiprows=1, unpack=True)
limits = [float(text) for text in sys.argv[2:8]]


def residuals(x):
    r0_ohm, r1_ohm, c1_f = x
    return r0_ohm * current_a + r1_ohm * (1 - numpy.exp(-time_s / (r1_ohm * c1_f))) * current_a - voltage_v


def jacobian(x):
    _, r1_ohm, c1_f = x
    left = numpy.exp(-time_s / (r1_ohm * c1_f))
    by_r1 = (1 - left - left * time_s / (r1_ohm * c1_f)) * current_a
    by_c1 = -left * time_s / c1_f**2 * current_a
    return numpy.column_stack([current_a, by_r1, by_c1])


for method in ("trf", "lm"):
    options = {"bounds": (limits[:3], limits[3:])} if method == "trf" else {}
    found = least_squares(residuals, numpy.clip(START, limits[:3], limits[3:]), jacobian, method=method, x_scale=SCALE,
                          ftol=TOLERANCE, xtol=TOLERANCE, gtol=TOLERANCE, max_nfev=2000, **options)
    for name, value in zip(("r0_ohm", "r1_ohm", "c1_f"), found.x):
        print(f"{method}.{name} {value:.17g}")
    print(f"{method}.cost {found.cost:.17g}")
