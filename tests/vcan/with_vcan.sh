#!/bin/bash
# with_vcan.sh PROGRAM [ARGUMENT...]: runs PROGRAM on a machine with a CAN interface vcan0 and returns its exit code.
# If vcan0 exists and the user is root, PROGRAM runs directly. Otherwise it runs in User-Mode Linux, which needs neither
# root nor kernel modules of this machine. The guest's / is this machine's, so programs, libraries and files are the
# same, and files are written as this user. The output of PROGRAM appears when it has ended. Sockets, pipes and
# pseudo-terminals of this machine do not exist in the guest.
#
#   VCAN_SECONDS   time limit, 240; the exit code is 124 if it is exceeded
#   VCAN_UML=1     User-Mode Linux even if vcan0 exists
#   VCAN_TTY       a serial port or pseudo-terminal of this machine for PROGRAM, which finds its name in VCAN_LINE
#
# Needs the Debian packages user-mode-linux, busybox-static, iproute2 and gcc. Exit code 125: one of them is missing.
set -u
[ $# -gt 0 ] || { sed -n '2,/^set/{/^#/p}' "$0"; exit 2; }
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
vcan_state=$(cat /sys/class/net/vcan0/operstate 2>/dev/null)
if [ "${VCAN_UML:-0}" = 0 ] && [ "$(id -u)" = 0 ] && [ "$vcan_state" = unknown ]; then
  VCAN_LINE=${VCAN_TTY:-} exec "$@"
fi
for program in linux.uml gcc /bin/busybox ip; do
  PATH=$PATH:/usr/sbin:/sbin command -v "$program" >/dev/null && continue
  echo "with_vcan.sh: $program is missing; Debian packages: user-mode-linux gcc busybox-static iproute2" >&2
  exit 125
done
job=$(mktemp -d "${TMPDIR:-/tmp}/vcan.XXXXXX") || exit 125
guest=
trap '[ -z "$guest" ] || kill $guest 2>/dev/null; rm -rf "$job"' EXIT
gcc -O2 -shared -fPIC -o "$job/shim.so" "$here/xstate_shim.c" || exit 125
{
  declare -p PATH HOME
  echo "export VCAN_LINE=${VCAN_TTY:+/dev/ttyS0}"
  printf 'cd %q\nexec' "$PWD"
  printf ' %q' "$@"
  echo
} | sed 's/^declare -x /export /' >"$job/command"
: >"$job/stdout"; : >"$job/stderr"
# Run on one of the allowed processors: frames are five times slower if the guest moves between processors.
# The console goes through a pipe, because a file cannot be polled.
processors=($(taskset -cp $$ | sed 's/.*: //' | tr ',' '\n' |
  awk -F- '{for (k = $1; k <= ($2 == "" ? $1 : $2); k++) print k}'))
guest_options=(
  mem=256M root=/dev/root rootfstype=hostfs rootflags=/ rw selinux=0 apparmor=0 con=null con0=null,fd:1
  ${VCAN_TTY:+ssl0=tty:$VCAN_TTY} init="$here/guest_init.sh" vcan_job="$job")
LD_PRELOAD=$job/shim.so taskset -c "${processors[RANDOM % ${#processors[@]}]}" setarch -R \
  linux.uml "${guest_options[@]}" </dev/null > >(cat >"$job/console") 2>&1 & guest=$!
# Once in some thousand bursts the guest keeps sleeping although its serial port has received bytes, because the signal
# was lost. Another signal wakes it.
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
