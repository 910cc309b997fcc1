#!/usr/bin/python3
"""Measures flash and RAM of the C interface on two cores and writes the table of README.md, or compares with it.

    footprint.py BMS INCLUDE [--check]    BMS: the tool; INCLUDE: folder with greybox/, as CMake generates it

Counted is what the linker keeps of a program that creates one estimator and steps it: code and tables of the estimator,
the mathematics of the compiler's library, nothing of the start of a program. --check fails if a figure has grown by
more than 5 %.
"""
import pathlib
import re
import subprocess
import sys
import tempfile

PAGE = pathlib.Path(__file__).resolve().with_name("README.md")
MARKS = ("<!-- figures: footprint -->\n", "<!-- end of figures -->")
CORES = {"Cortex-M4F": ("float", "-mcpu=cortex-m4 -mthumb -mfloat-abi=hard -mfpu=fpv4-sp-d16"),
         "Cortex-M0": ("greybox::FixedPoint", "-mcpu=cortex-m0 -mthumb")}
CASES = [("Cortex-M4F", "table9"), ("Cortex-M4F", "a123_26650_extended"), ("Cortex-M0", "table9")]
MOST_GROWTH = 1.05
PROGRAM = """#include "cell.hpp"
#include <greybox/c_interface.hpp>
alignas(8) static unsigned char memory[sizeof(greybox_estimator)];
extern "C" void footprint(const greybox_sample* sample, greybox_estimate* estimate) {
  greybox_estimator* estimator = nullptr;
  if (greybox_create(memory, sizeof memory, nullptr, &estimator) == GREYBOX_OK)
    for (;;) greybox_step(estimator, sample, estimate);
}
"""


def run(*command):
    return subprocess.run(list(map(str, command)), capture_output=True, text=True, check=True).stdout


def measure(bms, include, core, cell, optimisation):
    scalar, flags = CORES[core]
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        fixed = ["--fixed"] if scalar != "float" else []
        run(bms, "cell", "header", cell, "--out", folder / "cell.hpp", "--quiet", *fixed)
        (folder / "program.cpp").write_text(PROGRAM)
        run("arm-none-eabi-g++", *flags.split(), optimisation, "-std=c++20", "-ffp-contract=off", "-fno-math-errno",
            "-fno-exceptions", "-fno-rtti", "-ffunction-sections", "-fdata-sections", f"-DGREYBOX_SCALAR={scalar}",
            "-I", include, "-I", folder, folder / "program.cpp", "-o", folder / "program.elf", "-nostartfiles",
            "--specs=nano.specs", "-Wl,--gc-sections", "-Wl,--entry=footprint")
        text, data, bss = map(int, run("arm-none-eabi-size", folder / "program.elf").splitlines()[1].split()[:3])
        return text + data, data + bss


def table(bms, include):
    rows = []
    for core, cell in CASES:
        for optimisation in ("-Os", "-O2"):
            flash, ram = measure(bms, include, core, cell, optimisation)
            arithmetic = "float" if CORES[core][0] == "float" else "fixed point"
            rows.append((f"{core}, {arithmetic}, `{cell}`, `{optimisation}`", flash, ram))
    return rows


def main():
    bms, include = sys.argv[1:3]
    rows = table(bms, include)
    before, _, rest = PAGE.read_text(encoding="utf-8").partition(MARKS[0])
    old, mark, after = rest.partition(MARKS[1])
    if "--check" in sys.argv:
        rows_before = re.findall(r"^\| (.*?) \| (\d+) \| (\d+) \|$", old, re.M)
        known = {name: (int(flash), int(ram)) for name, flash, ram in rows_before}
        wrong = [f"{name}: {flash} and {ram} bytes, README.md has {known.get(name)}" for name, flash, ram in rows
                 if name not in known or flash > MOST_GROWTH * known[name][0] or ram > MOST_GROWTH * known[name][1]]
        print("\n".join(wrong))
        return 1 if wrong else 0
    lines = ["| core, arithmetic, cell, optimisation | flash [bytes] | RAM of one estimator [bytes] |", "|---|---|---|"]
    lines += [f"| {name} | {flash} | {ram} |" for name, flash, ram in rows]
    PAGE.write_text(before + MARKS[0] + "\n".join(lines) + "\n" + mark + after, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
