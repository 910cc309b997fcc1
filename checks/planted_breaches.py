#!/usr/bin/python3
"""Shows that each check passes on a clean tree and fails on a breach.

A small tree in a temporary folder is clean. Each breach changes one file of it. The check must then fail and name the
breach. The words and the format are those of the project (words.toml, .clang-format). One breach is put into a copy of
the project's own sources, to show that its rooms.toml refuses it.

Exit code: 0 every breach was refused, 1 at least one was not.
"""
import os
import shutil
import sys
import tempfile

sys.dont_write_bytecode = True  # no __pycache__ in the source tree
import sources

OWN = os.path.dirname(os.path.abspath(__file__))
PROJECT = os.path.dirname(OWN)
DIAGNOSE = "inference/diagnosis/diagnose.cpp"

ROOMS = """
include_roots = ["host_sim", "inference"]
[room.model]
purpose = "Physics."
controller = true
[room."host_sim/files"]
purpose = "Reads files."
sees = ["model"]
[room."inference/diagnosis"]
purpose = "Finds causes."
sees = ["host_sim/files"]
never = []
[room.tests]
purpose = "Tests."
"""
CLEAN = {
    "checks/rooms.toml": ROOMS,
    "checks/long.toml": "[functions]\n[files]\n",
    "model/cell.hpp": "// A cell.\n#pragma once\n",
    "host_sim/files/cell_file.hpp": '// Reads a cell.\n#pragma once\n#include "model/cell.hpp"\n',
    "inference/diagnosis/thresholds.hpp": "#pragma once\nconstexpr double least_gain = 0.03;\n",
    DIAGNOSE: '#include "files/cell_file.hpp"\n\ndouble half(double x) { return 0.5 * x; }\n',
    "README.md": "The residual is not significant.\n",
    "tests/long.txt": "# Long.\nCell.IsRight 20 slow\n",
    "tests/cell_test.cpp": "TEST(Cell, IsRight) {}\nTEST(Cell, IsLong) {}\n",
}
SAFETY_CLEAN = {
    "firmware/protection/faults.hpp": "enum class Fault { hot, cold };  // not: warm\n",
    "firmware/protection/README.md": "<!-- figures: table -->\n"
    "| bit | fault | raised when | for | released when | for | recovery | reaction | reason |\n"
    "| 0 | hot | x > 60 | 5 s | x < 50 | 60 s | automatic | open | slow |\n"
    "| 1 | cold | x < 0 | 5 s | x > 2 | 60 s | automatic | open | slow |\n<!-- end of figures -->\n",
    "firmware/protection/table.hpp": "int rows(int hot, int cold);  // and warm\n",
    "tests/table_test.cpp": "TEST(Table, IsRight) {}\nTEST_F(Row, Opens) {}\n",
    "docs/safety/requirements.toml": '[[requirement]]\nid = "SR-01"\ntext = "It opens."\nhazards = ["H-01"]\n'
    'faults = ["hot", "cold"]\ncode = ["firmware/protection/table.hpp:rows"]\ntests = ["Table.IsRight", "Row.Opens"]\n'
    'assumptions = ["A-01"]\n[[requirement]]\nid = "SR-02"\ntext = "It brakes."\nhazards = ["H-01"]\n'
    'assumptions = ["A-01"]\nlimits = ["L-01"]\n',
    "docs/safety/hazards.md": "| H-01 | fire | S2 | F2 | P1 | d | No fire. | open | 60 s |\n",
    "docs/safety/assumptions.md": "| A-01 | fuse | It melts. |\n| L-01 | It is slow. | late |\n",
    "docs/safety/failures.md": "| F-01 | wire | none | *hot*, `Row.Opens` | 5 s | open | - |\n",
    "docs/safety/threats.md": "| AS-01 | opening | severe |\n| AT-1 | a node | frames |\n"
    "| T-01 | AS-01 | forged | AT-1, none | high | 5 | a code | `firmware/protection/table.hpp:rows` | "
    "`Row.Opens` | 1 |\n",
    "docs/safety/traceability.md": "".join(f"<!-- figures: {name} -->\n<!-- end of figures -->\n"
                                          for name in ("rows", "hazards", "requirements")),
}
DATA = "docs/safety/requirements.toml"
SAFETY_BREACHES = [  # file, what is added or replaced, what the check must say
    ("firmware/protection/faults.hpp", ("cold", "cold, stuck"), f"{DATA}:1: no requirement names the fault stuck"),
    ("firmware/protection/faults.hpp", ("cold", "cold, stuck"),
     "README.md:1: the generated table has no row for stuck"),
    ("firmware/protection/README.md", ("60 |", "65 |"), "docs/safety/traceability.md:1: the table rows is out of date"),
    ("firmware/protection/table.hpp", ("rows", "lines"),
     f"{DATA}:2: SR-01: firmware/protection/table.hpp:rows: rows is not in the code"),
    ("tests/table_test.cpp", ("IsRight", "IsGood"), f"{DATA}:2: SR-01: Table.IsRight: neither a test"),
    ("tests/table_test.cpp", ("Opens", "Closes"), "failures.md:1: F-01 names Row.Opens: neither a test"),
    (DATA, ('"cold"', '"warm"'), f"{DATA}:2: SR-01: names warm, which does not exist among the faults"),
    (DATA, ('"cold"', '"warm"'), "no requirement names the fault cold"),
    (DATA, ("table.hpp:rows", "table.hpp:warm"), "warm is not in the code of firmware/protection/table.hpp"),
    (DATA, ("table.hpp:rows", "table.hpp:hot"), "the requirements of the fault cold name only code of other faults"),
    (DATA, ('code = ["firmware/protection/table.hpp:rows"]', "code = []"), f"{DATA}:2: SR-01: has no code"),
    (DATA, ('tests = ["Table.IsRight", "Row.Opens"]', "tests = []"), f"{DATA}:2: SR-01: has no tests"),
    (DATA, ('hazards = ["H-01"]\nfaults', 'hazards = []\nfaults'), f"{DATA}:2: SR-01: has no hazard"),
    (DATA, ('"A-01"]\nlimits', '"A-02"]\nlimits'), f"{DATA}:10: SR-02: names A-02, which does not exist"),
    (DATA, ('"L-01"', '"L-02"'), f"{DATA}:10: SR-02: names L-02, which does not exist among the limits"),
    (DATA, ('"SR-02"', '"SR-01"'), "SR-01 is there twice"),
    (DATA, ('text = "It brakes."', 'text = "It brakes."\nhazard = []'), "SR-02: unknown key hazard"),
    ("docs/safety/hazards.md", ("| d |", "| c |"), "hazards.md:1: H-01: S2 F2 P1 c: expected S, F, P and PLr d"),
    ("docs/safety/hazards.md", "| H-02 | gas | S1 | F1 | P1 | a | - | - | - |\n", "no requirement names H-02"),
    ("docs/safety/assumptions.md", "| A-02 | fan | It turns. |\n", "assumptions.md:3: no requirement names A-02"),
    ("docs/safety/assumptions.md", "| L-01 | Again. | - |\n", "assumptions.md:3: L-01 is there twice"),
    ("docs/safety/failures.md", ("*hot*", "*warm*"), "failures.md:1: F-01 names the protection row warm"),
    ("docs/safety/threats.md", ("table.hpp:rows", "table.hpp:warm"), "T-01 names firmware/protection/table.hpp:warm"),
    ("docs/safety/threats.md", ("`Row.Opens`", "`Row.Shuts`"), "threats.md:3: T-01 names Row.Shuts: neither a test"),
    ("docs/safety/threats.md", ("`Row.Opens`", "-"), "threats.md:3: T-01 has no tests"),
    ("docs/safety/threats.md", ("AT-1, none", "AT-2"), "threats.md:3: T-01 names AT-2, which does not exist"),
    ("docs/safety/threats.md", "| AS-02 | closing | major |\n", "threats.md:4: no threat names AS-02"),
]
LONG_FUNCTION = "void steps() {\n" + "  step();\n" * 59 + "}\n"
FILES = '[room."host_sim/files"]'
SEES_FILES = 'sees = ["host_sim/files"]'
BREACHES = [  # check, file, what is added to it, what the check must say
    ("arrows", "model/cell.hpp", '#include "files/cell_file.hpp"\n', "cell.hpp:3: room model includes host_sim/files"),
    ("arrows", "model/cell.hpp", '#include <files/cell_file.hpp>\n', "cell.hpp:3: room model includes host_sim/files"),
    ("arrows", "model/cell.hpp", '#include "cell_file.hpp"\n', 'model/cell.hpp:3: "cell_file.hpp" belongs to no room'),
    ("arrows", "other/new.hpp", "#pragma once\n", "other/new.hpp:1: the folder other is missing in rooms.toml"),
    ("arrows", "checks/rooms.toml", '[room.empty]\npurpose = "Nothing."\n', "room empty is missing in the tree"),
    ("arrows", "checks/rooms.toml", (FILES, f"{SEES_FILES}\n{FILES}"), "a circle: "),
    ("arrows", "checks/rooms.toml", (FILES, f"{SEES_FILES}\n{FILES}"), "must not see host_sim/files"),
    ("arrows", "checks/rooms.toml", (SEES_FILES, SEES_FILES.replace("]", ', "model"]')),
     "diagnosis may see model, but no file"),
    ("arrows", "checks/rooms.toml", ('never = []', 'never = ["model"]'),
     "diagnosis reaches model through host_sim/files"),
    ("literals", DIAGNOSE, "bool large(double x) { return x > 0.03; }\n", "diagnose.cpp:4: 0.03 is a bare number"),
    ("literals", DIAGNOSE, "bool late(double t) { return t > 60; }\n", "diagnose.cpp:4: 60 is a bare number"),
    ("literals", DIAGNOSE, "double third(double* x) { return x[3]; }\n", "diagnose.cpp:4: 3 is a bare number"),
    ("lengths", "model/cell.hpp", "//" + 119 * "-" + "\n", "model/cell.hpp:3: the line has 121 columns"),
    ("lengths", "model/cell.hpp", LONG_FUNCTION, "model/cell.hpp:3: function steps has 61 lines"),
    ("lengths", "model/cell.hpp", 400 * "//\n", "model/cell.hpp:1: the file has 402 lines"),
    ("lengths", "checks/long.toml", '"model/cell.hpp" = "A list."\n', "model/cell.hpp is not above its guide"),
    ("statements", DIAGNOSE, "int f(int a) { return a ? 1 : a > 2 ? 3 : 4; }\n", "diagnose.cpp:4: a conditional"),
    ("statements", DIAGNOSE, "int f(int a) { return a ? (a > 2 ? 3 : 4) : 1; }\n", "diagnose.cpp:4: a conditional"),
    ("statements", DIAGNOSE, "void f(int a, int b) {\n  if (a) a = 1, b = 2;\n}\n", "diagnose.cpp:5: a comma"),
    ("words", "model/cell.hpp", "// A value of 15,\n// which is none.\n", "model/cell.hpp:4: is none ->"),
    ("words", "model/cell.hpp", "void know_anew(int state);\n", "model/cell.hpp:3: know_anew ->"),
    ("words", DIAGNOSE, 'auto text = "a fault beside it";\n', "diagnose.cpp:4: beside ->"),
    ("long_tests", "tests/long.txt", "Cell.IsWrong 20 slow\n", "tests/long.txt:3: no test is called Cell.IsWrong"),
    ("long_tests", "tests/long.txt", "Cell.IsLong 20 Cell.IsRight is one\n",
     "tests/long.txt:3: what stands for Cell.IsLong is long itself"),
    ("words", "README.md", "For who builds a truck.\n", "README.md:2: For who ->"),
    ("format", DIAGNOSE, "int  badly( int x ){return x ;}\n", "diagnose.cpp:4:"),
    ("format", "host_sim/reports/page/new.js", "const x = {a:1};\n", "host_sim/reports/page/new.js:1:"),
]


def write(root, path, text):
    os.makedirs(os.path.dirname(os.path.join(root, path)), exist_ok=True)
    with open(os.path.join(root, path), "w", encoding="utf-8") as file:
        file.write(text)


def outcome(check, root):
    done = sources.run([sys.executable, os.path.join(OWN, check + ".py"), "--root", root])
    return done.returncode, done.stdout + done.stderr


def faults_of(root):
    """Yields a message for each check that does not behave."""
    checks = ["arrows", "literals", "lengths", "statements", "words", "format", "long_tests"]
    for path, text in CLEAN.items():
        write(root, path, text)
    for check in checks:
        code, said = outcome(check, root)
        if code:
            yield f"{check}: fails on a clean tree\n{said}"
    for check, path, change, message in BREACHES:
        before = CLEAN.get(path, "")
        write(root, path, before + change if isinstance(change, str) else before.replace(*change))
        code, said = outcome(check, root)
        if code != 1 or message not in said:
            yield f'{check}: does not refuse a breach in {path}, expected "{message}"\n{said}'
        else:
            print(f"{check}: refuses a breach in {path}: {message}")
        if path in CLEAN:
            write(root, path, before)
        else:
            shutil.rmtree(os.path.join(root, os.path.dirname(path)))


def faults_of_the_safety_check(root):
    """Yields a message for each breach of a small safety file that checks/safety.py accepts."""
    for path, text in SAFETY_CLEAN.items():
        write(root, path, text)
    if not outcome("safety", root)[0]:
        yield "safety: accepts tables that were never written"
    sources.run([sys.executable, os.path.join(OWN, "safety.py"), "--root", root, "--write"])
    if outcome("safety", root)[0]:
        yield f"safety: fails on a clean tree\n{outcome('safety', root)[1]}"
    for path, change, message in SAFETY_BREACHES:
        before = SAFETY_CLEAN[path]
        write(root, path, before + change if isinstance(change, str) else before.replace(*change))
        code, said = outcome("safety", root)
        if code != 1 or message not in said:
            yield f'safety: does not refuse a breach in {path}, expected "{message}"\n{said}'
        else:
            print(f"safety: refuses a breach in {path}: {message}")
        write(root, path, before)


def faults_of_the_projects_rooms(root):
    """The project's own rooms.toml must refuse a header of the estimator that includes the reader of cell files."""
    paths = sources.paths(PROJECT, (*sources.CPP, "rooms.toml"))
    for path in paths:
        write(root, path, sources.read(PROJECT, path))
    victim = next(path for path in paths if path.startswith("estimator/"))
    message = f"{victim}:1: room estimator includes host_sim/files"
    if message in outcome("arrows", root)[1]:
        yield f"arrows: finds a breach in {victim} before it is there"
    write(root, victim, '#include "files/cell_file.hpp"\n' + sources.read(PROJECT, victim))
    code, said = outcome("arrows", root)
    if code != 1 or message not in said:
        yield f"arrows: the project's rooms.toml does not refuse: {message}\n{said}"
    else:
        print(f"arrows: the project's rooms.toml refuses: {message}")


def main():
    faults = []
    for part in (faults_of, faults_of_the_safety_check, faults_of_the_projects_rooms):
        with tempfile.TemporaryDirectory() as root:
            faults += part(root)
    print("\n".join(faults + [f"planted breaches: {len(faults)} faults"]))
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
