#!/usr/bin/env python3
"""Seeded mutants: small faults put into protection/ and storage/, one at a time; do the tests see them?

    mutants.py BUILD_FOLDER [--count 200] [--seed 1] [--jobs 2] [--report FILE] [--again REPORT]

  mutant     one place changed: a comparison, an operator, a constant (one more or less; from a hundred on twice or half), a condition held true or false,
             a statement left out; which, says the seed
  built      the file in a folder that is looked through first (-I), the tests that include it by the build folder's own commands, but -O1, each test
             source a program of its own. Nothing of the checkout is touched
  caught     a test fails, crashes, reads outside an array (checked), or takes ten times as long as it does without the change
  does not compile: does not count, the next is taken. Static assertions belong to that
  equivalent equivalent.txt beside this file says why no test can tell; counted apart

The report names every mutant, what came of it and, of those that survive, the change. --again: those that survived in a report, after tests were added.
Exit: 0 nine in ten are caught, 1 fewer, 2 bad usage.
"""
import argparse
import atexit
import concurrent.futures
import json
import os
import pathlib
import random
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import time

checkout = pathlib.Path(__file__).resolve().parents[2]
root = pathlib.Path(tempfile.mkdtemp(prefix="mutants_")) / "source"  # a copy: who edits meanwhile changes nothing
atexit.register(shutil.rmtree, root.parent, ignore_errors=True)
shutil.copytree(checkout, root, ignore=shutil.ignore_patterns("build*", ".git", "recordings", "corpus"), symlinks=True)
(root / "recordings").symlink_to(checkout / "recordings")
sources = sorted(p.relative_to(root).as_posix() for folder in ("protection", "storage") for p in (root / folder).iterdir() if p.suffix in (".hpp", ".cpp"))

# Programs in the order in which they are tried: test source, target of the build it belongs to, what else is compiled. A test whose name begins
# like the mutant's file comes first.
store = ["storage/log.cpp", "storage/persistence.cpp"]
programs = [
    ("tests/protection/contactors_test.cpp", "protection_test", []),
    ("tests/protection/derating_test.cpp", "protection_test", []),
    ("tests/protection/table_test.cpp", "protection_test", []),
    ("tests/protection/contactor_limits_test.cpp", "protection_test", []),
    ("tests/protection/contactor_walk_test.cpp", "protection_test", []),
    ("tests/protection/fault_matrix_test.cpp", "protection_test", []),
    ("tests/protection/first_cause_test.cpp", "protection_test", []),
    ("tests/protection/pack_quantities_test.cpp", "protection_test", []),
    ("tests/protection/sampled_protection_test.cpp", "protection_test", []),
    ("tests/protection/protection_test.cpp", "protection_test", []),
    ("tests/protection/missing_samples_test.cpp", "protection_test", []),
    ("tests/protection/flipped_bits_test.cpp", "protection_test", []),
    ("tests/protection/balancing_test.cpp", "protection_test", []),
    ("tests/storage/records_test.cpp", "storage_test", []),
    ("tests/storage/persistence_test.cpp", "storage_test", ["tests/storage/flash_model.cpp", "tests/storage/fed_watchdog.cpp", *store]),
    ("tests/storage/persistence_schedule_test.cpp", "storage_test", ["tests/storage/flash_model.cpp", "tests/storage/fed_watchdog.cpp", *store]),
    ("tests/storage/log_test.cpp", "storage_test", ["tests/storage/flash_model.cpp", store[0]]),
    ("tests/storage/power_cut_test.cpp", "storage_test", ["tests/storage/flash_model.cpp", store[0]]),
    ("tests/storage/worn_flash_test.cpp", "storage_test", ["tests/storage/flash_model.cpp", store[0]]),
    ("tests/firmware/telemetry_test.cpp", "telemetry_test", ["tests/firmware/host_hal.cpp", "hal/absent/flash.cpp", *store]),
]
# the test that is tried first for files without one of their name
first = {
    "table_text": "table_test", "faults": "table_test", "pack_design": "table_test", "fault_monitor": "fault_matrix_test",
    "guarded": "contactor_walk_test", "crc32": "records_test", "log_line": "log_test",
}
checks = ["-O1", "-g0", "-w", "-D_GLIBCXX_ASSERTIONS", "-DBMS_POWER_CUT_SEQUENCES=60"]
compiler = "clang++"  # half the time of g++
compile_limit_s = 300


# ---- places to change

def blanked(text):
    """The text with comments, strings, preprocessor lines and static assertions as spaces: same offsets."""
    space = lambda m: re.sub(r"[^\n]", " ", m.group(0))
    text = re.sub(r'//[^\n]*|/\*.*?\*/|"(?:\\.|[^"\\\n])*"', space, text, flags=re.S)
    text = re.sub(r"(?m)^[ \t]*#(?:[^\n]*\\\n)*[^\n]*", space, text)
    return re.sub(r"static_assert\s*\([^;]*\);|\[\[[^\]]*\]\]", space, text)


swaps = {
    "<": ["<=", ">="], ">": [">=", "<="], "<=": ["<", ">"], ">=": [">", "<"], "==": ["!="], "!=": ["=="],
    "+": ["-"], "-": ["+"], "*": ["/"], "/": ["*"], "%": ["*"], "<<": [">>"], ">>": ["<<"], "&": ["|"], "|": ["&"], "^": ["|"],
    "&&": ["||"], "||": ["&&"], "+=": ["-="], "-=": ["+="], "|=": ["&="], "&=": ["|="], "*=": ["/="], "/=": ["*="], "%=": ["="], "<<=": [">>="], ">>=": ["<<="],
}
operator = re.compile(r"(?<= )(" + "|".join(re.escape(s) for s in sorted(swaps, key=len, reverse=True)) + r")(?= )")
number = re.compile(r"(?<![\w.'])(0[xX][0-9A-Fa-f']+|\d[\d']*\.\d+(?:[eE][+-]?\d+)?|\d[\d']*)([uUlLfF]*)(?![\w.'])")


def numbers(literal, suffix):
    plain = literal.replace("'", "")
    if plain[:2] in ("0x", "0X"):
        value = int(plain, 16)
        return [hex(value + 1) + suffix, hex(value ^ (1 << (value.bit_length() // 2))) + suffix]
    if "." in plain or "e" in plain:
        value = float(plain)
        return [repr(value * 2) + suffix, repr(value / 2) + suffix] if value else ["1.0" + suffix]
    value = int(plain)
    if value >= 100:  # nothing is stated to better than that
        return [f"{2 * value}{suffix}", f"{value // 2}{suffix}"]
    return [f"{value + 1}{suffix}"] + ([f"{value - 1}{suffix}"] if value > 0 else []) + ([f"0{suffix}"] if value > 1 else [])


def balanced(text, at):
    """Behind the parenthesis that closes the one at `at`."""
    depth = 0
    for k in range(at, len(text)):
        depth += {"(": 1, ")": -1}.get(text[k], 0)
        if depth == 0:
            return k + 1
    return len(text)


def statements(text):
    """Begin and end (behind the semicolon) of statements, without what controls them."""
    begin, depth = 0, 0
    for k, c in enumerate(text):
        depth += {"(": 1, ")": -1, "[": 1, "]": -1}.get(c, 0)
        if depth == 0 and c in "{}":
            begin = k + 1
        if depth == 0 and c == ";":
            at = begin
            while True:
                m = re.compile(r"\s*(?:else\b|do\b|(?:if|for|while|switch)\s*(?:constexpr\s*)?(?=\()|case\s[^;{}?]*?[^:]:(?!:)|default:|public:|private:)").match(text, at)
                if not m:
                    break
                at = m.end()
                if at < k and text[at] == "(":
                    at = balanced(text, at)
            at += len(text[at:k]) - len(text[at:k].lstrip())
            if at < k:
                yield at, k + 1
            begin = k + 1


def places(file):
    """(begin, end, [texts instead])"""
    text = blanked((root / file).read_text())
    for m in operator.finditer(text):
        line = text[text.rfind("\n", 0, m.start()) + 1:m.start()]
        if m.group(1) in ("<", ">") and re.search(r"template\s*$", line):
            continue
        if re.search(r"operator$", line):
            continue
        yield m.start(), m.end(), swaps[m.group(1)]
    for m in number.finditer(text):
        yield m.start(), m.end(), numbers(m.group(1), m.group(2))
    for m in re.finditer(r"\b(true|false)\b", text):
        yield m.start(), m.end(), ["false" if m.group(1) == "true" else "true"]
    for m in re.finditer(r"!(?=[\w(])", text):
        yield m.start(), m.end(), [""]
    for m in re.finditer(r"\+\+|--", text):
        yield m.start(), m.end(), ["--" if m.group(0) == "++" else "++"]
    for m in re.finditer(r"\b(?:if|while)\s*\(", text):
        end = balanced(text, m.end() - 1)
        if ";" not in text[m.end():end]:
            yield m.end(), end - 1, ["true", "false"] if text[m.start()] == "i" else ["false"]
    for begin, end in statements(text):
        what = text[begin:end]
        if re.match(r"(using|namespace|friend|typedef|enum|struct|class|template|break|explicit|static|public|private)\b", what):
            continue
        if what.startswith("return") and re.match(r"\s*(\}|case\b|default\b)", text[end:]):
            continue  # off the end of a function
        yield begin, end, [";"]


def mutant_of(file, begin, end, new):
    text = (root / file).read_text()
    line = text.count("\n", 0, begin) + 1
    whole = text[text.rfind("\n", 0, begin) + 1:text.find("\n", end)]
    changed = text[text.rfind("\n", 0, begin) + 1:begin] + new + text[end:text.find("\n", end)]
    return {"file": file, "begin": begin, "end": end, "old": text[begin:end], "new": new, "line": line, "from": whole.strip(), "to": changed.strip()}


def chosen(seed):
    chance = random.Random(seed)
    all_places = [(f, *p) for f in sources for p in places(f)]
    chance.shuffle(all_places)
    for file, begin, end, instead in all_places:
        yield mutant_of(file, begin, end, chance.choice(instead))


def equivalents():
    """{(file, from, to): reason}: three lines each (file, from, to) and a fourth that begins with 'because'; empty lines between."""
    path = checkout / "tests/mutants/equivalent.txt"
    found = {}
    for block in re.split(r"\n\s*\n", path.read_text() if path.exists() else ""):
        lines = [line.strip() for line in block.strip().splitlines() if not line.startswith("#")]
        if len(lines) == 4:
            found[tuple(lines[:3])] = lines[3]
        elif lines:
            sys.exit(f"mutants: {path}: four lines expected: {lines[0]}")
    return found


# ---- building and running

class Build:
    def __init__(self, folder, scratch):
        self.folder, self.scratch = folder, scratch
        self.compile, self.link = {}, {}
        for target in sorted({t for _, t, _ in programs}):
            subprocess.run(["cmake", "--build", folder, "--target", target], check=True, stdout=subprocess.DEVNULL)
            commands = subprocess.run(["ninja", "-C", folder, "-t", "commands", target], check=True, stdout=subprocess.PIPE, text=True).stdout.splitlines()
            self.link[target] = commands[-1].removeprefix(": && ").split(" && ")[0]
            for command in commands:
                # the folder of the build is inside the checkout, and stays
                words = shlex.split(command.replace(folder, "\0").replace(str(checkout), str(root)).replace("\0", folder))
                if "-c" in words and "-o" in words:
                    file = pathlib.Path(words[words.index("-c") + 1])
                    if file.is_relative_to(root):
                        self.compile[target, file.relative_to(root).as_posix()] = words
        for file in store:
            self.compile.update({(t, file): w for (_, f), w in list(self.compile.items()) if f == file for t in self.link})
        self.header = self.precompiled()
        self.inputs = {}
        self.objects = {}
        for test, target, beside in programs:
            for file in [test, *beside]:
                if file not in self.objects:
                    self.objects[file] = scratch / "unchanged" / (file.replace("/", "_") + ".o")
                    self.objects[file].parent.mkdir(exist_ok=True)
                    self.build_object(target, file, self.objects[file], None, dependencies=True)
        self.usual_s = {}
        for test, target, beside in programs:
            out = self.build_program(test, target, beside, self.objects, scratch / "unchanged")
            begin = time.monotonic()
            if self.run(out, 600) != "survived":
                sys.exit(f"mutants: {test} fails without any change")
            self.usual_s[test] = time.monotonic() - begin

    def flags(self, target, file):
        words = self.compile[target, file]
        kept, skip = [], False
        for w in words:
            if skip:
                skip = False
            elif w in ("-MF", "-MT", "-o", "-c"):
                skip = True
            elif w.endswith(("ccache", "c++", "g++")) or w in ("-MD", "-g", "-DNDEBUG", "-Werror") or re.match(r"-O|-W", w):
                continue
            else:
                kept.append(w)
        return kept

    def precompiled(self):
        """gtest and the library's headers once: most of a test's compile time."""
        test, target, _ = programs[0]
        header = self.scratch / "tests.hpp"
        header.write_text("#include <gtest/gtest.h>\n" + "".join(f"#include <{h}>\n" for h in "algorithm array cmath cstdio cstring deque functional map optional random regex set span string tuple vector".split()))
        words = [w for w in self.flags(target, test) if not w.startswith(("-I", "-DBMS", "-DFMT", "-DGTEST"))]
        words = [w for k, w in enumerate(words) if w != "-isystem" and (k == 0 or words[k - 1] != "-isystem")]
        subprocess.run([compiler, *words, *checks, "-DGTEST_HAS_PTHREAD=1", "-x", "c++-header", str(header), "-o", f"{header}.pch", "-fpch-instantiate-templates"], check=True)
        return header

    def build_object(self, target, file, out, overlay, dependencies=False):
        words = self.flags(target, file)
        source = root / file
        if overlay and (overlay / file).exists():
            source = overlay / file
        before = [f"-I{overlay}"] if overlay else []
        command = [compiler, *before, *words, *checks]
        if file.endswith("_test.cpp"):
            command += ["-include-pch", f"{self.header}.pch"]
        command += ["-c", str(source), "-o", str(out)]
        if dependencies:
            command += ["-MMD", "-MF", f"{out}.d"]
        try:
            done = subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, timeout=compile_limit_s, cwd=self.folder)
        except subprocess.TimeoutExpired:
            return False
        if dependencies:
            if done.returncode:
                sys.exit(f"mutants: {file} does not compile without any change:\n{done.stderr[:2000]}")
            self.inputs[file] = {pathlib.Path(w).resolve().relative_to(root).as_posix() for w in pathlib.Path(f"{out}.d").read_text().replace("\\\n", " ").split() if w.startswith(str(root) + "/")}
        return done.returncode == 0

    def build_program(self, test, target, beside, objects, into):
        out = into / pathlib.Path(test).stem
        words = shlex.split(self.link[target])
        first = next(k for k, w in enumerate(words) if w.endswith(".o"))
        kept = [w for w in words if not w.endswith(".o")]
        kept[kept.index("-o") + 1] = str(out)
        mine = [str(objects[f]) for f in [test, *beside]]
        subprocess.run([*kept[:first], "-fuse-ld=lld", "-Wl,--as-needed", *mine, *kept[first:]], check=True, cwd=self.folder)
        return out

    def run(self, program, limit_s):
        try:
            done = subprocess.run([program, "--gtest_fail_fast", "--gtest_brief=1"], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=limit_s, cwd=program.parent)
        except subprocess.TimeoutExpired:
            return "time"
        if done.returncode == 0:
            return "survived"
        return (re.findall(rb"\[  FAILED  \] (\S+)", done.stdout) or [b"crash"])[0].decode().rstrip(",")

    def judge(self, mutant, number):
        """'caught by ...', 'survived' or 'does not compile'"""
        file = mutant["file"]
        with tempfile.TemporaryDirectory(dir=self.scratch, prefix=f"m{number}_") as name:
            overlay = pathlib.Path(name)
            text = (root / file).read_text()
            (overlay / file).parent.mkdir()
            (overlay / file).write_text(text[:mutant["begin"]] + mutant["new"] + text[mutant["end"]:])
            stem = pathlib.Path(file).stem
            order = sorted(programs, key=lambda p: (pathlib.Path(p[0]).stem != first.get(stem, f"{stem}_test"), programs.index(p)))
            changed = {}
            seen = False
            for test, target, beside in order:
                parts = [test, *beside]
                if not any(file in self.inputs[p] for p in parts):
                    continue
                for p in parts:
                    if file in self.inputs[p] and p not in changed:
                        changed[p] = overlay / (p.replace("/", "_") + ".o")
                        if not self.build_object(target, p, changed[p], overlay):
                            return "does not compile"
                seen = True
                try:
                    program = self.build_program(test, target, beside, {**self.objects, **changed}, overlay)
                except subprocess.CalledProcessError:
                    return "does not compile"
                result = self.run(program, 10 * self.usual_s[test] + 10)
                if result != "survived":
                    return f"caught by {pathlib.Path(test).stem}: {result}"
            return "survived" if seen else "does not compile"


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("build")
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--report", default="mutants.json")
    parser.add_argument("--again")
    arguments = parser.parse_args()
    known = equivalents()
    code = lambda line: re.sub(r"\s*//.*", "", line)  # a new comment does not make another mutant
    identity = lambda m: (m["file"], code(m["from"]), code(m["to"]))
    if arguments.again:
        todo = [m for m in json.load(open(arguments.again))["mutants"] if m["result"] == "survived"]
        todo = iter([mutant_of(m["file"], m["begin"], m["end"], m["new"]) for m in todo])
    else:
        todo = chosen(arguments.seed)

    counted, refused = [], 0
    with concurrent.futures.ThreadPoolExecutor(arguments.jobs) as pool:
        build = Build(str(pathlib.Path(arguments.build).resolve()), root.parent)
        print("without any change: " + ", ".join(f"{pathlib.Path(t).stem} {s:.1f} s" for t, s in build.usual_s.items()), flush=True)
        running, number = {}, 0
        while True:
            while len(running) < arguments.jobs and len(counted) + len(running) < arguments.count:
                mutant = next(todo, None)
                if mutant is None:
                    break
                number += 1
                if identity(mutant) in known:
                    counted.append({**mutant, "result": "equivalent", "why": known[identity(mutant)]})
                    continue
                running[pool.submit(build.judge, mutant, number)] = mutant
            if not running:
                break
            done, _ = concurrent.futures.wait(running, return_when=concurrent.futures.FIRST_COMPLETED)
            for future in done:
                mutant = running.pop(future)
                mutant["result"] = future.result()
                if mutant["result"] == "does not compile":
                    refused += 1
                    continue
                counted.append(mutant)
                print(f"{len(counted):4d}  {mutant['file']}:{mutant['line']}  {mutant['old']!r} -> {mutant['new']!r}  {mutant['result']}", flush=True)
                if mutant["result"] == "survived":
                    print(f"        - {mutant['from']}\n        + {mutant['to']}", flush=True)
                json.dump({"seed": arguments.seed, "mutants": counted}, open(arguments.report, "w"), indent=1)

    json.dump({"seed": arguments.seed, "mutants": counted}, open(arguments.report, "w"), indent=1)
    survived = [m for m in counted if m["result"] == "survived"]
    equivalent = [m for m in counted if m["result"] == "equivalent"]
    caught = len(counted) - len(survived) - len(equivalent)
    print(f"{caught} of {len(counted)} mutants caught ({100 * caught / max(len(counted), 1):.1f} %), {len(equivalent)} equivalent, {len(survived)} survived; {refused} more did not compile; seed {arguments.seed}")
    for folder in ("protection", "storage"):
        of = [m for m in counted if m["file"].startswith(folder)]
        print(f"  {folder}: {sum(m['result'].startswith('caught') for m in of)} of {len(of)} caught, {sum(m['result'] == 'equivalent' for m in of)} equivalent")
    return 0 if 10 * caught >= 9 * len(counted) else 1


if __name__ == "__main__":
    sys.exit(main())
