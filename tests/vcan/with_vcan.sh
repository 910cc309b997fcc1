#!/bin/bash
# with_vcan.sh PROGRAM [ARGUMENT...]: runs PROGRAM where vcan0 is up, and ends with its exit code. As root on a machine that has vcan0: there and then.
# Else in User-Mode Linux, which needs neither root nor modules of this machine's kernel: its / is this machine's, so programs, libraries and files are
# the same, written as this user; what PROGRAM prints comes when it has ended. Sockets, pipes and pseudo-terminals outside are not seen inside.
#
#   VCAN_SECONDS   longest time, 240; then the exit code is 124        VCAN_UML=1   User-Mode Linux although there is a vcan0
#   VCAN_TTY       a serial line or pseudo-terminal of this machine that PROGRAM is to have: it finds its name there in VCAN_LINE
#
# Needs: user-mode-linux busybox-static iproute2 gcc (Debian's names). Exit code 125: something of these is missing.
set -u
[ $# -gt 0 ] || { sed -n '2,/^set/{/^#/p}' "$0"; exit 2; }
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
if [ "${VCAN_UML:-0}" = 0 ] && [ "$(id -u)" = 0 ] && [ "$(cat /sys/class/net/vcan0/operstate 2>/dev/null)" = unknown ]; then VCAN_LINE=${VCAN_TTY:-} exec "$@"; fi
for program in linux.uml gcc /bin/busybox ip; do
  PATH=$PATH:/usr/sbin:/sbin command -v "$program" >/dev/null || { echo "with_vcan.sh: no $program; Debian: user-mode-linux gcc busybox-static iproute2" >&2; exit 125; }
done
job=$(mktemp -d "${TMPDIR:-/tmp}/vcan.XXXXXX") || exit 125
guest=
trap '[ -z "$guest" ] || kill $guest 2>/dev/null; rm -rf "$job"' EXIT
gcc -O2 -shared -fPIC -o "$job/shim.so" "$here/xstate_shim.c" || exit 125
{ declare -p PATH HOME; echo "export VCAN_LINE=${VCAN_TTY:+/dev/ttyS0}"; printf 'cd %q\nexec' "$PWD"; printf ' %q' "$@"; echo; } | sed 's/^declare -x /export /' >"$job/command"
: >"$job/stdout"; : >"$job/stderr"
# one processor of those that are allowed: frames are five times slower where the guest wanders. The console goes through a pipe: a file can't be polled.
processors=($(taskset -cp $$ | sed 's/.*: //' | tr ',' '\n' | awk -F- '{for (k = $1; k <= ($2 == "" ? $1 : $2); k++) print k}'))
LD_PRELOAD=$job/shim.so taskset -c "${processors[RANDOM % ${#processors[@]}]}" setarch -R \
  linux.uml mem=256M root=/dev/root rootfstype=hostfs rootflags=/ rw selinux=0 apparmor=0 con=null con0=null,fd:1 ${VCAN_TTY:+ssl0=tty:$VCAN_TTY} init="$here/guest_init.sh" vcan_job="$job" \
  </dev/null > >(cat >"$job/console") 2>&1 & guest=$!
# Once in some thousand bursts the guest sleeps on although its serial line has bytes: the signal that says so was lost. Another makes it look.
until=$((SECONDS + ${VCAN_SECONDS:-240}))
while kill -0 $guest 2>/dev/null; do
  [ ! -f "$job/up" ] || kill -IO $guest 2>/dev/null
  [ $SECONDS -lt $until ] || { kill $guest; sleep 5; kill -KILL $guest 2>/dev/null; }
  sleep 0.1
done
guest=
cat "$job/stdout"; cat "$job/stderr" >&2
[ -f "$job/code" ] && exit "$(cat "$job/code")"
tail -5 "$job/console" >&2
echo "with_vcan.sh: the guest did not finish" >&2
exit 124
