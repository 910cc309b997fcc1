"""Numbers of scipy for prefilter_test and discrete_model_test.

Prints one line per column: its name and then its values with 17 digits.
"""
import numpy as np
from scipy import signal


def line(name, values):
    print(name, *(repr(float(v)) for v in np.atleast_1d(values)))


k = np.arange(200)
x = np.sin(0.07 * k) + 0.4 * np.cos(1.9 * k) + (k > 60) * 2.0 - 0.01 * k
line("x", x)
for name, cutoff_hz, rate_hz in (("low", 0.01, 1.0), ("middle", 1.0, 10.0), ("high", 0.49, 1.0)):
    b, a = signal.butter(2, cutoff_hz, fs=rate_hz)
    line(name + "_b", b)
    line(name + "_a", a)
    line(name + "_causal", signal.lfilter(b, a, x, zi=signal.lfilter_zi(b, a) * x[0])[0])
    line(name + "_zero_phase", signal.filtfilt(b, a, x))

# Eq. 17 and Eq. 21-22 (one sample of delay)
line("tf", signal.lfilter([0.01317, -0.02263, 0.00946], [1, -1.82, 0.8203], x))
line("oe", signal.lfilter([0, 0.009828, -0.01508, 0.005254], [1, -1.835, 0.835], x))
# free response: w[0] = 0.1, w[1] = -0.05, and the recursion from there
f = [1, -1.82, 0.8203]
line("free", signal.lfilter([1.0], f, np.zeros(200), zi=signal.lfiltic([1.0], f, [-0.05, 0.1]))[0])
