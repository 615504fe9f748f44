#!/bin/bash
# SPDX-License-Identifier: MIT
#
# check_schedulers.sh: guarantees, for the commands of docs/scale.md as they are
# printed, with a capture of four segments in place of 600,
#   xargs, parallel, mpirun
#               the parts, joined, are the bytes of a single process; run again,
#               they are finished
#   slurm       the same for an array of a real Slurm of one node, and for the
#               join that waits for it; a task that is requeued while it trains
#               continues from its checkpoint, one that is requeued when it is
#               finished ends with status 0
# It starts munged, slurmctld and slurmd, with all their files in a folder of
# its own, and needs to be root for them. In `make test-all` alone.
set -u
saga=$(realpath "${SAGA:-${BUILD:-build}/saga}")
page=$(realpath docs/scale.md)
checks=schedulers
. "$(dirname "$0")/verdict.sh"
cd "$tmp" || exit
PATH=$(dirname "$saga"):/usr/sbin:$PATH
unset OMP_NUM_THREADS

# block WORD: prints the page's block that has a word, for four segments.
block() {
    awk -v word="$1" '/^    / { b = b substr($0, 5) "\n"; next }
        { if (index(b, word)) printf "%s", b; b = "" }' "$page" |
        grep -v '^O=' |
        sed 's/CAPTURE/cap/; s/0 599/0 3/; s/0-599/0-3/; s/ 599)/ 3)/
             s/mpirun -n 64/mpirun --allow-run-as-root --oversubscribe -n 2/'
}
export O='--segment 2 --primitives 150 --iterations 3000 --moving --ablate
no-teachers'
O=$(echo "$O" | tr '\n' ' ')
"$saga" synth cap --size 64x36 --cameras 4 --hold-out 1 --frames 8 \
    --points 300 --depth-every 0 >out 2>err || complain "synth: $(cat err)"
"$saga" encode cap $O -o whole.saga >out 2>err || complain "$(cat err)"
bash -ec "$(block networks-only | head -n 1)" >out 2>err ||
    complain "networks: $(tail -n 1 err)"

# joins WORD: runs a block twice. After each run, the joined parts must be the
# bytes of a single process.
joins() {
    local run
    for run in first second; do
        bash -ec "$(block "$1")" >"$1.out" 2>"$1.err" </dev/null ||
            complain "$1, $run run: $(tail -n 1 "$1.err")"
        "$saga" join part_*.saga -o scene.saga >out 2>err ||
            complain "$1: $(cat err)"
        cmp -s scene.saga whole.saga || complain "$1: another film"
    done
    [ "$(grep -c 'is already finished' "$1.err")" = 4 ] ||
        complain "$1: parts are made again"
    rm -f part_* scene.saga
    verdict "$1"
}
for with in xargs parallel mpirun; do
    if command -v $with >/dev/null; then
        joins $with
    else
        echo "ok   schedulers $with skipped: it is not installed"
    fi
done

# ---- slurm
if ! command -v slurmctld munged >/dev/null || [ "$(id -u)" != 0 ]; then
    echo "ok   schedulers slurm skipped: not installed, or not root"
    all_passed
    exit
fi
daemons=()
end_slurm() {
    kill "${daemons[@]}" 2>/dev/null
    wait "${daemons[@]}" 2>/dev/null
    rm -rf "$tmp"
}
trap end_slurm EXIT
mkdir -m 700 munge slurm slurm/state slurm/spool
head -c 1024 /dev/urandom >munge/key
chmod 600 munge/key
cat >slurm/slurm.conf <<CONF
ClusterName=check
SlurmctldHost=$(hostname -s)(127.0.0.1)
SlurmUser=root
AuthType=auth/munge
AuthInfo=socket=$tmp/munge/socket
SlurmctldPort=26817
SlurmdPort=26818
StateSaveLocation=$tmp/slurm/state
SlurmdSpoolDir=$tmp/slurm/spool
SlurmctldPidFile=$tmp/slurm/slurmctld.pid
SlurmdPidFile=$tmp/slurm/slurmd.pid
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
ReturnToService=2
MpiDefault=none
MinJobAge=100000
NodeName=$(hostname -s) NodeAddr=127.0.0.1 CPUs=$(nproc)
PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP
CONF
export SLURM_CONF=$tmp/slurm/slurm.conf
munged --force -F --key-file="$tmp/munge/key" --socket="$tmp/munge/socket" \
    --pid-file="$tmp/munge/pid" --log-file="$tmp/munge/log" \
    --seed-file="$tmp/munge/seed" >munge/out 2>&1 &
daemons+=($!)
until [ -S munge/socket ] || ! kill -0 "${daemons[0]}" 2>/dev/null; do
    sleep 0.1
done
slurmctld -D >slurm/slurmctld.log 2>&1 &
daemons+=($!)
slurmd -D >slurm/slurmd.log 2>&1 &
daemons+=($!)
for ((i = 0; i < 300; i++)); do
    [ "$(sinfo -h -o %T 2>/dev/null)" = idle ] && break
    sleep 0.1
done
[ "$i" -lt 300 ] || complain "Slurm does not start: $(tail -n 1 \
    slurm/slurmctld.log) $(tail -n 1 slurm/slurmd.log)"

state() { scontrol -o show job "$1" 2>/dev/null | grep -o 'JobState=[A-Z]*'; }
# waits JOB: until all tasks of a job are completed, a minute at most. Slurm
# keeps a job that it requeues for two minutes, unless it is told.
waits() {
    local i
    for ((i = 0; i < 200; i++)); do
        [ "$(state "$1" | sort -u)" = "JobState=COMPLETED" ] && return
        scontrol -o show job "$1" | grep -q 'Reason=BeginTime' &&
            scontrol update jobid="$1" StartTime=now >/dev/null 2>&1
        sleep 0.3
    done
    complain "job $1 is not completed: $(state "$1" | tr '\n' ' ')"
}
bash -ec "$(block sbatch)
echo \$job" >out 2>err || complain "sbatch: $(cat err)"
job=$(tail -n 1 out)
joined=$(sed -n 's/^Submitted batch job //p' out)
waits "$job"
waits "$joined"
cmp -s scene.saga whole.saga || complain "an array: another film"

scontrol requeue "${job}_2" 2>err || complain "requeue: $(cat err)"
waits "$job"
grep -q 'part_00002.saga is already finished' "slurm-${job}_2.out" ||
    complain "a finished task: $(tail -n 2 "slurm-${job}_2.out")"

rm -f part_00001.saga*
long=$(sbatch --parsable --requeue --open-mode=append --wrap "exec saga encode \
    cap $O --checkpoint-every 100 --resume --networks nets --only 1 \
    -o part_00001.saga --threads 1")
# The training must be in its middle when it is requeued; it is stopped there.
for ((i = 0; i < 600; i++)); do
    pid=$(pgrep -f -- '--only 1 -o part_00001.saga' | tail -n 1)
    [ -n "$pid" ] && ls part_00001.saga.saga-part-* >/dev/null 2>&1 && break
    sleep 0.01
done
scontrol requeue "$long" 2>err || complain "requeue: $(cat err)"
waits "$long"
grep -q 'stopped by a signal' "slurm-$long.out" ||
    complain "no signal came: $(tail -n 3 "slurm-$long.out")"
"$saga" join part_*.saga -o scene.saga >out 2>err || complain "$(cat err)"
cmp -s scene.saga whole.saga || complain "a requeued task: another film"
verdict slurm

all_passed
