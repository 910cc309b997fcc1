#!/usr/bin/python3
"""Checks tests/long.txt, the tests that ./bms test leaves to ./bms test all: each is a test of the sources, once, with
its seconds and a reason. A name that no test has would leave nothing out and stay unnoticed; a test that the reason
names runs by default.

Exit code: 0 no fault, 1 a fault.
"""
import re
import sys

sys.dont_write_bytecode = True  # no __pycache__ in the source tree
import sources

LIST = "tests/long.txt"


def main():
    root = sources.options("Checks the list of tests that take long.").parse_args().root
    tests = set()
    for path in sources.paths(root, sources.CPP):
        if path.startswith("tests/"):
            tests |= {".".join(found) for found in re.findall(r"^TEST(?:_F|_P)?\((\w+), (\w+)\)",
                                                              sources.read(root, path), re.M)}
    for path in sources.paths(root, ("CMakeLists.txt",)):
        text = sources.read(root, path)
        tests |= set(re.findall(r"add_test\(NAME (\w+\.\w+)", text))
        for of, names in re.findall(r"foreach\(\w+ ([^)]*)\)(?:(?!endforeach).)*?add_test\(NAME (\w+\.)\$",
                                    text, re.S):
            tests |= {names + one for one in of.split()}
    faults, seen = [], set()
    listed = re.findall(r"^(?:\w+/)?(\w+\.\w+)", sources.read(root, LIST), re.M)
    for number, line in enumerate(sources.read(root, LIST).splitlines(), 1):
        if line.startswith("#"):
            continue
        row = re.fullmatch(r"(?:\w+/)?(\w+\.\w+)(/\w+)? (\d+) (\S.*)", line)
        if not row:
            faults.append(f"{LIST}:{number}: expected NAME SECONDS REASON")
        elif row[1] not in tests:
            faults.append(f"{LIST}:{number}: no test is called {row[1]}")
        elif line.split()[0] in seen:
            faults.append(f"{LIST}:{number}: {row[1]} is there twice")
        elif row[1] in tests and any(one.startswith(named) for named in re.findall(r"\b[A-Z]\w+\.[A-Z]\w+", row[4])
                                     for one in listed if one != row[1]):
            faults.append(f"{LIST}:{number}: what stands for {row[1]} is long itself")
        seen.add(line.split()[0])
    print("\n".join(faults + [f"long tests: {len(seen)} tests, {len(faults)} faults"]))
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
