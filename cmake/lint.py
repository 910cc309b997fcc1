"""clang-tidy and cppcheck, by .clang-tidy and cmake/cppcheck.suppressions: every finding is an error. Exit code 1 when there is one.

    lint.py HOST_BUILD [all]     HOST_BUILD: a configured build of the host, with its header generator built

What goes onto a controller is looked at as the cross compiler sees it, board by board: the first with all of its sources, each further one (a folder in
boards/) with those that none before had. Of the host monitor/ and hil/, without the analyzer, whose place the sanitizers take there; with `all` the whole of it, tests too.
"""
import json
import os
import re
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
FIRST = "stm32f405_forklift"  # the board with most of the sources


def run(command):
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    if done.returncode != 0:
        raise SystemExit(" ".join(command) + "\n" + done.stdout)
    return done.stdout


def sources(build):
    with open(os.path.join(build, "compile_commands.json")) as f:
        commands = json.load(f)
    of = {}
    for c in commands:
        of.setdefault(os.path.realpath(c["file"]), c["command"])
    return of


def configured(board, host_build):
    """Folder with the compile commands of a board's images, and the headers that are generated for them."""
    build = os.path.join(ROOT, "build", "lint", board)
    run(["cmake", "-S", ROOT, "-B", build, "-G", "Ninja", "-DBMS_BOARD=" + board, "--toolchain", os.path.join(ROOT, "cmake", "toolchain-arm-none-eabi.cmake"),
         "-DBMS_CELL_HEADER_TOOL=" + os.path.join(host_build, "files", "cell_header")])
    generated = re.findall(r"^(generated/[^:]*): CUSTOM_COMMAND", run(["ninja", "-C", build, "-t", "targets", "all"]), re.M)
    run(["ninja", "-C", build] + generated)
    return build


def cross_options(command):
    """How clang finds what the cross compiler finds by itself."""
    cpu = re.findall(r" (-m(?:cpu|thumb|float-abi|fpu)\S*)", command)
    text = run(["arm-none-eabi-g++", *cpu, "-E", "-v", "-x", "c++", "/dev/null"])
    found = re.search(r"search starts here:\n(.*)End of search", text, re.S).group(1).split("search starts here:\n")[-1].split("\n")
    folders = [os.path.normpath(f.strip()) for f in found if f.strip() and "/lib/gcc/" not in os.path.normpath(f.strip())]
    return ["--extra-arg-before=--target=arm-none-eabi"] + ["--extra-arg=-isystem" + f for f in folders]


def tidy(work):
    file, build, options = work
    done = subprocess.run(["clang-tidy", "--quiet", "-p", build, "--extra-arg=-Wno-unknown-warning-option", "--extra-arg=-Wno-unused-command-line-argument", *options, file],
                          stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    if done.returncode == 0:
        return ""
    return done.stdout or done.stderr


def cppcheck(build):
    done = subprocess.run(["cppcheck", "--project=" + os.path.join(build, "compile_commands.json"), "--enable=warning,performance,portability", "--std=c++20", "--inline-suppr", "--quiet",
                           "--suppressions-list=" + os.path.join(ROOT, "cmake", "cppcheck.suppressions"), "--error-exitcode=1", "-j2"], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    return done.stdout if done.returncode != 0 else ""


def main():
    host = os.path.abspath(sys.argv[1])
    boards = sorted((b for b in os.listdir(os.path.join(ROOT, "boards")) if os.path.exists(os.path.join(ROOT, "boards", b, "board.cmake"))), key=lambda b: (b != FIRST, b))
    work, seen = [], set()
    for board in boards:
        build = configured(board, host)
        of = {f: c for f, c in sources(build).items() if f.startswith(ROOT + os.sep) and f not in seen and os.sep + "tests" + os.sep not in f}
        seen |= of.keys()
        options = cross_options(next(iter(of.values()))) if of else []
        work += [(f, build, options) for f in of]
    everything = sys.argv[2:] == ["all"]
    folders = [ROOT + os.sep] if everything else [os.path.join(ROOT, f) + os.sep for f in ("monitor", "hil")]
    work += [(f, host, ["--checks=-clang-analyzer-*"]) for f in sources(host) if any(f.startswith(p) for p in folders) and f not in seen and not f.startswith(os.path.join(ROOT, "build"))]
    with ThreadPoolExecutor(2) as pool:
        found = [text for text in pool.map(tidy, work) if text]
    found += [text for text in [cppcheck(os.path.join(ROOT, "build", "lint", FIRST))] if text]
    if found:
        raise SystemExit("\n".join(found))
    print(f"{len(work)} sources, nothing found")


main()
