"""The Python module from the outside: the bits of the tool, views without copies, threads, errors, stubs, the page.

Environment: PYTHONPATH with greybox_bms, BMS_TOOL, BMS_SOURCE_DIR.
"""
import ast
import csv
import doctest
import json
import os
import pathlib
import resource
import re
import subprocess
import tempfile
import threading
import time
import unittest

import numpy as np

import greybox_bms as gb

TOOL = os.environ["BMS_TOOL"]
SOURCE = pathlib.Path(os.environ["BMS_SOURCE_DIR"])
SHIFT = SOURCE / "evidence/recordings/forklift_shift.csv"


def tool(*arguments):
    subprocess.run([TOOL, *map(str, arguments)], check=True, capture_output=True)


def columns(text):
    rows = list(csv.reader(text.splitlines()))
    return {name: [row[k] for row in rows[1:]] for k, name in enumerate(rows[0])}


class Names(unittest.TestCase):
    def test_the_short_name_is_the_same_module(self):
        import greybox
        import greybox.exchange
        self.assertIs(greybox, gb)
        self.assertIs(greybox.exchange, gb.exchange)
        self.assertIs(greybox.Cell, gb.Cell)


class Bits(unittest.TestCase):
    """Every estimate of an eight-hour shift is that of the tool."""

    def compare(self, cell, scalar, *more):
        with tempfile.TemporaryDirectory() as folder:
            trace = pathlib.Path(folder) / "trace.csv"
            tool("replay", SHIFT, "--cell", cell, "--scalar", scalar, "--trace", trace, "--quiet", *more)
            expected = trace.read_text()
        options = {"initial_soc": 0.78, "initial_soc_sigma": 0.2} if more else {}
        run = gb.replay(cell, SHIFT, scalar=scalar, **options)
        self.assertEqual(len(run), 28801)
        self.assertTrue(run.trace_csv() == expected)  # not assertEqual: it would print both
        of_tool = columns(expected)
        number = np.float32 if scalar == "float" else np.float64
        for name in ("soc", "soc_sigma", "v_rc_v", "voltage_predicted_v", *run.states):
            values = run.states[name] if name in run.states else getattr(run, name)
            bits = np.array([number(text) for text in of_tool[name]]).tobytes()
            self.assertEqual(values.astype(number).tobytes(), bits, name)
        self.assertEqual([int(f) for f in of_tool["flags"]], run.flags.tolist())

    def test_float(self):
        self.compare("table9", "float")

    def test_float_from_a_given_start(self):
        self.compare("table9", "float", "--initial-soc", 0.78, "--initial-soc-sigma", 0.2)

    def test_double(self):
        self.compare("table9", "double")

    def test_fixed(self):
        self.compare("table9", "fixed")

    def test_states_of_an_extended_cell(self):
        run = gb.replay(gb.Cell.load("a123_26650_extended").scaled(6), SHIFT)
        self.assertIn("current_offset_a", run.states)
        self.assertTrue(all(len(values) == len(run) for values in run.states.values()))
        with tempfile.TemporaryDirectory() as folder:
            cell = pathlib.Path(folder) / "cell.toml"
            gb.Cell.load("a123_26650_extended").scaled(6).save(str(cell))
            trace = pathlib.Path(folder) / "trace.csv"
            tool("replay", SHIFT, "--cell", cell, "--trace", trace, "--quiet")
            self.assertTrue(run.trace_csv() == trace.read_text())

    def test_step_by_step(self):
        for name in ("table9", "a123_26650_extended"):
            cell = gb.Cell.load(name).scaled(6)
            recording = gb.recording(SHIFT)
            run, estimator = gb.replay(cell, recording), gb.Estimator(cell)
            rows = zip(recording.time_s, recording.current_a, recording.voltage_v, recording.temperature_c)
            steps = [estimator.step(*row) for row in rows]
            for field in ("soc", "soc_sigma", "v_rc_v", "voltage_predicted_v", "flags"):
                self.assertEqual([getattr(e, field) for e in steps], getattr(run, field).tolist(), (name, field))

    def test_simulation(self):
        with tempfile.TemporaryDirectory() as folder:
            out = pathlib.Path(folder) / "simulated.csv"
            tool("simulate", "--cell", "table9", "--recording", SHIFT, "--initial-soc", 0.98, "--out", out)
            expected = columns(out.read_text())
        run = gb.simulate("table9", SHIFT, initial_soc=0.98)
        self.assertEqual([f"{v:.10g}" for v in run.voltage_v], expected["voltage_v"])
        self.assertEqual([f"{v:.10g}" for v in run.soc], expected["soc"])

    def test_identification(self):
        with tempfile.TemporaryDirectory() as folder:
            out, result = pathlib.Path(folder) / "made.toml", pathlib.Path(folder) / "made.json"
            tool("identify", "--recording", SHIFT, "--window", "0.6:0.4", "--name", "made", "--out", out, "--json",
                 result)
            expected, json_of_tool = gb.Cell.load(str(out)), json.loads(result.read_text())
        found = gb.identify(SHIFT, window=(0.6, 0.4), name="made")
        self.assertEqual(found.result["parameters"], json_of_tool["parameters"])
        for name in ("r0_ohm", "r1_ohm", "c1_f", "ocv_v", "r0_std_ohm"):
            self.assertEqual(getattr(found.cell, name).tolist(), getattr(expected, name).tolist(), name)
        table = gb.recording(SHIFT)
        again = gb.identify({"time_s": table.time_s, "current_a": table.current_a, "voltage_v": table.voltage_v,
                             "temperature_c": table.temperature_c, "soc_ref": table.soc_ref}, window=(0.6, 0.4))
        self.assertEqual(again.cell.r0_ohm.tolist(), expected.r0_ohm.tolist())


class Diagnosis(unittest.TestCase):
    def recording(self):
        """Fifty minutes of pulses with 2 mOhm more than the cell has."""
        time_s = np.arange(0, 3000.0)
        current_a = np.where((time_s // 60).astype(int) % 3 == 1, -6.0, 0.0) + np.where(
            (time_s // 60).astype(int) % 3 == 2, 3.0, 0.0)
        run = gb.simulate("table9", {"time_s": time_s, "current_a": current_a}, initial_soc=0.7)
        noise = np.random.default_rng(1).normal(0, 5e-4, len(time_s))
        return gb.Recording(time_s, current_a, run.voltage_v + noise + 0.002 * current_a, name="pulses")

    def test_names_what_was_planted(self):
        parts = []
        found = gb.diagnose("table9", self.recording(), initial_soc=0.7, progress=lambda done, what: parts.append(done))
        self.assertIn("the ohmic resistance is 15.", found.statement)  # 2 of 13.2 mOhm
        self.assertEqual(found.result["command"], "diagnose")
        self.assertEqual(found.result["verdict"], found.verdict)
        self.assertGreater(len(parts), 1)

    def test_an_exception_of_the_progress_ends_it(self):
        def stop(done, what):
            raise KeyboardInterrupt
        with self.assertRaises(KeyboardInterrupt):
            gb.diagnose("table9", self.recording(), initial_soc=0.7, progress=stop)


class Views(unittest.TestCase):
    def test_results_are_views_that_outlive_the_result(self):
        run = gb.replay("table9", SHIFT)
        soc, flags = run.soc, run.flags
        self.assertEqual(soc.__array_interface__["data"], run.soc.__array_interface__["data"])
        expected = soc.copy()
        del run
        gb.replay("table9", SHIFT, initial_soc=0.3)
        self.assertTrue(np.array_equal(soc, expected))
        self.assertEqual(flags.dtype, np.uint32)
        with self.assertRaises(ValueError):
            soc[0] = 1

    def test_columns_of_a_recording_are_read_only_views(self):
        recording = gb.recording(SHIFT)
        column = recording.current_a
        self.assertEqual(column.__array_interface__["data"], recording.current_a.__array_interface__["data"])
        with self.assertRaises(ValueError):
            column[0] = 1

    def test_a_recording_does_not_change_with_the_arrays_that_it_was_made_of(self):
        time_s, current_a = np.arange(20.0), np.zeros(20)
        recording = gb.Recording(time_s, current_a)
        current_a[3] = 9
        self.assertEqual(recording.current_a[3], 0)

    def test_tables_of_other_kinds(self):
        columns_of = {"time_s": list(range(20)), "current_a": np.full(20, -1, np.float32)}
        kinds = np.zeros(20, dtype=[("time_s", int), ("current_a", np.float32), ("voltage_v", float)])
        kinds["time_s"], kinds["current_a"] = range(20), -1
        for table in (columns_of, kinds):
            self.assertEqual(gb.recording(table).current_a.tolist(), [-1.0] * 20)
        self.assertEqual(len(gb.recording(kinds).voltage_v), 20)


class Threads(unittest.TestCase):
    def test_other_threads_run_during_a_call(self):
        time_s = np.arange(3_000_000.0)
        recording = gb.Recording(time_s, np.where(time_s % 200 < 100, 1.0, -1.0), np.full(len(time_s), 3.3))
        cell, turns, done = gb.Cell.load("table9"), 0, threading.Event()

        def work():
            gb.simulate(cell, recording, initial_soc=0.5)
            gb.replay(cell, recording, initial_soc=0.5)
            done.set()

        threading.Thread(target=work).start()
        begin = time.monotonic()
        while not done.is_set() and time.monotonic() - begin < 120:
            turns += 1
            time.sleep(0.001)
        self.assertGreater(turns, 30)


class Errors(unittest.TestCase):
    def test_each_names_what_is_wrong(self):
        n = np.arange(20.0)
        shift = gb.recording(SHIFT)
        for call, error, text in (
                (lambda: gb.Cell.load("no_such_cell"), gb.InputError, "no_such_cell"),
                (lambda: gb.Cell.parse("name = 3"), gb.InputError, "cell:1"),
                (lambda: gb.recording("no_such.csv"), gb.InputError, "no_such.csv"),
                (lambda: gb.recording({"time_s": n}), ValueError, "current_a"),
                (lambda: gb.Recording(n, n[:5]), ValueError, "current_a has 5 values, time_s has 20"),
                (lambda: gb.Recording(n, n.reshape(4, 5)), ValueError, "dimensions"),
                (lambda: gb.Recording(n[::-1], n), gb.InputError, "time_s decreases"),
                (lambda: gb.Recording([], []), gb.InputError, "no time passes"),
                (lambda: gb.replay("table9", {"time_s": n, "current_a": n}), gb.InputError, "no voltage_v"),
                (lambda: gb.replay("table9", gb.Recording(n, n, 16 * 3.3 + 0 * n)), gb.InputError, "cells"),
                (lambda: gb.replay("table9", shift, scalar="half"), ValueError, "no such scalar"),
                (lambda: gb.replay("table9", shift, initial_soc=1.5), ValueError, "initial_soc"),
                (lambda: gb.simulate("table9", {"time_s": 3600 * n, "current_a": 0 * n - 6}, initial_soc=0.5),
                 gb.InputError, "leaves -25 to 125 %"),
                (lambda: gb.Estimator(gb.Cell.load("table9"), initial_soc=-1), ValueError, "initial_soc"),
                (lambda: gb.Estimator(gb.Cell.load("table9")).step(float("nan"), 0), ValueError, "time_s"),
                (lambda: gb.identify([]), gb.InputError, "no recordings"),
                (lambda: gb.diagnose("table9", shift, initial_soc=[0.5, 0.5]), gb.InputError, "2 values for 1")):
            with self.subTest(text):
                with self.assertRaisesRegex(error, re.escape(text)) as raised:
                    call()
                self.assertNotIn("\n", str(raised.exception))

    def test_a_missing_reading_is_flagged(self):
        estimate = gb.Estimator(gb.Cell.load("table9"), initial_soc=0.5).step(0, 0)
        self.assertEqual(estimate.flags & gb.FLAGS["voltage_missing"], gb.FLAGS["voltage_missing"])


class Exchange(unittest.TestCase):
    def test_bdf_is_read_again_to_the_last_bit(self):
        volts, missing = 3.3 + np.random.default_rng(1).normal(0, 0.1, 40), 7
        volts[missing] = np.nan
        table = {"time_s": np.arange(40.0), "current_a": np.linspace(-5, 5, 40) / 3, "voltage_v": volts,
                 "temperature_c": np.full(40, 21.5)}
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "a.bdf.csv")
            text = gb.to_bdf(table, path)
            again = gb.Recording.load(path)
        self.assertEqual(text.splitlines()[0],
                         "Test Time / s,Voltage / V,Current / A,Surface Temperature T1 / degC")
        self.assertIn("Battery Data Format", again.read_as)
        for name, column in table.items():
            np.testing.assert_array_equal(getattr(again, name), column)

    def parameters(self, cell):
        return gb.to_pybamm(cell, interpolant=lambda x, y, variable, name: float(np.interp(variable, x, y)))

    def test_pybamm_has_the_curves_of_the_cell(self):
        cell = gb.Cell.load("table9")
        p = self.parameters(cell)
        self.assertEqual(p["Nominal cell capacity [A.h]"], 6)
        self.assertAlmostEqual(p["Ambient temperature [K]"], 298.15)
        for soc in (0.05, 0.1, 0.33, 0.95):
            self.assertAlmostEqual(p["Open-circuit voltage [V]"](soc), float(cell.ocv_at([soc])[0]), delta=2e-3)
            self.assertAlmostEqual(p["R0 [Ohm]"](298.15, 1.0, soc), np.interp(soc, cell.rc_soc, cell.r0_ohm))
            self.assertAlmostEqual(p["C1 [F]"](298.15, 1.0, soc), np.interp(soc, cell.rc_soc, cell.c1_f))

    def test_pybamm_circuit_has_the_voltage_of_the_model(self):
        """Steps the circuit of the exported parameters with PyBaMM's sign and compares with simulate()."""
        cell = gb.Cell.load("table9")
        p, soc, v_rc, volts = self.parameters(cell), 0.8, 0.0, []
        time_s = np.arange(600.0)
        discharge_a = np.where(time_s < 300, 4.0, 0.0)
        for i in discharge_a:
            if volts:
                r1, tau = p["R1 [Ohm]"](298.15, i, soc), p["R1 [Ohm]"](298.15, i, soc) * p["C1 [F]"](298.15, i, soc)
                v_rc = v_rc * np.exp(-1 / tau) - r1 * i * (1 - np.exp(-1 / tau))
                soc -= i / 3600 / p["Cell capacity [A.h]"]
            volts.append(p["Open-circuit voltage [V]"](soc) + v_rc - p["R0 [Ohm]"](298.15, i, soc) * i)
        run = gb.simulate(cell, {"time_s": time_s, "current_a": -discharge_a}, initial_soc=0.8)
        self.assertLess(np.max(np.abs(run.voltage_v - volts)), 2e-3)
        self.assertGreater(np.ptp(run.voltage_v), 0.05)

    def test_json_there_and_back(self):
        cell = gb.Cell.load("table9").scaled(100)
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "cell.json")
            gb.to_ecm_json(cell, path)
            again = gb.from_ecm_json(path)
        self.assertEqual(again.capacity_ah, 100)
        for name in ("rc_soc", "r0_ohm", "r1_ohm", "c1_f", "ocv_soc"):
            np.testing.assert_allclose(getattr(again, name), getattr(cell, name), rtol=1e-12)
        np.testing.assert_allclose(again.ocv_v, cell.ocv_v, atol=1e-9)
        run = gb.simulate(again, {"time_s": np.arange(60.0), "current_a": np.full(60, -50.0)}, initial_soc=0.5)
        same = gb.simulate(cell, {"time_s": np.arange(60.0), "current_a": np.full(60, -50.0)}, initial_soc=0.5)
        np.testing.assert_allclose(run.voltage_v, same.voltage_v, atol=1e-9)

    def test_json_with_a_fine_ocv_and_constant_resistances(self):
        soc = np.linspace(0, 1, 1001)
        volts = 3.2 + 0.1 * soc + 0.5 * soc**8 - 0.6 * np.exp(-soc / 0.03)
        document = {"Nominal cell capacity [A.h]": 50, "Lower voltage cut-off [V]": 2.5,
                    "Upper voltage cut-off [V]": 4.2, "R0 [Ohm]": 1e-3, "R1 [Ohm]": 5e-4,
                    "C1 [F]": {"x": [0.2, 0.8], "y": [3e4, 4e4]},
                    "Open-circuit voltage [V]": {"x": soc.tolist(), "y": volts.tolist()}}
        cell = gb.from_ecm_json(document, name="fine one")
        self.assertEqual(cell.name, "fine_one")
        self.assertLessEqual(len(cell.ocv_soc), 64)
        self.assertLess(np.max(np.abs(cell.ocv_at(soc) - volts)), 2e-3)
        self.assertEqual(cell.r0_ohm.tolist(), [1e-3] * len(cell.rc_soc))
        for key, value, text in (("R0 [Ohm]", "1e-3 * x", "expression"), ("C1 [F]", None, "C1"),
                                 ("R0 [Ohm]", 7.0, "out of range"),
                                 ("Open-circuit voltage [V]", {"x": [0.1, 1], "y": [3, 4]}, "does not reach")):
            with self.subTest(key=key, value=value), self.assertRaisesRegex(ValueError, re.escape(text)):
                gb.from_ecm_json({**document, key: value})


class Documentation(unittest.TestCase):
    def test_stubs_name_what_the_module_has(self):
        stub = ast.parse(pathlib.Path(gb.__file__).with_name("__init__.pyi").read_text())
        classes = {node.name: node for node in stub.body if isinstance(node, ast.ClassDef)}
        functions = {node.name: node for node in stub.body if isinstance(node, ast.FunctionDef)}
        values = {"FLAGS", "__version__"}
        self.assertEqual(set(gb.__all__), set(classes) | set(functions) | values)
        for name, node in functions.items():
            code = getattr(gb, name).__code__
            arguments = [a.arg for a in node.args.args + node.args.kwonlyargs]
            self.assertEqual(arguments, list(code.co_varnames[:code.co_argcount + code.co_kwonlyargcount]), name)
        for name, node in classes.items():
            members = {m.name for m in node.body if isinstance(m, ast.FunctionDef)}
            public = {m for m in vars(getattr(gb, name)) if not m.startswith("_")}
            self.assertEqual({m for m in members if not m.startswith("_")}, public, name)

    def test_everything_public_has_a_docstring(self):
        for name in gb.__all__:
            thing = getattr(gb, name)
            if not isinstance(thing, (dict, str)):
                self.assertTrue(thing.__doc__, name)
        for thing in (gb.Cell, gb.Recording, gb.Replay, gb.Simulation, gb.Estimate):
            for name, member in vars(thing).items():
                if not name.startswith("_"):
                    self.assertTrue(getattr(thing, name).__doc__, (thing, name))

    def run_page(self, name):
        """Every line of the page, in its order, in an empty folder."""
        text = (SOURCE / name).read_text()
        code = "\n".join(re.findall(r"^```python\n(.*?)^```", text, re.S | re.M))
        with tempfile.TemporaryDirectory() as folder:
            before = os.getcwd()
            os.symlink(SOURCE / "evidence", os.path.join(folder, "evidence"))
            os.chdir(folder)
            try:
                page = doctest.DocTestParser().get_doctest(code, {}, name, None, 0)
                self.assertGreater(len(page.examples), 15)
                found = []
                doctest.DocTestRunner(optionflags=doctest.ELLIPSIS).run(page, out=found.append)
            finally:
                os.chdir(before)
        self.assertFalse(found, "".join(found))

    def test_the_page_is_right(self):
        self.run_page("docs/python.md")

    def test_the_page_for_users_of_other_tools_is_right(self):
        self.run_page("docs/from_pybamm.md")


class Speed(unittest.TestCase):
    def test_a_replay_takes_at_most_twice_the_time_of_the_tool(self):
        """Processor time. Both read the file and replay it. Python starts before: that is not counted."""
        def of_processes(who):
            used = resource.getrusage(who)
            return used.ru_utime + used.ru_stime

        def of_tool():
            begin = of_processes(resource.RUSAGE_CHILDREN)
            tool("replay", SHIFT, "--quiet")
            return of_processes(resource.RUSAGE_CHILDREN) - begin

        def of_module():
            begin = of_processes(resource.RUSAGE_SELF)
            gb.replay("table9", SHIFT).soc.sum()
            return of_processes(resource.RUSAGE_SELF) - begin

        of_tool(), of_module()
        by_tool, by_module = (min(run() for _ in range(5)) for run in (of_tool, of_module))
        print(f"replay of the shift: tool {1e3 * by_tool:.0f} ms, module {1e3 * by_module:.0f} ms")
        self.assertLess(by_module, 2 * by_tool)


if __name__ == "__main__":
    unittest.main()
