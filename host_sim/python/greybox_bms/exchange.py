"""Cells of other tools: parameters for PyBaMM's Thevenin model, and circuits as JSON in the manner of BPX."""
import json
import os

import numpy as np

from ._core import Cell

_KELVIN = 273.15
_MOST_EDGES = 64  # of the OCV in a cell file
_OCV_ERROR_V = 1e-3
#: The thermal bench of PyBaMM's own ECM example. A cell file has no thermal values; replace them by those of your cell.
_THERMAL = {"Cell thermal mass [J/K]": 1000.0, "Cell-jig heat transfer coefficient [W/K]": 10.0,
            "Jig thermal mass [J/K]": 500.0, "Jig-air heat transfer coefficient [W/K]": 10.0}


_BDF = {"time_s": "Test Time / s", "voltage_v": "Voltage / V", "current_a": "Current / A",
        "temperature_c": "Surface Temperature T1 / degC"}


def bdf_text(recording):
    """The columns that the recording has, under the labels of the Battery Data Format. A missing reading is empty."""
    columns = {label: getattr(recording, name) for name, label in _BDF.items() if len(getattr(recording, name))}
    rows = zip(*(["" if np.isnan(value) else repr(float(value)) for value in of] for of in columns.values()))
    return "\n".join([",".join(columns), *(",".join(row) for row in rows)]) + "\n"


def _ends(soc, values):
    """With values at 0 and 1: outside its nodes an RC table is constant."""
    return np.concatenate(([0.0], soc, [1.0])), np.concatenate((values[:1], values, values[-1:]))


def to_pybamm(cell, *, initial_soc=0.5, interpolant=None):
    """Parameters of PyBaMM's equivalent_circuit.Thevenin() with one RC element, as a dictionary for ParameterValues.

    initial_soc: 0 to 1. interpolant: makes the function of a table from (x, y, variable, name); pybamm.Interpolant
    with linear interpolation if None. Ambient and initial temperature are the reference temperature of the cell;
    resistances do not depend on temperature or current. Not transferred: noise, tolerances, hysteresis and the other
    mechanisms. The thermal values are those of PyBaMM's example. PyBaMM's currents discharge if they are positive."""
    if interpolant is None:
        import pybamm  # only needed here

        def interpolant(x, y, variable, name):
            return pybamm.Interpolant(x, y, variable, name=name, interpolator="linear")

    def of_soc(name, values):
        x, y = _ends(cell.rc_soc, values)
        x, first = np.unique(x, return_index=True)
        return lambda temperature, current, soc: interpolant(x, y[first], soc, name)

    limits = cell.limits
    kelvin = cell.reference_temperature_c + _KELVIN
    return {
        "chemistry": "ecm",
        "Initial SoC": float(initial_soc),
        "Initial temperature [K]": kelvin,
        "Ambient temperature [K]": kelvin,
        "Cell capacity [A.h]": cell.capacity_ah,
        "Nominal cell capacity [A.h]": cell.capacity_ah,
        "Current function [A]": cell.capacity_ah,
        "Upper voltage cut-off [V]": limits["voltage_max_v"],
        "Lower voltage cut-off [V]": limits["voltage_min_v"],
        **_THERMAL,
        "Open-circuit voltage [V]": lambda soc: interpolant(cell.ocv_soc, cell.ocv_v, soc, "OCV"),
        "R0 [Ohm]": of_soc("R0", cell.r0_ohm),
        "Element-1 initial overpotential [V]": 0.0,
        "R1 [Ohm]": of_soc("R1", cell.r1_ohm),
        "C1 [F]": of_soc("C1", cell.c1_f),
        "Entropic change [V/K]": 0.0,
        "RCR lookup limit [A]": max(limits["charge_current_max_a"], limits["discharge_current_max_a"]),
    }


def to_ecm_json(cell, path=None):
    """The cell as JSON text: keys and units in the manner of BPX, tables as {"x": [soc], "y": [values]}.

    from_ecm_json() reads it. Not transferred: noise, tolerances, mechanisms. path: also written there."""
    def table(soc, values):
        return {"x": [float(v) for v in soc], "y": [float(v) for v in values]}

    limits = cell.limits
    text = json.dumps({
        "Header": {"BPX": "0.4", "Title": cell.name, "Description": cell.source, "Model": "ECM"},
        "Parameterisation": {"Cell": {
            "Nominal cell capacity [A.h]": cell.capacity_ah,
            "Lower voltage cut-off [V]": limits["voltage_min_v"],
            "Upper voltage cut-off [V]": limits["voltage_max_v"],
            "Reference temperature [K]": cell.reference_temperature_c + _KELVIN,
            "Open-circuit voltage [V]": table(cell.ocv_soc, cell.ocv_v),
            "R0 [Ohm]": table(cell.rc_soc, cell.r0_ohm),
            "R1 [Ohm]": table(cell.rc_soc, cell.r1_ohm),
            "C1 [F]": table(cell.rc_soc, cell.c1_f),
        }},
    }, indent=2)
    if path is not None:
        with open(path, "w", encoding="utf-8") as file:
            file.write(text + "\n")
    return text


def _number(values, key):
    value = values.get(key)
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise ValueError(f"'{key}' is missing or not a number")
    return float(value)


def _table(values, key):
    """(soc, values) of a number or of a table {"x": [...], "y": [...]}."""
    value = values.get(key)
    if isinstance(value, dict) and isinstance(value.get("x"), list) and isinstance(value.get("y"), list):
        x, y = np.asarray(value["x"], float), np.asarray(value["y"], float)
        if len(x) != len(y) or len(x) == 0 or np.any(np.diff(x) <= 0):
            raise ValueError(f"'{key}': x and y have different lengths, or x does not increase")
        return x, y
    if isinstance(value, str):
        raise ValueError(f"'{key}' is an expression, expected a number or a table {{\"x\": [...], \"y\": [...]}}")
    return np.array([0.5]), np.array([_number(values, key)])


def _fewer_edges(soc, volts):
    """Edges of a curve of straight pieces within 1 mV of the table, or as close as 64 edges allow; and the largest
    difference [V]."""
    kept = [0, len(soc) - 1]
    while True:
        error = np.abs(np.interp(soc, soc[kept], volts[kept]) - volts)
        worst = int(np.argmax(error))
        if error[worst] <= _OCV_ERROR_V or len(kept) == _MOST_EDGES:
            return soc[kept], volts[kept], float(error[worst])
        kept = sorted({*kept, worst})


def _ocv(values):
    soc, volts = _table(values, "Open-circuit voltage [V]")
    if len(soc) < 2 or abs(soc[0]) > 1e-6 or abs(soc[-1] - 1) > 1e-6:
        raise ValueError("'Open-circuit voltage [V]' does not reach from a state of charge of 0 to 1")
    soc[0], soc[-1] = 0.0, 1.0
    return (soc, volts, 0.0) if len(soc) <= _MOST_EDGES else _fewer_edges(soc, volts)


def from_ecm_json(source, *, like="table9", name=None):
    """Cell of an equivalent circuit with one RC element in JSON, in the manner of BPX.

    source: path, JSON text or dictionary with "Parameterisation": {"Cell": ...} or these keys at the top: "Nominal cell
    capacity [A.h]", "Lower voltage cut-off [V]", "Upper voltage cut-off [V]", "Open-circuit voltage [V]", "R0 [Ohm]",
    "R1 [Ohm]", "C1 [F]", optionally "Reference temperature [K]". A value over the state of charge is a number or a
    table {"x": [soc], "y": [values]}. like: Cell, name or path whose noise, tolerances, currents and temperatures are
    used, scaled to the capacity. An OCV of more than 64 points is reduced to straight pieces; Cell.source
    says how close.
    Raises ValueError (InputError for values out of the range of a cell file)."""
    if isinstance(source, os.PathLike) or (isinstance(source, str) and not source.lstrip().startswith("{")):
        with open(source, encoding="utf-8") as file:
            source = file.read()
    document = json.loads(source) if isinstance(source, str) else source
    header = document.get("Header", {})
    values = document.get("Parameterisation", document)
    values = values.get("Cell", values)
    soc, volts, error_v = _ocv(values)
    tables = {key: _table(values, key) for key in ("R0 [Ohm]", "R1 [Ohm]", "C1 [F]")}
    nodes = np.unique(np.concatenate([x for x, _ in tables.values()]))
    at_nodes = {key: np.interp(nodes, x, y) for key, (x, y) in tables.items()}
    title = name or header.get("Title") or "imported"
    source_text = f"equivalent circuit '{title}' in JSON; noise and tolerances are assumed"
    if error_v > 0:
        source_text += f"; OCV within {1e3 * error_v:.1f} mV of its table"
    return Cell.from_tables(
        "".join(c if c.isascii() and (c.isalnum() or c in "_-.") else "_" for c in title),
        capacity_ah=_number(values, "Nominal cell capacity [A.h]"), ocv_soc=soc, ocv_v=volts, rc_soc=nodes,
        r0_ohm=at_nodes["R0 [Ohm]"], r1_ohm=at_nodes["R1 [Ohm]"], c1_f=at_nodes["C1 [F]"],
        voltage_min_v=_number(values, "Lower voltage cut-off [V]"),
        voltage_max_v=_number(values, "Upper voltage cut-off [V]"),
        like=like if isinstance(like, Cell) else Cell.load(os.fspath(like)),
        reference_temperature_c=float(values.get("Reference temperature [K]", 25 + _KELVIN)) - _KELVIN,
        source=source_text)
