#!/usr/bin/env bash
# Line coverage of firmware, estimator, protection, storage, boot and the portable part of hal. It runs the tests, which
# are built with --coverage (preset host-coverage), and writes the table to tests/README.md. Templates count only where
# they are instantiated; headers that no test includes are listed.
#
#   coverage.sh BUILD_FOLDER TEST...      exit code 1: less than 95 % of the lines of firmware/, firmware/boot/ or
#                                         estimator/ run
set -euo pipefail
folder=$1; shift
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
log=$folder/coverage.log
: >"$log"
find "$folder" -name '*.gcda' -delete
for test; do
  "$folder/tests/$test" --gtest_brief=1 >>"$log" 2>&1 || { echo "coverage: $test fails: $log" >&2; exit 3; }
done
gcovr --root "$root" --object-directory "$folder" --exclude-throw-branches --json-summary "$folder/coverage.json" \
  --txt "$folder/coverage.txt" --filter "$root/(firmware|estimator|hal)/" \
  --exclude "$root/firmware/(authentication|can)/" "$folder" >>"$log" 2>&1
python3 - "$root" "$folder/coverage.json" <<'PYTHON'
import json, pathlib, re, sys
root, counted = pathlib.Path(sys.argv[1]), json.load(open(sys.argv[2]))["files"]
seen = {f["filename"] for f in counted}
bad = False
table = ["| folder | lines | run | part |", "|---|---|---|---|"]
folders = ("firmware", "estimator", "firmware/protection", "firmware/storage", "firmware/boot", "hal")
def folder_of(file):
    return max((folder for folder in folders if file.startswith(folder + "/")), key=len)
for folder in folders:
    of = [f for f in counted if folder_of(f["filename"]) == folder]
    lines, run = sum(f["line_total"] for f in of), sum(f["line_covered"] for f in of)
    part = run / max(lines, 1)
    bad = bad or (folder in ("firmware", "firmware/boot", "estimator") and part < 0.95)
    table.append(f"| {folder} | {lines} | {run} | {100 * part:.1f} % |")
table = "\n".join(table) + "\n"
print(table)
readme = root / "tests/README.md"
readme.write_text(re.sub(r"(<!-- figures: coverage -->\n).*?(<!-- end of figures -->)",
                         lambda m: m[1] + table + m[2], readme.read_text(), flags=re.S))
for f in sorted(counted, key=lambda f: f["line_covered"] - f["line_total"])[:12]:
    if f["line_covered"] < f["line_total"]:
        print(f"{f['filename']}: {f['line_total'] - f['line_covered']} of {f['line_total']} lines do not run")
for folder in folders[:-1]:
    for path in sorted((root / folder).glob("*.?pp")):
        if f"{folder}/{path.name}" not in seen:
            print(f"{folder}/{path.name}: no line is compiled into these tests")
sys.exit(1 if bad else 0)
PYTHON
