"""The build of a newcomer is that of everybody else: what else is installed changes no command of it.

    same_configuration.py SOURCE

Configures the presets host (with tests) and host-asan of SOURCE in folders of their own: with a path on which a ccache
lies, without one, and with the ccache asked for by CMAKE_CXX_COMPILER_LAUNCHER. compile_commands.json must be the same,
and no warning an error. Exit code 1: a difference.
"""
import json
import os
import re
import subprocess
import sys
import tempfile

FEWEST = {"host": 200, "host-asan": 50}  # commands; far below the present number, far above a build without tests


def configure(source, build, preset, environment):
    command = ["cmake", "-S", source, "-B", build, "--preset", preset, "-DBMS_TESTS=ON"]
    done = subprocess.run(command, cwd=source, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                          text=True)
    if done.returncode != 0:
        raise SystemExit(" ".join(command) + "\n" + done.stdout)


def commands(build):
    """Compile command of each object file, with the build's own folder named BUILD. A source may have several."""
    with open(os.path.join(build, "compile_commands.json")) as f:
        found = [c["command"].replace(build, "BUILD") for c in json.load(f)]
    return {re.search(r" -o (\S+)", c).group(1): c for c in found}


def without_launcher(build, launcher):
    """The commands of a build, without the launcher, which some versions of CMake write before the compiler."""
    return {o: c.removeprefix(launcher + " ") for o, c in commands(build).items()}


def differences(expected, found, name):
    texts = [f"{name}: {len(expected)} commands without, {len(found)} with"] if expected.keys() != found.keys() else []
    for output in sorted(expected.keys() & found.keys()):
        if expected[output] != found[output]:
            texts.append(f"{name}: {output}\n  without: {expected[output]}\n  with:    {found[output]}")
    return texts


def environment_with(folder, **more):
    """The environment without what asks for a compiler cache, with a folder in front of the path."""
    kept = {k: v for k, v in os.environ.items() if not k.endswith("_COMPILER_LAUNCHER")}
    return {**kept, "PATH": folder + os.pathsep + kept["PATH"], **more}


def check(source, preset, folder):
    """Texts of the differences."""
    caches, none = os.path.join(folder, "caches"), os.path.join(folder, "none")
    builds = {name: os.path.join(folder, preset, name) for name in ("plain", "with_ccache", "asked_for")}
    configure(source, builds["plain"], preset, environment_with(none))
    configure(source, builds["with_ccache"], preset, environment_with(caches))
    ccache = os.path.join(caches, "ccache")
    configure(source, builds["asked_for"], preset, environment_with(
        none, CMAKE_C_COMPILER_LAUNCHER=ccache, CMAKE_CXX_COMPILER_LAUNCHER=ccache))
    plain = commands(builds["plain"])
    texts = [] if len(plain) >= FEWEST[preset] else [f"{preset}: only {len(plain)} commands"]
    texts += [f"{preset}: warnings are errors: {c}" for c in plain.values() if " -Werror" in c]
    texts += differences(plain, commands(builds["with_ccache"]), preset + ", a ccache on the path")
    with open(os.path.join(builds["asked_for"], "CMakeFiles", "rules.ninja")) as f:
        if ccache not in f.read():
            texts.append(preset + ": the launcher that was asked for is not used")
    texts += differences(plain, without_launcher(builds["asked_for"], ccache), preset + ", a ccache asked for")
    return texts


def main():
    source = os.path.realpath(sys.argv[1])
    with tempfile.TemporaryDirectory() as folder:
        folder = os.path.realpath(folder)
        for name in ("caches", "none"):
            os.mkdir(os.path.join(folder, name))
        ccache = os.path.join(folder, "caches", "ccache")
        with open(ccache, "w") as f:
            f.write('#!/bin/sh\nexec "$@"\n')
        os.chmod(ccache, 0o755)
        texts = [t for preset in FEWEST for t in check(source, preset, folder)]
    if texts:
        raise SystemExit("\n".join(texts[:10]) + (f"\nand {len(texts) - 10} more" if len(texts) > 10 else ""))


main()
