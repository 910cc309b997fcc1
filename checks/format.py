#!/usr/bin/python3
"""Checks that clang-format would change nothing: C++ and the scripts of the pages, by .clang-format.

Exit code: 0 nothing to change, 1 a file is not formatted, 2 clang-format cannot be used.
"""
import os
import sys

sys.dont_write_bytecode = True  # no __pycache__ in the source tree
import sources

AT_ONCE = 50  # files for one run of clang-format


def main():
    own = os.path.dirname(os.path.abspath(__file__))
    options = sources.options("Checks the format of the sources.")
    options.add_argument("--fix", action="store_true", help="format the files instead")
    given = options.parse_args()
    style = "--style=file:" + os.path.join(os.path.dirname(own), ".clang-format")
    command = ["clang-format", style, *(["-i"] if given.fix else ["--dry-run", "-Werror", "-ferror-limit=1"])]
    paths = sources.paths(given.root, (*sources.CPP, ".js"))
    faults = 0
    for k in range(0, len(paths), AT_ONCE):
        try:
            done = sources.run(command + paths[k:k + AT_ONCE], cwd=given.root)
        except OSError as error:
            print(f"format: {error}", file=sys.stderr)
            return 2
        lines = [line for line in done.stderr.splitlines() if "error:" in line]
        if done.returncode and not lines:
            print(f"format: {done.stderr.strip()}", file=sys.stderr)
            return 2
        faults += len(lines)
        for line in lines:
            print(line)
    print(f"format: {len(paths)} files, {faults} not formatted")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
