#!/bin/busybox sh
# The first process of the guest of with_vcan.sh. It loads the CAN modules, starts vcan0, and runs the command of the
# folder vcan_job with bash, for which its words are quoted.
b=/bin/busybox
$b mount -t proc proc /proc; $b mount -t sysfs sysfs /sys; $b mount -t devtmpfs dev /dev 2>/dev/null
$b mkdir -p /dev/pts; $b mount -t devpts -o ptmxmode=666 devpts /dev/pts
for word in $($b cat /proc/cmdline); do case $word in vcan_job=*) job=${word#*=} ;; esac; done
release=$($b uname -r)
for modules in /usr/lib/uml/modules/$release /lib/modules/$release; do [ -d "$modules" ] && break; done
for module in net/can/can net/can/can-raw net/can/can-gw \
  drivers/net/can/dev/can-dev drivers/net/can/vcan drivers/net/can/slcan/slcan; do
  [ ! -f "$modules/kernel/$module.ko" ] || $b insmod "$modules/kernel/$module.ko"
done
: >"$job/up"
PATH=/usr/sbin:/usr/bin:/sbin:/bin
ip link set lo up
ip link add dev vcan0 type vcan && ip link set vcan0 mtu 72 && ip link set vcan0 up
bash "$job/command" </dev/null >"$job/stdout" 2>"$job/stderr"
echo $? >"$job/code"
$b sync
$b poweroff -f
