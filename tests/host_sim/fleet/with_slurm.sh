#!/usr/bin/env bash
# Runs a command with a Slurm of its own: one node on this computer, without systemd and cgroups, all in one folder.
#   with_slurm.sh FOLDER COMMAND...     FOLDER: new or empty, at most 70 characters
# Needs slurmctld, slurmd, slurm-client and munge. Ends with the status of COMMAND; 91: Slurm did not start, see
# FOLDER/*.log.
set -u
mkdir -p "$1"
folder=$(cd "$1" && pwd); shift
PATH=$PATH:/usr/sbin:/sbin
host=$(hostname -s) user=$(id -un) pids=()
used() { (exec 3<>"/dev/tcp/127.0.0.1/$1") 2>/dev/null; }
port=$((21000 + $$ % 1000 * 10)); while used $port || used $((port + 1)); do port=$((port + 10)); done
mkdir -p "$folder/state"; chmod 755 "$folder"
(umask 077; head -c 128 /dev/urandom >"$folder/munge.key")
cat >"$folder/slurm.conf" <<CONF
ClusterName=test
SlurmctldHost=$host(127.0.0.1)
SlurmctldPort=$port
SlurmUser=$user
SlurmdUser=$user
AuthInfo=socket=$folder/munge.sock,cred_expire=5
StateSaveLocation=$folder/state
SlurmdSpoolDir=$folder/state/%n
SlurmctldPidFile=$folder/slurmctld.pid
SlurmdPidFile=$folder/slurmd-%n.pid
SlurmctldLogFile=$folder/slurmctld.log
SlurmdLogFile=$folder/slurmd.log
ProctrackType=proctrack/linuxproc
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
ReturnToService=2
MinJobAge=86400
DependencyParameters=kill_invalid_depend
SchedulerParameters=batch_sched_delay=0,sched_interval=5,bf_interval=5
NodeName=n1 NodeHostname=$host NodeAddr=127.0.0.1 Port=$((port + 1)) CPUs=2
PartitionName=main Nodes=ALL Default=YES MaxTime=INFINITE State=UP
CONF
unset ${!SLURM@}; export SLURM_CONF=$folder/slurm.conf
stop() {
  trap - EXIT
  scancel -u "$user" 2>/dev/null
  for _ in $(seq 100); do [ -z "$(squeue -h -t running,completing 2>/dev/null)" ] && break; sleep 0.1; done
  for ((k = ${#pids[@]} - 1; k >= 0; k--)); do kill "${pids[k]}" 2>/dev/null; wait "${pids[k]}" 2>/dev/null; done
}
trap stop EXIT; trap 'exit 143' TERM INT
munged -F --key-file="$folder/munge.key" --socket="$folder/munge.sock" --pid-file="$folder/munged.pid" \
  --seed-file="$folder/munge.seed" --log-file="$folder/munged.log" >"$folder/munged.out.log" 2>&1 & pids+=($!)
for _ in $(seq 100); do [ -S "$folder/munge.sock" ] && break; sleep 0.1; done
slurmctld -D -c -f "$SLURM_CONF" >"$folder/slurmctld.out.log" 2>&1 & pids+=($!)
slurmd -D -N n1 -f "$SLURM_CONF" >"$folder/slurmd.out.log" 2>&1 & pids+=($!)
SECONDS=0
until [ "$(sinfo -h -t idle -o %D 2>/dev/null)" = 1 ]; do
  [ $SECONDS -lt 120 ] || { echo "no idle node after 120 s, see $folder" >&2; exit 91; }
  sleep 0.2
done
"$@"
