#!/bin/bash
# The firmware on a CAN bus with noise, looked at by candump and by bms monitor:
#
#   telemetry.sh BMS FEEDER IMAGE RECORDING SOC SIGMA FOLDER
#
#   emulator -> pseudo-terminal -> slcand -> slcan0 -> cangw -> vcan0 <- cangen (as fast as it can; all kinds of frames)
#
# leaves in FOLDER: candump.log, the BMS's frames by candump; record.log, rows.csv and monitor.json by bms monitor.
# The emulator is outside of User-Mode Linux, where the firmware's polling would take the one processor.
set -eu
PATH=$PATH:/usr/sbin:/sbin
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
pids=()
trap 'for pid in "${pids[@]}"; do kill "$pid" 2>/dev/null || true; done' EXIT
soon() { for _ in {1..400}; do "$@" >/dev/null 2>&1 && return; sleep 0.05; done; echo "telemetry.sh: never came true: $*" >&2; exit 1; }

settled() {  # a file that has not grown for half a second
  local before=-1 now
  for _ in {1..120}; do
    now=$(stat -c %s "$1")
    [ "$now" != "$before" ] || return 0
    before=$now
    sleep 0.5
  done
}

firmware_answers() {  # an emulated UART loses what comes before the firmware has started it
  printf 'V\r' >&3
  local answer
  read -r -t 0.2 -d V answer <&3 && read -r -t 0.2 -d $'\r' answer <&3 && [ "$answer" = 1010 ]
}

outside() {
  local image=$3 folder=$7 line
  qemu-system-arm -M netduinoplus2 -display none -monitor none -semihosting-config enable=on,target=native -serial pty -kernel "$image" >"$folder/emulator.log" 2>&1 & pids+=($!)
  soon grep -q '/dev/pts/[0-9]*' "$folder/emulator.log"
  line=$(grep -o '/dev/pts/[0-9]*' "$folder/emulator.log")
  exec 3<>"$line"
  stty raw -echo <&3
  soon firmware_answers
  VCAN_TTY=$line "$here/with_vcan.sh" "$here/telemetry.sh" --on-the-bus "$@"
}

on_the_bus() {
  local bms=$1 feeder=$2 recording=$4 soc=$5 sigma=$6 folder=$7 dump monitor
  slcand -F -o -c -s6 "$VCAN_LINE" slcan0 >"$folder/slcand.log" 2>&1 & pids+=($!)
  soon test -e /sys/class/net/slcan0
  ip link set slcan0 txqueuelen 1000 up
  cangw -A -s slcan0 -d vcan0 -e
  candump -r 8000000 -L vcan0,180:7E0 >"$folder/candump.log" & dump=$!
  "$bms" monitor vcan0 --record "$folder/record.log" --csv "$folder/rows.csv" --json "$folder/monitor.json" --quiet & monitor=$!
  pids+=($dump $monitor)
  soon test -e "$folder/record.log"  # made when the monitor listens
  cangen vcan0 -g 0 -i -I 5A5 -L 8 -D r >/dev/null 2>&1 & pids+=($!)
  cangen vcan0 -g 1 -i -m -I 6A6 >/dev/null 2>&1 & pids+=($!)
  "$feeder" slcan0 "$recording" "$soc" "$sigma" || { ip -s link; cat /proc/net/softnet_stat; exit 1; } >&2
  kill "${pids[@]: -2}"
  settled "$folder/candump.log"  # on a busy machine it writes long after the bus has become silent
  kill -INT $monitor $dump
  wait $monitor
  wait $dump || true
  cangw -D -s slcan0 -d vcan0 -e
}

if [ "$1" = --on-the-bus ]; then shift; on_the_bus "$@"; else outside "$@"; fi
