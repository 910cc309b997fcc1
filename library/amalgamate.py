#!/usr/bin/python3
"""Writes the model and the estimator as one header: greybox_single.hpp.

    amalgamate.py OUT.hpp [HEADER...]    HEADER: of library/greybox/; if not given all but c_interface.hpp

The header of a cell includes it instead of <greybox/model.hpp>:
    bms cell header my_cell.toml --include '"greybox_single.hpp"' --out my_cell.hpp
"""
import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
FIRST = ("estimator.hpp", "model.hpp", "condition.hpp", "pack.hpp")
OWN = re.compile(r'^#include "([^"]+)"$')
SYSTEM = re.compile(r"^#include (<[^>]+>)$")


class Single:
    """Each own header once, before the first line that needs it; the system's headers at the top."""

    def __init__(self):
        self.done, self.system, self.lines = set(), set(), []

    def add(self, path):
        if path in self.done:
            return
        self.done.add(path)
        text = (ROOT / path).read_text(encoding="utf-8")
        if re.search(r"^#if.*\n#include \"", text, re.M):
            self.add_choice(path, text)
            return
        kept = []
        for line in text.splitlines():
            if own := OWN.match(line):
                self.add(own[1])
            elif system := SYSTEM.match(line):
                self.system.add(system[1])
            elif line != "#pragma once":
                kept.append(line)
        self.lines += ["", f"// ---- {path} ----", ""] + without_head(kept)

    def add_choice(self, path, text):
        """A header that includes one of several: each choice stands under its condition, what they share before it."""
        choices = [OWN.match(line)[1] for line in text.splitlines() if OWN.match(line)]
        for choice in choices:
            for line in (ROOT / choice).read_text(encoding="utf-8").splitlines():
                if own := OWN.match(line):
                    self.add(own[1])
        self.lines += ["", f"// ---- {path} ----", ""]
        for line in text.splitlines():
            if own := OWN.match(line):
                before, self.lines = self.lines, []
                self.add(own[1])
                self.lines = before + self.lines
            elif line != "#pragma once" and not line.startswith("//"):
                self.lines.append(line)

    def text(self, version):
        head = [f"// greybox-bms {version}: model and estimator of a cell in one header.",
                "// Made by library/amalgamate.py.", "//"]
        head += ["// " + line if line else "//" for line in (ROOT / "LICENSE").read_text(encoding="utf-8").splitlines()]
        head += ["#pragma once", ""] + [f"#include {name}" for name in sorted(self.system)]
        return re.sub(r"\n{3,}", "\n\n", "\n".join(head + self.lines)) + "\n"


def without_head(lines):
    while lines and not lines[0].strip():
        lines = lines[1:]
    return lines


def main():
    if len(sys.argv) < 2 or sys.argv[1].startswith("-"):
        print(__doc__.strip(), file=sys.stderr)
        return 2
    project = (ROOT / "CMakeLists.txt").read_text(encoding="utf-8")
    version = re.search(r"project\(\w+ VERSION ([0-9.]+)", project)[1]
    single = Single()
    for header in sys.argv[2:] or FIRST:
        single.add(f"library/greybox/{header}")
    pathlib.Path(sys.argv[1]).write_text(single.text(version), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
