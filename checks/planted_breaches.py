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
DIAGNOSE = "diagnosis/diagnose.cpp"

ROOMS = """
[room.model]
purpose = "Physics."
controller = true
[room.files]
purpose = "Reads files."
sees = ["model"]
[room.diagnosis]
purpose = "Finds causes."
sees = ["files"]
never = []
"""
CLEAN = {
    "checks/rooms.toml": ROOMS,
    "checks/long.toml": "[functions]\n[files]\n",
    "model/cell.hpp": "// A cell.\n#pragma once\n",
    "files/cell_file.hpp": '// Reads a cell.\n#pragma once\n#include "model/cell.hpp"\n',
    "diagnosis/thresholds.hpp": "#pragma once\nconstexpr double least_gain = 0.03;\n",
    DIAGNOSE: '#include "files/cell_file.hpp"\n\ndouble half(double x) { return 0.5 * x; }\n',
    "README.md": "The residual is not significant.\n",
}
LONG_FUNCTION = "void steps() {\n" + "  step();\n" * 59 + "}\n"
BREACHES = [  # check, file, what is added to it, what the check must say
    ("arrows", "model/cell.hpp", '#include "files/cell_file.hpp"\n', "model/cell.hpp:3: room model includes files"),
    ("arrows", "model/cell.hpp", '#include <files/cell_file.hpp>\n', "model/cell.hpp:3: room model includes files"),
    ("arrows", "model/cell.hpp", '#include "cell_file.hpp"\n', 'model/cell.hpp:3: "cell_file.hpp" belongs to no room'),
    ("arrows", "other/new.hpp", "#pragma once\n", "other/new.hpp:1: the folder other is missing in rooms.toml"),
    ("arrows", "checks/rooms.toml", '[room.empty]\npurpose = "Nothing."\n', "room empty is missing in the tree"),
    ("arrows", "checks/rooms.toml", ('[room.files]', 'sees = ["files"]\n[room.files]'), "a circle: "),
    ("arrows", "checks/rooms.toml", ('[room.files]', 'sees = ["files"]\n[room.files]'), "must not see files"),
    ("arrows", "checks/rooms.toml", ('["files"]', '["files", "model"]'), "diagnosis may see model, but no file"),
    ("arrows", "checks/rooms.toml", ('never = []', 'never = ["model"]'), "diagnosis reaches model through files"),
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
    ("words", "README.md", "For who builds a truck.\n", "README.md:2: For who ->"),
    ("format", DIAGNOSE, "int  badly( int x ){return x ;}\n", "diagnose.cpp:4:"),
    ("format", "reports/page/new.js", "const x = {a:1};\n", "reports/page/new.js:1:"),
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
    checks = ["arrows", "literals", "lengths", "statements", "words", "format"]
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


def faults_of_the_projects_rooms(root):
    """The project's own rooms.toml must refuse a header of the estimator that includes the reader of cell files."""
    paths = sources.paths(PROJECT, (*sources.CPP, "rooms.toml"))
    for path in paths:
        write(root, path, sources.read(PROJECT, path))
    victim = next(path for path in paths if path.startswith("estimator/"))
    message = f"{victim}:1: room estimator includes files"
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
    for part in (faults_of, faults_of_the_projects_rooms):
        with tempfile.TemporaryDirectory() as root:
            faults += part(root)
    print("\n".join(faults + [f"planted breaches: {len(faults)} faults"]))
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
