#!/usr/bin/env python3
"""Writes one row of the table "fresh machine" of a README.

    fresh_machine_row.py README COMMAND RELEASE COMMIT SECONDS RESULT

The table stands between `<!-- figures: fresh machine -->` and `<!-- end of figures -->`; the row of the same command
and release is replaced.
"""
import datetime
import re
import sys


def main():
    readme, command, release, commit, seconds, result = sys.argv[1:]
    with open(readme) as f:
        text = f.read()
    found = re.search(r"<!-- figures: fresh machine -->\n(.*?)<!-- end of figures -->", text, re.S)
    if not found:
        raise SystemExit(f"{readme}: no table 'fresh machine'")
    head = f"| `./bms {command}` | {release} |"
    row = f"{head} {result} | {int(seconds):,} s | {datetime.date.today()} | {commit} |"
    lines = [line for line in found.group(1).splitlines() if not line.startswith(head)]
    table = "\n".join(lines[:2] + sorted(lines[2:] + [row])) + "\n"
    with open(readme, "w") as f:
        f.write(text[:found.start(1)] + table + text[found.end(1):])
    print(row)


main()
