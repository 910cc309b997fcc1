#!/bin/bash
# The firmware on a CAN bus with noise, looked at by candump and by bms monitor:
#
#   telemetry.sh BMS FEEDER IMAGE RECORDING SOC SIGMA FOLDER
#
#   emulator <-> pseudo-terminal <-> slcand <-> slcan0 -> cangw -> vcan0 <- noise (feed_samples: a frame for each of the firmware)
#
# leaves in FOLDER: candump.log, the BMS's frames by candump; record.log, rows.csv and monitor.json by bms monitor.
# The emulator is outside of User-Mode Linux, where the firmware's polling would take the one processor.
set -eu
PATH=$PATH:/usr/sbin:/sbin
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
pids=()
trap 'for pid in "${pids[@]}"; do kill "$pid" 2>/dev/null || true; done' EXIT
soon() {  # two minutes: a limit for what has failed, not for what is slow
  local until=$((SECONDS + 120))
  until "$@" >/dev/null 2>&1; do
    [ $SECONDS -lt $until ] || { echo "telemetry.sh: never came true: $*" >&2; exit 1; }
    sleep 0.05
  done
}

# An emulated UART drops what comes before the firmware has started it, so the question is repeated until the answer comes. cat reads the answers:
# while `read -d` of bash waits, it has the terminal turn each \r that arrives into \n.
firmware_answers() {
  printf 'V\r' >&3
  grep -q $'V1010\r' "$1"
}

outside() {
  local image=$3 folder=$7 line
  qemu-system-arm -M netduinoplus2 -display none -monitor none -semihosting-config enable=on,target=native -serial pty -kernel "$image" >"$folder/emulator.log" 2>&1 & pids+=($!)
  soon grep -q '/dev/pts/[0-9]*' "$folder/emulator.log"
  line=$(grep -o '/dev/pts/[0-9]*' "$folder/emulator.log")
  exec 3<>"$line"
  stty raw -echo <&3
  cat <&3 >"$folder/answers" & local reader=$!
  soon firmware_answers "$folder/answers"
  kill $reader
  wait $reader || true
  VCAN_SECONDS=900 VCAN_TTY=$line "$here/with_vcan.sh" "$here/telemetry.sh" --on-the-bus "$@"
}

on_the_bus() {
  local bms=$1 feeder=$2 recording=$4 soc=$5 sigma=$6 folder=$7 dump monitor last
  slcand -F -o -c -s6 "$VCAN_LINE" slcan0 >"$folder/slcand.log" 2>&1 & pids+=($!)
  soon test -e /sys/class/net/slcan0
  ip link set slcan0 txqueuelen 1000 up
  cangw -A -s slcan0 -d vcan0 -e
  candump -r 8000000 -L vcan0,180:7E0 >"$folder/candump.log" & dump=$!
  "$bms" monitor vcan0 --record "$folder/record.log" --csv "$folder/rows.csv" --json "$folder/monitor.json" --quiet & monitor=$!
  pids+=($dump $monitor)
  soon test -e "$folder/record.log"  # made when the monitor listens
  soon grep -q '^ *vcan0 *180 ' /proc/net/can/rcvlist_fil  # so does candump
  "$feeder" slcan0 vcan0 "$recording" "$soc" "$sigma" >"$folder/fed" || { ip -s link; cat /proc/net/softnet_stat; exit 1; } >&2
  cat "$folder/fed"
  last=$(sed -n 's/^last frame //p' "$folder/fed")
  soon grep -q "$last" "$folder/candump.log"
  soon grep -q "$last" "$folder/record.log"
  kill -INT $monitor $dump
  wait $monitor
  wait $dump || true
  cangw -D -s slcan0 -d vcan0 -e
}

if [ "$1" = --on-the-bus ]; then shift; on_the_bus "$@"; else outside "$@"; fi
