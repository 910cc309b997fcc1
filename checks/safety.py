#!/usr/bin/python3
"""Refuses gaps in the safety file docs/safety/ and writes its tables: checks/safety.py [--write] [--root FOLDER]

requirements.toml connects each row of the protection table with hazards, code and tests. Refused are:

  a fault of firmware/protection/faults.hpp without a requirement, without code that is not only another fault's, or
  without a row in firmware/protection/README.md
  a requirement without a hazard; without code or tests, unless it is allocated to the vehicle by assumptions
  a hazard, fault, assumption, known limit, code symbol or test that is named but does not exist
  a hazard, an assumption or a known limit that no requirement names
  a PLr that does not follow from S, F and P by the risk graph of EN ISO 13849-1, annex A
  a failure in failures.md that names an unknown protection row or an unknown test
  a threat in threats.md without an asset, an attacker, code or a test that exist; an asset that no threat names
  tables in traceability.md that are not those of the data; --write writes them

Exit code: 0 no fault, 1 faults, 2 a file of the safety file is missing or unreadable.
"""
import os
import re
import sys
import tomllib

sys.dont_write_bytecode = True  # no __pycache__ in the source tree
import sources

FOLDER = "docs/safety"
DATA, HAZARDS, ASSUMPTIONS, FAILURES, TRACE, THREATS = (f"{FOLDER}/{name}" for name in (
    "requirements.toml", "hazards.md", "assumptions.md", "failures.md", "traceability.md", "threats.md"))
FAULTS, TABLE = "firmware/protection/faults.hpp", "firmware/protection/README.md"
RISK_GRAPH = {("S1", "F1", "P1"): "a", ("S1", "F1", "P2"): "b", ("S1", "F2", "P1"): "b", ("S1", "F2", "P2"): "c",
              ("S2", "F1", "P1"): "c", ("S2", "F1", "P2"): "d", ("S2", "F2", "P1"): "d", ("S2", "F2", "P2"): "e"}
KEYS = ("id", "text", "hazards", "faults", "code", "tests", "assumptions", "limits")
TEST = re.compile(r"^(?:TYPED_)?TEST(?:_[FP])?\(\s*(\w+),\s*(\w+)\s*\)", re.M)
MARKS = r"(<!-- figures: {} -->\n).*?(<!-- end of figures -->)"


def cells_of(line):
    return [cell.strip() for cell in line.strip().strip("|").split("|")]


def table_rows(text, id_pattern):
    """Yields (line number, cells) of each table row whose first cell matches."""
    for number, line in enumerate(text.splitlines(), 1):
        if line.startswith("|") and re.fullmatch(id_pattern, (cells := cells_of(line))[0]):
            yield number, cells


class SafetyFile:
    """All that the safety file and the sources state, as read from the tree."""

    def __init__(self, root):
        self.root = root
        self.data_text = sources.read(root, DATA)
        self.requirements = tomllib.loads(self.data_text)["requirement"]
        self.every_row = tomllib.loads(self.data_text).get("every_row", {}).get("tests", [])
        body = re.search(r"enum class Fault\b[^{]*\{(.*?)\}", sources.read(root, FAULTS), re.S)
        self.faults = re.findall(r"\w+", sources.code(body[1], FAULTS)) if body else []
        table = re.search(MARKS.format("table"), sources.read(root, TABLE), re.S)
        self.rows = {cells[1].replace(" ", "_"): cells for _, cells in table_rows(table[0] if table else "", r"\d+")}
        self.hazards = list(table_rows(sources.read(root, HAZARDS), r"H-\d+"))
        self.assumptions = list(table_rows(sources.read(root, ASSUMPTIONS), r"A-\d+"))
        self.limits = list(table_rows(sources.read(root, ASSUMPTIONS), r"L-\d+"))
        self.failures = list(table_rows(sources.read(root, FAILURES), r"F-\d+"))
        threats = sources.read(root, THREATS)
        self.assets, self.attackers, self.threats = (
            list(table_rows(threats, pattern)) for pattern in (r"AS-\d+", r"AT-\d+", r"T-\d+"))
        self.tests = {f"{suite}.{name}": path for path in sources.paths(os.path.join(root, "tests"), (".cpp",))
                      for suite, name in TEST.findall(sources.read(root, os.path.join("tests", path)))}

    def line_of(self, requirement):
        """Line of the requirement's id in requirements.toml."""
        return sources.line_of(self.data_text, max(self.data_text.find(f'"{requirement.get("id", "")}"'), 0))

    def with_fault(self, fault):
        return [r for r in self.requirements if fault in r.get("faults", ())]

    def code_of_fault(self, fault):
        """Code of the fault's requirements, without the table rows of other faults."""
        others = set(self.faults) - {fault}
        return [item for r in self.with_fault(fault) for item in r.get("code", ())
                if item.partition(":")[2] not in others]


def missing_code(root, item):
    """What is wrong with "path:symbol", or None. Each part of a qualified symbol must stand in the code of the file."""
    path, _, symbol = item.partition(":")
    if not symbol or not os.path.isfile(os.path.join(root, path)):
        return f"{item}: the file does not exist, or no symbol is named"
    code = sources.code(sources.read(root, path), path)
    absent = [part for part in symbol.split("::") if not re.search(rf"\b{re.escape(part)}\b", code)]
    return f"{item}: {absent[0]} is not in the code of {path}" if absent else None


def missing_test(safety, item):
    if item in safety.tests or ("/" in item and os.path.isfile(os.path.join(safety.root, item))):
        return None
    return f"{item}: neither a test in tests/ nor a file"


def faults_of_requirement(safety, requirement):
    """Yields what is wrong with one requirement, without its place."""
    if unknown := [key for key in requirement if key not in KEYS]:
        yield f"unknown key {unknown[0]}"
    if not re.fullmatch(r"SR-\d+", requirement.get("id", "")) or not requirement.get("text"):
        yield "has no id SR-number, or no text"
    known = {"hazards": {cells[0] for _, cells in safety.hazards}, "faults": set(safety.faults),
             "assumptions": {cells[0] for _, cells in safety.assumptions},
             "limits": {cells[0] for _, cells in safety.limits}}
    for key, names in known.items():
        for name in requirement.get(key, ()):
            if name not in names:
                yield f"names {name}, which does not exist among the {key}"
    if not requirement.get("hazards"):
        yield "has no hazard"
    allocated = requirement.get("assumptions") and not any(requirement.get(k) for k in ("faults", "code", "tests"))
    for key in ("code", "tests"):
        if not requirement.get(key) and not allocated:
            yield f"has no {key}"
    for item in requirement.get("code", ()):
        if wrong := missing_code(safety.root, item):
            yield wrong
    for item in requirement.get("tests", ()):
        if wrong := missing_test(safety, item):
            yield wrong


def faults_of_tables(safety):
    """Yields the faults of hazards, assumptions and failures."""
    used = {name for r in safety.requirements for key in ("hazards", "assumptions", "limits")
            for name in r.get(key, ())}
    for page, rows in ((HAZARDS, safety.hazards), (ASSUMPTIONS, safety.assumptions + safety.limits),
                       (FAILURES, safety.failures)):
        seen = set()
        for line, cells in rows:
            if cells[0] in seen:
                yield f"{page}:{line}: {cells[0]} is there twice"
            seen.add(cells[0])
            if page != FAILURES and cells[0] not in used:
                yield f"{page}:{line}: no requirement names {cells[0]}"
    for line, cells in safety.hazards:
        graph = tuple(cells[2:5])
        if len(cells) < 6 or RISK_GRAPH.get(graph) != cells[5]:
            yield (f"{HAZARDS}:{line}: {cells[0]}: {' '.join(cells[2:6])}: expected S, F, P and PLr "
                   f"{RISK_GRAPH.get(graph, 'of the risk graph')}")
    for line, cells in safety.failures:
        for name in re.findall(r"(?<!\*)\*([^*]+)\*(?!\*)", "|".join(cells)):
            if name.replace(" ", "_") not in safety.faults:
                yield f"{FAILURES}:{line}: {cells[0]} names the protection row {name}, which does not exist"
        for name in re.findall(r"`(\w+\.[A-Z]\w+)`", "|".join(cells)):
            if wrong := missing_test(safety, name):
                yield f"{FAILURES}:{line}: {cells[0]} names {wrong}"


def faults_of_threats(safety):
    """Yields the faults of threats.md."""
    ids = [cells[0] for _, cells in safety.assets + safety.attackers + safety.threats]
    attackers = {cells[0] for _, cells in safety.attackers} | {"none"}
    for line, cells in safety.threats:
        place = f"{THREATS}:{line}: {cells[0]}"
        if len(cells) != 10 or ids.count(cells[0]) > 1:
            yield f"{place}: expected ten columns, and once"
            continue
        code, tests = (re.findall(r"`([^`]+)`", cell) for cell in cells[7:9])
        for key, found in (("treatment", cells[6]), ("code", code), ("tests", tests)):
            if not found:
                yield f"{place} has no {key}"
        for name in [cells[1], *cells[3].split(", ")]:
            if name not in ids and name not in attackers:
                yield f"{place} names {name}, which does not exist"
        for wrong in [missing_code(safety.root, item) for item in code] + [missing_test(safety, t) for t in tests]:
            if wrong:
                yield f"{place} names {wrong}"
    named = {cells[1] for _, cells in safety.threats if len(cells) > 1}
    for line, cells in safety.assets:
        if cells[0] not in named:
            yield f"{THREATS}:{line}: no threat names {cells[0]}"


def all_faults(safety):
    ids = [r.get("id") for r in safety.requirements]
    for r in safety.requirements:
        place = f"{DATA}:{safety.line_of(r)}: {r.get('id', 'a requirement')}"
        if ids.count(r.get("id")) > 1:
            yield f"{place} is there twice"
        yield from (f"{place}: {wrong}" for wrong in faults_of_requirement(safety, r))
    yield from (f"{DATA}:1: every_row: {wrong}" for item in safety.every_row if (wrong := missing_test(safety, item)))
    if not safety.faults:
        yield f"{FAULTS}:1: enum class Fault is missing"
    for fault in safety.faults:
        if not safety.with_fault(fault):
            yield f"{DATA}:1: no requirement names the fault {fault}"
        elif not safety.code_of_fault(fault):
            yield f"{DATA}:1: the requirements of the fault {fault} name only code of other faults"
        if fault not in safety.rows:
            yield f"{TABLE}:1: the generated table has no row for {fault}"
    yield from faults_of_tables(safety)
    yield from faults_of_threats(safety)


def joined(items):
    return ", ".join(dict.fromkeys(items)) or "-"


def code_links(items):
    split = [item.partition(":") for item in items]
    return joined(f"[{os.path.basename(path)}](../../{path}) `{symbol}`" for path, _, symbol in split)


def test_links(safety, requirements):
    items = [item for r in requirements for item in r.get("tests", ())]
    return joined(f"[{item}](../../{'tests/' + safety.tests[item] if item in safety.tests else item})"
                  for item in items)


def as_table(head, rows):
    lines = [head, ["---"] * len(head), *rows]
    return "".join("| " + " | ".join(line) + " |\n" for line in lines)


def tables(safety):
    """The generated tables of traceability.md by name."""
    rows = []
    for fault in safety.faults:
        bit, name, raised, delay, *_, reaction, _ = safety.rows.get(fault, ["", fault] + ["-"] * 7)
        named = safety.with_fault(fault)
        rows.append([bit, name, raised, delay, reaction, joined(h for r in named for h in r.get("hazards", ())),
                     joined(r["id"] for r in named), code_links(safety.code_of_fault(fault)),
                     test_links(safety, named)])
    hazards = []
    for _, cells in safety.hazards:
        named = [r for r in safety.requirements if cells[0] in r.get("hazards", ())]
        hazards.append([cells[0], cells[1], cells[5] if len(cells) > 5 else "-", joined(r["id"] for r in named),
                        joined(f.replace("_", " ") for r in named for f in r.get("faults", ())),
                        joined(a for r in named for a in r.get("assumptions", ()))])
    requirements = [[r["id"], r["text"], joined(r.get("hazards", ())),
                     joined(f.replace("_", " ") for f in r.get("faults", ())), joined(r.get("assumptions", ())),
                     joined(r.get("limits", ())),
                     code_links(r["code"]) if r.get("code") else "the vehicle", test_links(safety, [r])]
                    for r in safety.requirements]
    return {
        "rows": as_table(["bit", "protection row", "raised when", "for", "reaction", "hazards", "requirements", "code",
                          "tests"], rows),
        "hazards": as_table(["hazard", "title", "PLr", "requirements", "protection rows", "assumptions"], hazards),
        "requirements": as_table(["id", "requirement", "hazards", "protection rows", "assumptions",
                                  "not met today", "code", "tests"], requirements),
    }


def stale(safety, write):
    """Yields the tables of traceability.md that differ from the data; writes them instead if `write`."""
    text = fresh_text = sources.read(safety.root, TRACE)
    for name, table in tables(safety).items():
        found = re.search(MARKS.format(name), text, re.S)
        if not found:
            yield f"{TRACE}:1: the marks of the table {name} are missing"
        elif found[0] != (fresh := found[1] + table + found[2]):
            if not write:
                yield f"{TRACE}:{sources.line_of(text, found.start())}: the table {name} is out of date: --write"
            fresh_text = fresh_text.replace(found[0], fresh)
    if write:
        with open(os.path.join(safety.root, TRACE), "w", encoding="utf-8") as file:
            file.write(fresh_text)


def main():
    options = sources.options("Refuses gaps in docs/safety/ and writes its tables.")
    options.add_argument("--write", action="store_true", help="write the tables of traceability.md")
    given = options.parse_args()
    try:
        safety = SafetyFile(given.root)
        found = list(all_faults(safety))
        if all("id" in r and "text" in r for r in safety.requirements):
            found += stale(safety, given.write)
    except (OSError, KeyError, ValueError) as error:
        print(f"safety: {type(error).__name__}: {error}", file=sys.stderr)
        return 2
    print("\n".join(found + [f"safety: {len(safety.faults)} protection rows, {len(safety.requirements)} requirements, "
                             f"{len(safety.hazards)} hazards, {len(found)} faults"]))
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
