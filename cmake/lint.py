"""Runs clang-tidy (.clang-tidy) and cppcheck (cmake/cppcheck.suppressions). Every finding is an error: exit code 1.

    lint.py HOST_BUILD [all]     HOST_BUILD: a configured build of the host with a built cell_header

Code of the controller is checked as the cross compiler sees it: all sources of the first board, and of each further
board (folder in boards/) those that no board before it had. Of the host, only host_sim/monitor/ and host_sim/hil/ are
checked, without the analyzer, because sanitizers run there. With `all`, everything is checked, tests included.
"""
import json
import os
import re
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
FIRST = "stm32f405_forklift"  # the board with most of the sources
TOOLCHAIN = os.path.join(ROOT, "cmake", "toolchain-arm-none-eabi.cmake")


def run(command):
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    if done.returncode != 0:
        raise SystemExit(" ".join(command) + "\n" + done.stdout)
    return done.stdout


def sources(build):
    """Compile command of each source of a build."""
    with open(os.path.join(build, "compile_commands.json")) as f:
        commands = json.load(f)
    of = {}
    for c in commands:
        of.setdefault(os.path.realpath(c["file"]), c["command"])
    return of


def configured(board, host_build):
    """Folder with a board's images, compiled without a warning, and their compile commands."""
    build = os.path.join(ROOT, "build", "lint", board)
    run(["cmake", "-S", ROOT, "-B", build, "-G", "Ninja", "-DBMS_BOARD=" + board, "--toolchain", TOOLCHAIN,
         "-DCMAKE_COMPILE_WARNING_AS_ERROR=ON",
         "-DBMS_CELL_HEADER_TOOL=" + os.path.join(host_build, "files", "cell_header")])
    run(["ninja", "-C", build])
    return build


def cross_options(command):
    """Options with which clang finds the headers of the cross compiler."""
    cpu = re.findall(r" (-m(?:cpu|thumb|float-abi|fpu)\S*)", command)
    text = run(["arm-none-eabi-g++", *cpu, "-E", "-v", "-x", "c++", "/dev/null"])
    found = re.search(r"search starts here:\n(.*)End of search", text, re.S).group(1)
    folders = [os.path.normpath(f.strip()) for f in found.split("search starts here:\n")[-1].split("\n") if f.strip()]
    return ["--extra-arg-before=--target=arm-none-eabi"] + [
        "--extra-arg=-isystem" + f for f in folders if "/lib/gcc/" not in f]


def tidy(work):
    file, build, options = work
    known = ["--extra-arg=-Wno-unknown-warning-option", "--extra-arg=-Wno-unused-command-line-argument"]
    done = subprocess.run(["clang-tidy", "--quiet", "-p", build, *known, *options, file], stdout=subprocess.PIPE,
                          stderr=subprocess.PIPE, text=True)
    if done.returncode == 0:
        return ""
    return done.stdout or done.stderr


def cppcheck(build):
    done = subprocess.run(
        ["cppcheck", "--project=" + os.path.join(build, "compile_commands.json"),
         "--enable=warning,performance,portability", "--std=c++20", "--inline-suppr", "--quiet",
         "--suppressions-list=" + os.path.join(ROOT, "cmake", "cppcheck.suppressions"), "--error-exitcode=1", "-j2"],
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    return done.stdout if done.returncode != 0 else ""


def boards():
    """Names of all boards, FIRST at the front."""
    folder = os.path.join(ROOT, "boards")
    names = [b for b in os.listdir(folder) if os.path.exists(os.path.join(folder, b, "board.cmake"))]
    return sorted(names, key=lambda b: (b != FIRST, b))


def of_the_boards(host_build):
    """Work for tidy(): each source of the boards once."""
    work, seen = [], set()
    for board in boards():
        build = configured(board, host_build)
        of = {f: c for f, c in sources(build).items()
              if f.startswith(ROOT + os.sep) and f not in seen and os.sep + "tests" + os.sep not in f}
        seen |= of.keys()
        options = cross_options(next(iter(of.values()))) if of else []
        work += [(f, build, options) for f in of]
    return work


def of_the_host(build, everything, seen):
    """Work for tidy(): the sources of the host that were not seen."""
    folders = [ROOT + os.sep] if everything else [os.path.join(ROOT, "host_sim", f) + os.sep
                                                    for f in ("monitor", "hil")]
    generated = os.path.join(ROOT, "build")
    return [(f, build, ["--checks=-clang-analyzer-*"]) for f in sources(build)
            if f.startswith(tuple(folders)) and f not in seen and not f.startswith(generated)]


def main():
    host = os.path.abspath(sys.argv[1])
    work = of_the_boards(host)
    work += of_the_host(host, sys.argv[2:] == ["all"], {file for file, _, _ in work})
    with ThreadPoolExecutor(2) as pool:
        found = [text for text in pool.map(tidy, work) if text]
    found += [text for text in [cppcheck(os.path.join(ROOT, "build", "lint", FIRST))] if text]
    if found:
        raise SystemExit("\n".join(found))
    print(f"{len(work)} sources, nothing found")


main()
