#!/usr/bin/env bash
# The examples for clusters, run for real: Slurm with one node on the loopback interface, then Snakemake. Skipped (exit code 77) where they
# are not installed or cannot be started. Arguments: the program, the folder of the sources.
# Tests: cohort_run.c
. "$(dirname "$0")/../cli/common.sh"
export OMP_WAIT_POLICY=passive SDMGEN=$program
examples=$source_folder/examples/cluster
PATH=$PATH:/usr/sbin:/sbin
for tool in munged slurmctld slurmd sbatch scontrol sacctmgr snakemake; do
    command -v $tool >/dev/null || { echo "skipped: no $tool (Debian: slurm-wlm, munge, snakemake)"; exit 77; }
done
[ "$(id -u)" = 0 ] || { echo 'skipped: slurmd needs the rights of root'; exit 77; }

shape='--shape ellipsoid -O edge=1.5'
for i in 1 2 3 4; do
    expect 0 - sdmgen phantom $shape -p rx=3.$i -p ry=2.$i -p rz=1.5 --spacing 0.6 --seed $i -o c.nii --label l$i.nrrd -q
done
{
    echo id,image,label
    for i in $(seq 12); do echo "c$i,l$((i % 4 + 1)).nrrd,1"; done
} >cohort.csv
options='-O edge=1.5 --rotation 0,0,0 --spacing 1 --eps 1e-2'
expect 0 - sdmgen fit --shape ellipsoid $options --cases cohort.csv -o whole -q
expect 0 - sdmgen collect whole -o whole.csv -q

# A cluster of one node.
here=$(mktemp -d /tmp/sdmgen-cluster.XXXXXX) # the name of a socket must be short
pids=()
stop() {
    for pid in "${pids[@]}"; do kill "$pid" 2>/dev/null; done
    wait 2>/dev/null
    rm -rf "$here"
}
trap stop EXIT
chmod 755 "$here"
mkdir "$here"/{munge,state,spool}
dd if=/dev/urandom of="$here/munge/key" bs=64 count=1 2>/dev/null
chmod 700 "$here/munge" && chmod 400 "$here/munge/key"
node=$(hostname -s)
cat >"$here/slurm.conf" <<C
ClusterName=test
SlurmctldHost=$node(127.0.0.1)
SlurmctldPort=16817
SlurmdPort=16818
AuthType=auth/munge
AuthInfo=socket=$here/munge.socket
CredType=cred/munge
SlurmUser=root
SlurmdUser=root
StateSaveLocation=$here/state
SlurmdSpoolDir=$here/spool
SlurmctldPidFile=$here/slurmctld.pid
SlurmdPidFile=$here/slurmd.pid
SlurmctldLogFile=$here/slurmctld.log
SlurmdLogFile=$here/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SwitchType=switch/none
MpiDefault=none
ReturnToService=2
SchedulerParameters=sched_interval=2,batch_sched_delay=1
MinJobAge=60
KillWait=10
NodeName=$node NodeAddr=127.0.0.1 CPUs=$(nproc) State=UNKNOWN
PartitionName=all Nodes=$node Default=YES MaxTime=INFINITE State=UP
C
export SLURM_CONF=$here/slurm.conf
# give TIMEOUT COMMAND...: waits until the command succeeds
give() {
    local seconds=$1
    shift
    for _ in $(seq $((seconds * 5))); do "$@" >/dev/null 2>&1 && return 0 || sleep 0.2; done
    return 1
}
munged --foreground --force --key-file="$here/munge/key" --socket="$here/munge.socket" --pid-file="$here/munge/pid" \
    --log-file="$here/munge/log" --seed-file="$here/munge/seed" >"$here/munge.out" 2>&1 &
pids+=($!)
give 20 munge -S "$here/munge.socket" -n || { echo "skipped: munged does not start: $(cat "$here/munge.out")"; exit 77; }
slurmctld -D >"$here/ctld.out" 2>&1 &
pids+=($!)
slurmd -D -N "$node" >"$here/slurmd.out" 2>&1 &
pids+=($!)
give 60 eval 'sinfo -h -o %t | grep -q idle' || {
    echo "skipped: slurmd does not start: $(tail -n 5 "$here/ctld.out" "$here/slurmd.out" "$here/slurmctld.log" "$here/slurmd.log")"
    exit 77
}

# ended JOB: waits for the end of a job
ended() { give 240 eval "! squeue -h -j $1 2>/dev/null | grep -q ." || bad "job $1 does not end: $(squeue; cat slurm-*.out)"; }
# An array of five tasks, counted from 0: each does its part, and together they do all.
submit() { sbatch --parsable --cpus-per-task=1 --mem=0 "$@"; }
job=$(submit --array=0-4 "$examples/cohort.slurm" --shape ellipsoid cohort.csv array $options) || bad 'sbatch failed'
ended "$job"
expect 0 - sdmgen collect array -o array.csv -q
cmp whole.csv array.csv || bad "the table of the array differs: $(cat slurm-*.out)"
grep -q 'part 5 of 5: cases 10 to 12 of 12; the others are not done by this call' slurm-"${job}"_4.out || bad "output: $(cat slurm-"${job}"_4.out)"

# A task that gets the signal before its time limit gives the case back and is queued again; then it does the rest. Slurm may send the
# signal up to a minute early.
{
    echo id,image,label,turns-sphere
    echo fast,l1.nrrd,1,1
    echo slow,l1.nrrd,1,4000
} >slow.csv
slow='-O edge=1.5 --spacing 1 --eps 1e-2'
job=$(submit --time=2 --signal=B:TERM@60 --array=1-1 "$examples/cohort.slurm" --shape ellipsoid slow.csv requeued $slow) || bad 'sbatch failed'
give 60 test -e requeued/slow/log.txt || bad "the slow case does not begin: $(cat slurm-"$job"*.out)"
give 120 grep -q 'error: interrupted' "slurm-${job}_1.out" || bad "no interrupt: $(cat "slurm-${job}_1.out")"
sed -i 's/4000/1/' slow.csv # the rest is quick
scontrol release "$job" 2>/dev/null
give 30 eval "scontrol show job $job | grep -q 'Restarts=1'" || bad "not queued again: $(scontrol show job "$job")"
scontrol update JobId="$job" StartTime=now 2>/dev/null
ended "$job"
expect 0 - sdmgen collect requeued -q
[ "$(grep -c 'case 1 of 2, fast: accepted' "slurm-${job}_1.out")" = 1 ] || bad "done twice: $(cat "slurm-${job}_1.out")"

# Snakemake: parts, then the table; a second run has nothing to do.
sdmgen_config="sdmgen=$program cases=cohort.csv out=snake parts=4"
snakemake -q -s "$examples/Snakefile" --cores 2 --config $sdmgen_config "model=--shape ellipsoid" "options=$options" >snake.log 2>&1 ||
    bad "snakemake: $(tail -n 20 snake.log)"
cmp whole.csv snake.csv || bad 'the table of Snakemake differs'
snakemake -s "$examples/Snakefile" --cores 2 --config $sdmgen_config "model=--shape ellipsoid" "options=$options" >snake.log 2>&1
grep -q 'Nothing to be done' snake.log || bad "snakemake again: $(tail -n 5 snake.log)"
rm -rf .snakemake
echo "12 cases: an array of five Slurm jobs and four parts by Snakemake give the table of one call; a job that was stopped went on; $SECONDS s"
finish
