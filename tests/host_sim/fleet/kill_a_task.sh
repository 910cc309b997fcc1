#!/usr/bin/env bash
# Submits a run to the Slurm of with_slurm.sh, kills the tool in a task that is running, waits for the merge. Prints
# how often a task was started again, and the state of the merge.
#   kill_a_task.sh TOOL FOLDER ARGUMENTS...     FOLDER: of the results
set -eu
tool=$1 folder=$2; shift 2
"$tool" "$@" --json jobs.json --quiet
array=$(sed -n 's/.*"array_job": "\([0-9]*\)".*/\1/p' jobs.json)
merge=$(sed -n 's/.*"merge_job": "\([0-9]*\)".*/\1/p' jobs.json)
victim=
for _ in $(seq 2400); do
  victim=$(pgrep -o -f -- "^$tool fleet run --manifest $folder/manifest.csv .* --part " || true)
  [ -z "$victim" ] || [ ! -d "$folder/results" ] || break
  sleep 0.05
done
echo "killed: $(tr '\0' ' ' <"/proc/$victim/cmdline")"
kill -9 "$victim"
while [ -n "$(squeue -h -j "$array,$merge")" ]; do sleep 0.5; done
scontrol show job "$array" | grep -o 'Restarts=[1-9]' || true
squeue -h -t all -j "$merge" -o %T
