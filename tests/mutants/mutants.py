#!/usr/bin/env python3
"""Mutation test: puts small faults into firmware/protection/ and firmware/storage/, or into firmware/boot/ and
firmware/cell_update/, one at a time, and checks that the tests fail.

    mutants.py BUILD_FOLDER [--part protection|boot] [--count 200] [--seed 1] [--jobs 2] [--report FILE]
      [--again REPORT]

  mutant            one change at a place that the seed chooses: a comparison, an operator, a constant (plus or minus
                    one; from 100 on twice or half), a condition that is always true or false, a removed statement
  build             the changed file is in a folder that the compiler searches first (-I). The tests that include it are
                    built with the commands of the build folder, but with -O1 and one program per test source. The
                    checkout is not changed
  caught            a test fails, crashes, reads outside an array (checked), or takes ten times its usual time
  does not compile  also because of a static assertion; not counted, the next mutant is taken
  equivalent        equivalent.txt in this folder states why no test can detect it; counted separately

The report contains every mutant with its result and its change. --again tests the survivors of a report again.
Exit code: 0 at least 90 % are caught, 1 fewer, 2 bad usage.
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
# a copy, so that edits during the run have no effect
root = pathlib.Path(tempfile.mkdtemp(prefix="mutants_")) / "source"
atexit.register(shutil.rmtree, root.parent, ignore_errors=True)
shutil.copytree(checkout, root, ignore=shutil.ignore_patterns("build*", ".git", "recordings", "corpus"), symlinks=True)
(root / "evidence/recordings").symlink_to(checkout / "evidence/recordings")
(root / "build").mkdir()
(root / "build/mbedtls").symlink_to(checkout / "build/mbedtls")  # cmake/mbedtls.cmake


def sources():
    folders = {"boot": ["firmware/boot", "firmware/cell_update"],
               "protection": ["firmware/protection", "firmware/storage"]}[part]
    return sorted(path.relative_to(root).as_posix() for folder in folders for path in (root / folder).iterdir()
                  if path.suffix in (".hpp", ".cpp"))


# Test programs in the order in which they run: test source, its target, further sources.
# The test with the name of the mutant's file runs first.
store = ["firmware/storage/log.cpp", "firmware/storage/persistence.cpp"]
persistence = ["tests/firmware/storage/flash_model.cpp", "tests/firmware/storage/fed_watchdog.cpp", *store]
programs = [
    ("tests/firmware/protection/contactors_test.cpp", "protection_test", []),
    ("tests/firmware/protection/derating_test.cpp", "protection_test", []),
    ("tests/firmware/protection/table_test.cpp", "protection_test", []),
    ("tests/firmware/protection/contactor_limits_test.cpp", "protection_test", []),
    ("tests/firmware/protection/contactor_walk_test.cpp", "protection_walk_test", []),
    ("tests/firmware/protection/fault_matrix_test.cpp", "protection_test", []),
    ("tests/firmware/protection/first_cause_test.cpp", "protection_test", []),
    ("tests/firmware/protection/pack_quantities_test.cpp", "protection_test", []),
    ("tests/firmware/protection/sampled_protection_test.cpp", "protection_walk_test", []),
    ("tests/firmware/protection/protection_test.cpp", "protection_test", []),
    ("tests/firmware/protection/missing_samples_test.cpp", "protection_test", []),
    ("tests/firmware/protection/flipped_bits_test.cpp", "protection_test", []),
    ("tests/firmware/protection/balancing_test.cpp", "protection_walk_test", []),
    ("tests/firmware/storage/records_test.cpp", "storage_test", []),
    ("tests/firmware/storage/persistence_test.cpp", "storage_test", persistence),
    ("tests/firmware/storage/persistence_schedule_test.cpp", "storage_test", persistence),
    ("tests/firmware/storage/log_test.cpp", "storage_test", ["tests/firmware/storage/flash_model.cpp", store[0]]),
    ("tests/firmware/storage/power_cut_test.cpp", "storage_walk_test",
     ["tests/firmware/storage/flash_model.cpp", store[0]]),
    ("tests/firmware/storage/worn_flash_test.cpp", "storage_test",
     ["tests/firmware/storage/flash_model.cpp", store[0]]),
    ("tests/firmware/telemetry_test.cpp", "telemetry_test",
     ["tests/firmware/host_hal.cpp", "hal/absent/flash.cpp", *store]),
]
boot = [f"firmware/boot/{name}.cpp" for name in ("iso_tp", "receiver", "slots", "update_server", "verify")]
programs_of_boot = [
    ("tests/firmware/boot/crypto_test.cpp", "boot_test", ["firmware/boot/crypto_mbedtls.cpp"]),
    *((f"tests/firmware/boot/{name}_test.cpp", "boot_test", ["tests/firmware/storage/flash_model.cpp", *boot])
      for name in ("container", "iso_tp", "slots", "receiver", "memory_of_the_chip", "update_services", "update_server",
                   "cell_slots", "cell_server", "update_power_cut")),
    ("tests/firmware/cell_update/contents_test.cpp", "cell_update_test", []),
]
part_option = argparse.ArgumentParser(add_help=False)
part_option.add_argument("--part", choices=("protection", "boot"), default="protection")
part = part_option.parse_known_args()[0].part
if part == "boot":
    programs = programs_of_boot
# the test that runs first for files without a test of their name
first = {
    "table_text": "table_test", "faults": "table_test", "pack_design": "table_test",
    "fault_monitor": "fault_matrix_test", "guarded": "contactor_walk_test", "crc32": "records_test",
    "log_line": "log_test", "verify": "receiver_test", "refusal": "container_test",
    "slot_flash": "slots_test", "crypto_mbedtls": "crypto_test", "handover": "memory_of_the_chip_test",
    "key_table": "memory_of_the_chip_test", "flash_map": "memory_of_the_chip_test",
    "update_server": "update_services_test", "format": "contents_test",
}
checks = ["-O1", "-g0", "-w", "-D_GLIBCXX_ASSERTIONS", "-DBMS_POWER_CUT_SEQUENCES=60", "-DBMS_UPDATE_POWER_CUTS=300"]
compiler = "clang++"  # twice as fast as g++
compile_limit_s = 300


# ---- places to change

def blanked(text):
    """The text with spaces instead of comments, strings, preprocessor lines and static assertions; same offsets."""
    space = lambda m: re.sub(r"[^\n]", " ", m.group(0))
    text = re.sub(r'//[^\n]*|/\*.*?\*/|"(?:\\.|[^"\\\n])*"', space, text, flags=re.S)
    text = re.sub(r"(?m)^[ \t]*#(?:[^\n]*\\\n)*[^\n]*", space, text)
    return re.sub(r"static_assert\s*\([^;]*\);|\[\[[^\]]*\]\]", space, text)


swaps = {
    "<": ["<=", ">="], ">": [">=", "<="], "<=": ["<", ">"], ">=": [">", "<"], "==": ["!="], "!=": ["=="],
    "+": ["-"], "-": ["+"], "*": ["/"], "/": ["*"], "%": ["*"], "<<": [">>"], ">>": ["<<"], "&": ["|"], "|": ["&"],
    "^": ["|"], "&&": ["||"], "||": ["&&"], "+=": ["-="], "-=": ["+="], "|=": ["&="], "&=": ["|="], "*=": ["/="],
    "/=": ["*="], "%=": ["="], "<<=": [">>="], ">>=": ["<<="],
}
operator = re.compile(
    r"(?<=\s)(" + "|".join(re.escape(s) for s in sorted(swaps, key=len, reverse=True)) + r")(?=\s)")
number = re.compile(
    r"(?<![\w.'])(0[xX][0-9A-Fa-f']+|\d[\d']*\.\d+(?:[eE][+-]?\d+)?|\d[\d']*)([uUlLfF]*)(?![\w.'])")
# what stands before a statement and controls it: else, if (...), case ...:
control = re.compile(r"\s*(?:else\b|do\b|(?:if|for|while|switch)\s*(?:constexpr\s*)?(?=\()|"
                     r"case\s[^;{}?]*?[^:]:(?!:)|default:|public:|private:)")


def numbers(literal, suffix):
    plain = literal.replace("'", "")
    if plain[:2] in ("0x", "0X"):
        value = int(plain, 16)
        return [hex(value + 1) + suffix, hex(value ^ (1 << (value.bit_length() // 2))) + suffix]
    if "." in plain or "e" in plain:
        value = float(plain)
        return [repr(value * 2) + suffix, repr(value / 2) + suffix] if value else ["1.0" + suffix]
    value = int(plain)
    if value >= 100:  # no constant is known to one part in 100
        return [f"{2 * value}{suffix}", f"{value // 2}{suffix}"]
    less = [f"{value - 1}{suffix}"] if value > 0 else []
    return [f"{value + 1}{suffix}"] + less + ([f"0{suffix}"] if value > 1 else [])


def balanced(text, at):
    """The offset after the parenthesis that closes the one at `at`."""
    depth = 0
    for k in range(at, len(text)):
        depth += {"(": 1, ")": -1}.get(text[k], 0)
        if depth == 0:
            return k + 1
    return len(text)


def statements(text):
    """Begin and end (after the semicolon) of each statement, without if, for, case and the like before it."""
    begin, depth = 0, 0
    for k, c in enumerate(text):
        depth += {"(": 1, ")": -1, "[": 1, "]": -1}.get(c, 0)
        if depth == 0 and c in "{}":
            begin = k + 1
        if depth == 0 and c == ";":
            at = begin
            while True:
                m = control.match(text, at)
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
    """Yields (begin, end, [replacements])."""
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
        if re.match(r"(using|namespace|friend|typedef|enum|struct|class|template|break|explicit|static|public|private)"
                    r"\b", what):
            continue
        if what.startswith("return") and re.match(r"\s*(\}|case\b|default\b)", text[end:]):
            continue  # the function would end without a return
        yield begin, end, [";"]


def mutant_of(file, begin, end, new):
    text = (root / file).read_text()
    line = text.count("\n", 0, begin) + 1
    whole = text[text.rfind("\n", 0, begin) + 1:text.find("\n", end)]
    changed = text[text.rfind("\n", 0, begin) + 1:begin] + new + text[end:text.find("\n", end)]
    return {"file": file, "begin": begin, "end": end, "old": text[begin:end], "new": new, "line": line,
            "from": whole.strip(), "to": changed.strip()}


def chosen(seed):
    chance = random.Random(seed)
    all_places = [(f, *p) for f in sources() for p in places(f)]
    chance.shuffle(all_places)
    for file, begin, end, instead in all_places:
        yield mutant_of(file, begin, end, chance.choice(instead))


def bare(text):
    """The text in one line, without comments and with single spaces."""
    return " ".join(re.sub(r"//[^\n]*", "", text).split())


def identity(mutant):
    return mutant["file"], bare(mutant["from"]), bare(mutant["to"])


def equivalents():
    """{identity: reason} from equivalent.txt: blocks of four lines (file, from, to, reason)."""
    path = checkout / "tests/mutants/equivalent.txt"
    found = {}
    for block in re.split(r"\n\s*\n", path.read_text() if path.exists() else ""):
        lines = [line.strip() for line in block.strip().splitlines() if not line.startswith("#")]
        if len(lines) == 4:
            file, before, after, reason = lines
            if bare(before) not in bare((root / file).read_text()):
                sys.exit(f"mutants: {path}: {file} has no line: {before}")
            found[file, bare(before), bare(after)] = reason
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
            commands = subprocess.run(["ninja", "-C", folder, "-t", "commands", target], check=True,
                                      stdout=subprocess.PIPE, text=True).stdout.splitlines()
            self.link[target] = commands[-1].removeprefix(": && ").split(" && ")[0]
            for command in commands:
                # the build folder is inside the checkout, but it is not copied
                command = command.replace(folder, "\0").replace(str(checkout), str(root)).replace("\0", folder)
                words = shlex.split(command)
                if "-c" in words and "-o" in words:
                    for file in self.sources_of(pathlib.Path(words[words.index("-c") + 1])):
                        self.compile[target, file] = words
        for file in store:
            self.compile.update({(t, file): w for (_, f), w in list(self.compile.items()) if f == file
                                 for t in self.link})
        self.header = self.precompiled()
        self.inputs = {}
        self.objects = {}
        for test, target, further in programs:
            for file in [test, *further]:
                if file not in self.objects:
                    self.objects[file] = scratch / "unchanged" / (file.replace("/", "_") + ".o")
                    self.objects[file].parent.mkdir(exist_ok=True)
                    self.build_object(target, file, self.objects[file], None, dependencies=True)
        self.usual_s = {}
        for test, target, further in programs:
            out = self.build_program(test, target, further, self.objects, scratch / "unchanged")
            begin = time.monotonic()
            result = self.run(out, 600)
            if result != "survived":
                sys.exit(f"mutants: {test} fails without a change: {result}")
            self.usual_s[test] = time.monotonic() - begin

    def sources_of(self, compiled):
        """The sources of the checkout that one command compiles: with BMS_UNITY several at once."""
        if compiled.parent.name == "Unity":
            named = re.findall(r'#include "([^"]+)"', compiled.read_text())
        else:
            named = [str(compiled)]
        found = [pathlib.Path(name.replace(str(checkout), str(root))) for name in named]
        return [file.relative_to(root).as_posix() for file in found if file.is_relative_to(root)]

    def flags(self, target, file):
        words = self.compile[target, file]
        kept, skip = [], False
        for w in words:
            if skip:
                skip = False
            elif w in ("-MF", "-MT", "-o", "-c", "-include"):
                skip = True
            elif w.endswith(("ccache", "c++", "g++")) or w in ("-MD", "-g", "-DNDEBUG") or re.match(r"-O|-W", w):
                continue
            else:
                kept.append(w)
        return kept

    def precompiled(self):
        """Compiles the headers of gtest and the C++ library once; they take most of a test's compile time."""
        test, target, _ = programs[0]
        header = self.scratch / "tests.hpp"
        names = ("gtest/gtest.h algorithm array cmath cstdio cstring deque functional map optional random regex set "
                 "span string tuple vector").split()
        header.write_text("".join(f"#include <{name}>\n" for name in names))
        words = [w for w in self.flags(target, test) if not w.startswith(("-I", "-DBMS", "-DFMT", "-DGTEST"))]
        words = [w for k, w in enumerate(words) if w != "-isystem" and (k == 0 or words[k - 1] != "-isystem")]
        subprocess.run([compiler, *words, *checks, "-DGTEST_HAS_PTHREAD=1", "-x", "c++-header", str(header),
                        "-o", f"{header}.pch", "-fpch-instantiate-templates"], check=True)
        return header

    def build_object(self, target, file, out, overlay, dependencies=False):
        words = self.flags(target, file)
        source = root / file
        if overlay and (overlay / file).exists():
            source = overlay / file
        before = [f"-I{overlay}", f"-I{overlay}/firmware"] if overlay else []
        command = [compiler, *before, *words, *checks]
        if file.endswith("_test.cpp"):
            command += ["-include-pch", f"{self.header}.pch"]
        command += ["-c", str(source), "-o", str(out)]
        if dependencies:
            command += ["-MMD", "-MF", f"{out}.d"]
        try:
            done = subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
                                  timeout=compile_limit_s, cwd=self.folder)
        except subprocess.TimeoutExpired:
            return False
        if dependencies:
            if done.returncode:
                sys.exit(f"mutants: {file} does not compile without a change:\n{done.stderr[:2000]}")
            read = pathlib.Path(f"{out}.d").read_text().replace("\\\n", " ").split()
            self.inputs[file] = {pathlib.Path(w).resolve().relative_to(root).as_posix() for w in read
                                 if w.startswith(str(root) + "/")}
        return done.returncode == 0

    def build_program(self, test, target, further, objects, into):
        out = into / pathlib.Path(test).stem
        words = shlex.split(self.link[target])
        first = next(k for k, w in enumerate(words) if w.endswith(".o"))
        kept = [w for w in words if not w.endswith(".o")]
        kept[kept.index("-o") + 1] = str(out)
        mine = [str(objects[f]) for f in [test, *further]]
        subprocess.run([*kept[:first], "-fuse-ld=lld", "-Wl,--as-needed", *mine, *kept[first:]], check=True,
                       cwd=self.folder)
        return out

    def run(self, program, limit_s):
        try:
            done = subprocess.run([program, "--gtest_fail_fast", "--gtest_brief=1"], stdout=subprocess.PIPE,
                                  stderr=subprocess.STDOUT, timeout=limit_s, cwd=program.parent)
        except subprocess.TimeoutExpired:
            return "time"
        if done.returncode == 0:
            return "survived"
        return (re.findall(rb"\[  FAILED  \] (\S+)", done.stdout) or [b"crash"])[0].decode().rstrip(",")

    def judge(self, mutant, number):
        """Returns 'caught by ...', 'survived' or 'does not compile'."""
        file = mutant["file"]
        with tempfile.TemporaryDirectory(dir=self.scratch, prefix=f"m{number}_") as name:
            overlay = pathlib.Path(name)
            text = (root / file).read_text()
            (overlay / file).parent.mkdir(parents=True)
            (overlay / file).write_text(text[:mutant["begin"]] + mutant["new"] + text[mutant["end"]:])
            stem = pathlib.Path(file).stem
            own = first.get(stem, f"{stem}_test")
            order = sorted(programs, key=lambda p: (pathlib.Path(p[0]).stem != own, programs.index(p)))
            changed = {}
            seen = False
            for test, target, further in order:
                parts = [test, *further]
                if not any(file in self.inputs[p] for p in parts):
                    continue
                for p in parts:
                    if file in self.inputs[p] and p not in changed:
                        changed[p] = overlay / (p.replace("/", "_") + ".o")
                        if not self.build_object(target, p, changed[p], overlay):
                            return "does not compile"
                seen = True
                try:
                    program = self.build_program(test, target, further, {**self.objects, **changed}, overlay)
                except subprocess.CalledProcessError:
                    return "does not compile"
                result = self.run(program, 10 * self.usual_s[test] + 10)
                if result != "survived":
                    return f"caught by {pathlib.Path(test).stem}: {result}"
            return "survived" if seen else "does not compile"


def main():
    parser = argparse.ArgumentParser(parents=[part_option])
    parser.add_argument("build")
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--report", default="mutants.json")
    parser.add_argument("--again")
    arguments = parser.parse_args()
    known = equivalents()
    if arguments.again:
        todo = [m for m in json.load(open(arguments.again))["mutants"] if m["result"] == "survived"]
        todo = iter([mutant_of(m["file"], m["begin"], m["end"], m["new"]) for m in todo])
    else:
        todo = chosen(arguments.seed)

    counted, rejected = [], 0
    with concurrent.futures.ThreadPoolExecutor(arguments.jobs) as pool:
        build = Build(str(pathlib.Path(arguments.build).resolve()), root.parent)
        usual = ", ".join(f"{pathlib.Path(t).stem} {s:.1f} s" for t, s in build.usual_s.items())
        print(f"unchanged: {usual}", flush=True)
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
                    rejected += 1
                    continue
                counted.append(mutant)
                print(f"{len(counted):4d}  {mutant['file']}:{mutant['line']}  {mutant['old']!r} -> {mutant['new']!r}  "
                      f"{mutant['result']}", flush=True)
                if mutant["result"] == "survived":
                    print(f"        - {mutant['from']}\n        + {mutant['to']}", flush=True)
                json.dump({"seed": arguments.seed, "mutants": counted}, open(arguments.report, "w"), indent=1)

    json.dump({"seed": arguments.seed, "mutants": counted}, open(arguments.report, "w"), indent=1)
    survived = [m for m in counted if m["result"] == "survived"]
    equivalent = [m for m in counted if m["result"] == "equivalent"]
    caught = len(counted) - len(survived) - len(equivalent)
    print(f"{caught} of {len(counted)} mutants caught ({100 * caught / max(len(counted), 1):.1f} %), {len(equivalent)} "
          f"equivalent, {len(survived)} survived; {rejected} more did not compile; seed {arguments.seed}")
    for folder in sorted({str(pathlib.Path(file).parent) for file in sources()}):
        of = [m for m in counted if m["file"].startswith(folder)]
        print(f"  {folder}: {sum(m['result'].startswith('caught') for m in of)} of {len(of)} caught, "
              f"{sum(m['result'] == 'equivalent' for m in of)} equivalent")
    return 0 if 10 * caught >= 9 * len(counted) else 1


if __name__ == "__main__":
    sys.exit(main())
