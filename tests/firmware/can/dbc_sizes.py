"""Judges the DBC file of each number of cells by canmatrix: dbc_sizes.py ROOT

Each has exactly the cells of its pack; its messages have the identifiers, and its signals the layouts, of the whole
file; a pack voltage is in one message. Nothing names a message or a signal that is gone. Another number is refused.
"""
import os
import re
import subprocess
import sys
import tempfile

root = sys.argv[1]
sys.path.insert(0, os.path.join(root, "cmake"))
sys.dont_write_bytecode = True
import dbc_file  # noqa: E402

DBC = os.path.join(root, "firmware", "can", "greybox_bms.dbc")
TOOL = os.path.join(root, "cmake", "dbc_of_size.py")


def layout(signal):
    return (signal.start_bit, signal.size, signal.is_signed, str(signal.factor), str(signal.offset), signal.unit,
            str(signal.min), str(signal.max), dict(signal.values), signal.comment)


def check(condition, text):
    if not condition:
        sys.exit(f"dbc_sizes: {text}")


def run(cells):
    return subprocess.run([sys.executable, TOOL, str(cells)], capture_output=True, text=True, check=False)


whole = {frame.name: frame for frame in dbc_file.load(DBC).frames}
for cells in range(2, 33):
    done = run(cells)
    check(done.returncode == 0, f"{cells} cells: {done.stderr}")
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "battery.dbc")
        with open(path, "w", encoding="utf-8") as file:
            file.write(done.stdout)
        of_size = {frame.name: frame for frame in dbc_file.load(path).frames}
    shown = [s.name for frame in of_size.values() for s in frame.signals if re.fullmatch(r"Cell\d+", s.name)]
    check(sorted(shown) == sorted(f"Cell{k}" for k in range(1, cells + 1)), f"{cells} cells: shows {shown}")
    gone = set(whole) - set(of_size)
    check(set(of_size) <= set(whole), f"{cells} cells: a message of its own")
    check(all(name.startswith("CellVoltages") or name == "PackVoltage" for name in gone), f"{cells} cells: no {gone}")
    for name, frame in of_size.items():
        check(frame.arbitration_id == whole[name].arbitration_id, f"{cells} cells: {name} has another identifier")
        check(frame.attributes == whole[name].attributes, f"{cells} cells: {name} has other attributes")
        of_whole = {s.name: layout(s) for s in whole[name].signals}
        for signal in frame.signals:
            check(layout(signal) == of_whole[signal.name], f"{cells} cells: {name}.{signal.name} has another layout")
    pack_voltages = [f for f in ("PackElectrical", "PackVoltage")
                     if f in of_size and any(s.name == "Voltage" for s in of_size[f].signals)]
    check(pack_voltages == (["PackVoltage"] if cells > 16 else ["PackElectrical"]),
          f"{cells} cells: pack voltage in {pack_voltages}")
    named = set(re.findall(r'^(?:CM_ BO_|CM_ SG_|VAL_|BA_ "\w+" BO_|BA_ "\w+" SG_) (\d+)', done.stdout, re.M))
    there = set(re.findall(r"^BO_ (\d+)", done.stdout, re.M))
    check(named <= there, f"{cells} cells: {named - there} are named, but gone")
for cells in (0, 1, 33):
    done = run(cells)
    check(done.returncode == 2 and "2 to 32" in done.stderr, f"{cells} cells are not refused: {done.stderr}")
print("dbc_sizes: 2 to 32 cells")
