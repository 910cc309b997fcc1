#!/bin/bash
# The load that bms monitor sustains on one processor:
#
#   load.sh BMS WRITE_TRAFFIC [FRAMES_PER_S [SECONDS]]      default: 10,000 frames per second for 60 s
#
# Prints frames sent, received and lost, memory at the start and the end, and processor time.
# Exit code 1: a frame was lost, or memory grew.
set -eu
bms=$1 traffic=$2 per_s=${3:-10000} seconds=${4:-60}
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
mkfifo "$folder/bus"
resident() { awk '/VmRSS/ {print $2}' "/proc/$1/status"; }
taskset -c 0 "$bms" monitor file:- --quiet --json "$folder/picture.json" <"$folder/bus" & tool=$!
"$traffic" dump "$per_s" "$seconds" >"$folder/bus" 2>"$folder/sent" & bus=$!
sleep 2
early=$(resident $tool)
sleep $((seconds - 4))
late=$(resident $tool)
read -r _ _ _ _ _ _ _ _ _ _ _ _ _ user system _ <"/proc/$tool/stat"
wait $bus
wait $tool
/usr/bin/python3 - "$folder/picture.json" "$(cat "$folder/sent")" "$early" "$late" \
  "$((user + system))" "$(getconf CLK_TCK)" "$seconds" <<'END'
import json
import sys

picture, sent, early, late, ticks, tick_hz, seconds = json.load(open(sys.argv[1])), *map(int, sys.argv[2:])
lost = sum(m["lost"] for m in picture["messages"].values())
print(f"{sent} frames sent, {picture['frames']} received, {lost} lost; memory {early} kB after 2 s, {late} kB at the "
      f"end; {100 * ticks / tick_hz / (seconds - 2):.1f} % of a processor")
sys.exit(0 if sent == picture["frames"] and lost == 0 and late <= early + 256 else 1)
END
