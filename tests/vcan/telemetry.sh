#!/bin/bash
# The firmware on a CAN bus with noise, recorded by candump and by bms monitor:
#
#   telemetry.sh BMS FEEDER IMAGE RECORDING SOC SIGMA FOLDER
#
#   emulator <-> pseudo-terminal <-> slcand <-> slcan0 -> cangw -> vcan0 <- noise
#
# FEEDER (feed_samples) sends one frame of noise for each frame of the firmware. Output in FOLDER: candump.log with the
# frames of the BMS, from candump; record.log, rows.csv and monitor.json, from bms monitor. The emulator runs outside
# User-Mode Linux, because the polling firmware would use the guest's only processor.
set -eu
PATH=$PATH:/usr/sbin:/sbin
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
pids=()
trap 'for pid in "${pids[@]}"; do kill "$pid" 2>/dev/null || true; done' EXIT
wait_for() {  # at most two minutes: a limit for a failure, not for a slow machine
  local until=$((SECONDS + 120))
  until "$@" >/dev/null 2>&1; do
    [ $SECONDS -lt $until ] || { echo "telemetry.sh: this did not succeed within two minutes: $*" >&2; exit 1; }
    sleep 0.05
  done
}

# The emulated UART drops bytes that arrive before the firmware has enabled it, so the command is repeated until the
# answer arrives. cat reads the answers: while `read -d` of bash waits, the terminal changes each received \r to \n.
firmware_answers() {
  printf 'V\r' >&3
  grep -q $'V1010\r' "$1"
}

outside() {
  local image=$3 folder=$7 line
  qemu-system-arm -M netduinoplus2 -display none -monitor none -semihosting-config enable=on,target=native \
    -serial pty -kernel "$image" >"$folder/emulator.log" 2>&1 & pids+=($!)
  wait_for grep -q '/dev/pts/[0-9]*' "$folder/emulator.log"
  line=$(grep -o '/dev/pts/[0-9]*' "$folder/emulator.log")
  exec 3<>"$line"
  stty raw -echo <&3
  cat <&3 >"$folder/answers" & local reader=$!
  wait_for firmware_answers "$folder/answers"
  kill $reader
  wait $reader || true
  VCAN_SECONDS=900 VCAN_TTY=$line "$here/with_vcan.sh" "$here/telemetry.sh" --on-the-bus "$@"
}

on_the_bus() {
  local bms=$1 feeder=$2 recording=$4 soc=$5 sigma=$6 folder=$7 dump monitor last
  slcand -F -o -c -s6 "$VCAN_LINE" slcan0 >"$folder/slcand.log" 2>&1 & pids+=($!)
  wait_for test -e /sys/class/net/slcan0
  ip link set slcan0 txqueuelen 1000 up
  cangw -A -s slcan0 -d vcan0 -e
  candump -r 8000000 -L vcan0,180:7E0 >"$folder/candump.log" & dump=$!
  "$bms" monitor vcan0 --record "$folder/record.log" --csv "$folder/rows.csv" --json "$folder/monitor.json" \
    --quiet & monitor=$!
  pids+=($dump $monitor)
  wait_for test -e "$folder/record.log"  # exists once the monitor listens
  wait_for grep -q '^ *vcan0 *180 ' /proc/net/can/rcvlist_fil  # candump listens too
  "$feeder" slcan0 vcan0 "$recording" "$soc" "$sigma" >"$folder/fed" ||
    { ip -s link; cat /proc/net/softnet_stat; exit 1; } >&2
  cat "$folder/fed"
  last=$(sed -n 's/^last frame //p' "$folder/fed")
  wait_for grep -q "$last" "$folder/candump.log"
  wait_for grep -q "$last" "$folder/record.log"
  kill -INT $monitor $dump
  wait $monitor
  wait $dump || true
  cangw -D -s slcan0 -d vcan0 -e
}

if [ "$1" = --on-the-bus ]; then shift; on_the_bus "$@"; else outside "$@"; fi
