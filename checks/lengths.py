#!/usr/bin/python3
"""Measures functions, files and line widths, and refuses what is above the guides and not listed in long.toml.

Guides: a function at most 60 lines, a product file below 400 lines, a test file below 600 lines. What stays longer is
listed in long.toml with its reason. An entry that is no longer above its guide is refused as well. A line above 120
columns is always refused.

Measured are C++ and Python. A function counts from the line of its name to its closing brace, with its lambdas. A file
counts in physical lines. Widths are also measured in the other sources (CODE), not in texts and data (.md, .toml).
universal-ctags finds the functions.

Exit code: 0 nothing to refuse, 1 something above a guide, 2 ctags or long.toml cannot be used.
"""
import json
import os
import re
import sys
import tomllib

sys.dont_write_bytecode = True  # no __pycache__ in the source tree
import sources

FUNCTION, FILE, TEST_FILE, WIDTH = 60, 399, 599, 120  # most lines, most columns
CODE = (*sources.CPP, ".py", ".js", ".css", ".html", ".cmake", ".sh", ".ld", "CMakeLists.txt", "bms")


def functions(root, paths):
    """Yields (path, line, name, lines) of each function; the name of a test is "Suite.Name"."""
    command = ["ctags", "--output-format=json", "--fields=+neS", "--kinds-c++=f", "--kinds-c=f", "--kinds-python=fm",
               "--langmap=C++:+.h", "-f", "-", "-L", "-"]
    tags = sources.run(command, cwd=root, input="\n".join(paths))
    if tags.returncode:
        raise OSError(tags.stderr.strip())
    for tag in map(json.loads, tags.stdout.splitlines()):
        name, scope = tag["name"], tag.get("scope", "").split("::")[-1].split(".")[-1]
        if name.startswith("__anon") or "end" not in tag:
            continue
        if re.fullmatch(r"(TYPED_)?TEST(_F|_P)?", name):
            name = ".".join(re.findall(r"\w+", tag["signature"])[:2])
        elif tag.get("scopeKind") in ("class", "struct") and not scope.startswith("__anon"):
            name = f"{scope}::{name}"
        yield tag["path"], tag["line"], name, tag["end"] - tag["line"] + 1


def row(title, lengths, most):
    """A line of the summary: count, median, 90th percentile, maximum, number above the guide."""
    x = sorted(lengths) or [0]
    figures = (len(lengths), x[len(x) // 2], x[len(x) * 9 // 10], x[-1], sum(length > most for length in x))
    return f"{title:<24}" + "".join(f"{figure:>9}" for figure in figures) + f"{most:>9}"


def is_test(path):
    return path.startswith("tests/")


def measure(root):
    """Rows of the summary, what is above ({"functions" | "files": {key: place with length}}), and the wide lines."""
    table = [f"{'':<24}" + "".join(f"{title:>9}" for title in ("count", "median", "p90", "max", "above", "at most"))]
    above, wide = {"functions": {}, "files": {}}, []
    paths = sources.paths(root, (*sources.CPP, ".py"))
    found = list(functions(root, paths))
    texts = {path: sources.read(root, path).splitlines() for path in sources.paths(root, CODE)}
    for kind, tests, most in (("product", False, FILE), ("tests", True, TEST_FILE)):
        here = [function for function in found if is_test(function[0]) is tests]
        table.append(row(f"functions, {kind}", [length for *_, length in here], FUNCTION))
        for path, line, name, length in here:
            if length > FUNCTION:
                above["functions"][f"{path}:{name}"] = f"{path}:{line}: function {name} has {length} lines"
        files = {path: len(texts[path]) for path in paths if is_test(path) is tests}
        table.append(row(f"files, {kind}", files.values(), most))
        for path, length in files.items():
            if length > most:
                above["files"][path] = f"{path}:1: the file has {length} lines"
        lines = [(path, k, len(line)) for path, text in texts.items() if is_test(path) is tests
                 for k, line in enumerate(text, 1) if line]
        table.append(row(f"lines in columns, {kind}", [width for *_, width in lines], WIDTH))
        wide += [f"{path}:{k}: the line has {width} columns" for path, k, width in lines if width > WIDTH]
    return table, above, wide


def main():
    options = sources.options("Measures functions, files and line widths.")
    options.add_argument("--list", action="store_true", help="print all that is above a guide, longest first")
    given = options.parse_args()
    try:
        listed = {"functions": {}, "files": {}}
        if os.path.exists(data := os.path.join(given.root, "checks/long.toml")):
            with open(data, "rb") as file:
                listed |= tomllib.load(file)
        table, above, wide = measure(given.root)
    except (OSError, ValueError) as error:
        print(f"lengths: {error}", file=sys.stderr)
        return 2
    faults = list(wide)
    for kind, entries in above.items():
        faults += [place + ", not listed in long.toml" for key, place in entries.items() if key not in listed[kind]]
        faults += [f"long.toml: {key} is not above its guide" for key in listed[kind] if key not in entries]
        faults += [f"long.toml: {key} has no reason" for key, reason in listed[kind].items() if not str(reason).strip()]
    if given.list:
        longest_first = lambda places: sorted(places, key=lambda place: -int(re.findall(r"\d+", place)[-1]))
        kinds = (*(entries.values() for entries in above.values()), wide)
        print("\n".join(place for places in kinds for place in longest_first(places)))
        faults = []
    print("\n".join(faults + table))
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
