"""greybox-bms from Python: the model, the estimator, the identification and the diagnosis of the tool, on numpy arrays.

Current > 0 charges the cell. A state of charge is a fraction from 0 to 1. Units stand at the end of each name: time_s
[s], current_a [A], voltage_v [V], temperature_c [degrees C]. NaN is a missing reading. Functions release the GIL.

    import greybox_bms as gb
    cell = gb.Cell.load("table9")
    run = gb.replay(cell, "evidence/recordings/forklift_shift.csv")
    run.soc, run.soc_sigma
"""
import os

import numpy as _np

from . import _core
from ._core import (Cell, Diagnosis, Estimate, Estimator, FitFailed, Identification, InputError, Recording, Replay,
                    Simulation, __version__)
from .exchange import bdf_text, from_ecm_json, to_ecm_json, to_pybamm

__all__ = ["Cell", "Diagnosis", "Estimate", "Estimator", "FLAGS", "FitFailed", "Identification", "InputError",
           "Recording", "Replay", "Simulation", "diagnose", "from_ecm_json", "identify", "recording", "replay",
           "simulate", "to_bdf", "to_ecm_json", "to_pybamm", "__version__"]

InputError.__doc__ = "The input cannot be used; FILE:LINE: what is wrong, what was expected, as the tool prints it."
FitFailed.__doc__ = "The data are good, but no parameters follow from them."

#: Why an estimate is less accurate than usual: bits of Estimate.flags.
FLAGS = {
    "voltage_missing": 1 << 0, "voltage_implausible": 1 << 1, "voltage_stuck": 1 << 2, "current_missing": 1 << 3,
    "current_implausible": 1 << 4, "time_gap": 1 << 5, "time_not_increasing": 1 << 6,
    "current_beyond_limits": 1 << 7, "not_started": 1 << 8, "soc_ambiguous": 1 << 9, "voltage_rejected": 1 << 10,
    "not_a_number": 1 << 11, "soc_contradicted": 1 << 12,
}

_COLUMNS = ("time_s", "current_a", "voltage_v", "temperature_c", "soc_ref")


def recording(source):
    """Recording of a path, or of a table with the columns time_s [s], current_a [A] and optionally voltage_v [V],
    temperature_c [degrees C], soc_ref [0 to 1], each of shape (n,): a dictionary, a pandas DataFrame, a structured
    array. A Recording is returned as it is. Raises InputError, ValueError."""
    if isinstance(source, Recording):
        return source
    if isinstance(source, (str, os.PathLike)):
        return Recording.load(os.fspath(source))
    names = source.dtype.names if isinstance(source, _np.ndarray) else source
    present = [name for name in _COLUMNS if name in names]
    if missing := [name for name in ("time_s", "current_a") if name not in present]:
        raise ValueError(f"the table has no column {missing[0]}")
    return Recording(**{name: _np.asarray(source[name], dtype=_np.float64) for name in present})


def to_bdf(source, path=None):
    """A recording in the Battery Data Format, as text; written to path (usually NAME.bdf.csv) if one is given.
    Recording.load() and bms read it. source: as for recording(). Raises InputError, ValueError, OSError."""
    text = bdf_text(recording(source))
    if path is not None:
        with open(path, "w", encoding="utf-8", newline="") as file:
            file.write(text)
    return text


def _recordings(sources):
    if sources is None:
        return []
    return [recording(source) for source in (sources if isinstance(sources, (list, tuple)) else [sources])]


def _cell(cell):
    return cell if isinstance(cell, Cell) else Cell.load(os.fspath(cell))


def replay(cell, source, *, initial_soc=None, initial_soc_sigma=0.02, scalar="float"):
    """Runs the estimator over a recording; the bits are those of `bms replay`.

    cell: Cell, or its name or path. source: as for recording(). initial_soc: state of charge at the start, 0 to 1;
    estimated from the first voltage if None. initial_soc_sigma: its standard deviation, 1e-4 to 1. scalar: "float",
    "fixed" or "double". Returns a Replay with arrays of shape (n,). Raises InputError if the recording does not fit
    the cell."""
    return _core.replay(_cell(cell), recording(source), initial_soc=initial_soc, initial_soc_sigma=initial_soc_sigma,
                        scalar=scalar)


def simulate(cell, source, *, initial_soc):
    """Voltage of the model for the current of a recording, open loop, from a rested cell.

    cell, source: as for replay(); a voltage is not needed. initial_soc: 0 to 1. Returns a Simulation with voltage_v [V]
    and soc of shape (n,). Raises InputError if the state of charge leaves the cell."""
    return _core.simulate(_cell(cell), recording(source), initial_soc=initial_soc)


def identify(recordings, *, ocv=(), start="table9", capacity_ah=None, initial_soc=None, window=None, nodes=(),
             extend=False, ocv_from_rests=False, chemistry="", validate=(), hold_out=(), name="identified"):
    """Identifies a cell from recordings, as `bms identify`.

    recordings, ocv (slow charge and discharge), validate, hold_out: a source or a list of sources, as for recording().
    start: Cell, name or path with the initial values. capacity_ah [A h]. initial_soc: 0 to 1, "estimate", or None for
    soc_ref or an estimate. window: (high, low) of the state of charge that counts. nodes: states of charge of R0, R1,
    C1. Returns an Identification. Raises InputError for data that do not fit, FitFailed if no parameters follow."""
    text = "" if initial_soc is None else str(initial_soc)
    limits = "" if window is None else f"{window[0]!r}:{window[1]!r}"
    return _core.identify(_recordings(recordings), ocv=_recordings(ocv),
                          start=_cell(start), capacity_ah=capacity_ah or 0.0, initial_soc=text, window=limits,
                          nodes=list(nodes), extend=extend, ocv_from_rests=ocv_from_rests, chemistry=chemistry,
                          validate=_recordings(validate),
                          hold_out=_recordings(hold_out), name=name)


def diagnose(cell, recordings, *, holdouts=(), initial_soc=None, progress=None):
    """Finds where a calibrated cell and its recordings disagree, and why, as `bms diagnose`. Takes seconds to minutes.

    cell: as for replay(). recordings, holdouts: as for identify(), the earliest first. initial_soc: 0 to 1, one for all
    recordings, or a list with one for each recording and then for each hold-out; None: soc_ref or an estimate.
    progress: called with the share done (0 to 1) and the part. Returns a Diagnosis. Ctrl-C ends it with
    KeyboardInterrupt."""
    if initial_soc is None:
        given = []
    else:
        given = [float(soc) for soc in _np.atleast_1d(initial_soc)]
    return _core.diagnose(_cell(cell), _recordings(recordings), holdouts=_recordings(holdouts),
                          initial_soc=given, progress=progress)
