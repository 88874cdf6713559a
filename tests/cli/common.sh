# shellcheck shell=bash disable=SC2016,SC2034
# Functions shared by the tests of the command line (sourced): run a command, and check its exit code and its single line on stderr.
# Arguments: the program, the folder of the sources.
set -u
program=$1
source_folder=$2 # absolute, like program
# is_long: whether this is the run with the label "long", which also repeats properties on other inputs.
is_long() { [ "${SDM_LONG:-no}" = yes ]; }
# is_brief: whether sanitizers check the program; commands that run the same code as others are left out then.
is_brief() { [ "${SDM_BRIEF:-no}" = yes ]; }
work=files-of-$(basename "$0" .sh)
if is_long; then work=$work-long; fi
rm -rf "$work" && mkdir "$work" && cd "$work" || exit 1
failures=0
coarse_grids=no
unset SDMGEN_PLUGIN_PATH
export LC_ALL=C

# emulated: whether an emulator runs the program, by a script of one line; binary: the file of the program itself.
emulated=no binary=$program
if [ "${program##*/emulated/}" != "$program" ]; then
    emulated=yes binary=$(sed -n "s/.*'\(.*\)'.*/\1/p" "$program")
fi
# sdmgen ARGUMENT...: runs the program. One that does not end is killed before the time of the whole test is over: so the test tells which.
limit_of_command=600 limit_of_await=120
[ $emulated = no ] || limit_of_command=14400 limit_of_await=3600 # emulators are slow
sdmgen() { timeout --foreground --signal=KILL $limit_of_command "$program" "$@"; }
# sdmgen_without PATTERN ARGUMENT...: runs sdmgen without the lines of its stderr that match PATTERN.
sdmgen_without() {
    local pattern=$1 code
    shift
    "$program" "$@" 2>raw
    code=$?
    grep -Ev -- "$pattern" raw >&2
    return $code
}

bad() {
    failures=$((failures + 1))
    echo "FAILED: $*" >&2
}

# expect CODE PATTERN COMMAND...: runs COMMAND, whose exit code must be CODE. If PATTERN is -, stderr must be empty, else exactly one line
# that matches PATTERN. Leaves stdout in the file `out` and stderr in `err`. In a test that sets coarse_grids=yes, whose grids are too
# coarse for a part on purpose, the warning of this counts only where PATTERN names it. Lines of progress, which a busy machine brings,
# do not count.
expect() {
    local code=$1 pattern=$2 got
    shift 2
    "$@" >out 2>err
    got=$?
    [[ $pattern = *%* ]] || sed -i -E '/^sdmgen: [^:]* [0-9]+ %  /d' err
    [[ $coarse_grids = no || $pattern = *"too thin"* ]] || sed -i '/ mm thick, too thin for voxels of /d' err
    [ "$got" -eq "$code" ] || bad "exit code $got instead of $code: $* ($(cat err))"
    if [ "$pattern" = - ]; then
        [ ! -s err ] || bad "unexpected text on stderr: $*: $(cat err)"
    else
        [ "$(wc -l <err)" -eq 1 ] || bad "not one line on stderr: $*: $(cat err)"
        grep -Eq -- "$pattern" err || bad "stderr of $* does not match '$pattern': $(cat err)"
    fi
}

# await PID COMMAND...: waits until COMMAND succeeds. Fails if the process PID ends before, or after two minutes (an hour in an emulator); then
# the process is killed.
await() {
    local pid=$1 end=$((SECONDS + limit_of_await))
    shift
    until "$@" 2>/dev/null; do
        if ! kill -0 "$pid" 2>/dev/null || [ $SECONDS -gt $end ]; then
            "$@" 2>/dev/null && break # it came true since
            kill -KILL "$pid" 2>/dev/null
            bad "never true: $*"
            return 1
        fi
        sleep 0.02
    done
}

# stopped_at PATTERN ARGUMENT...: runs sdmgen and sends SIGTERM when its stderr (file `err`) matches PATTERN; the exit code must be 130.
stopped_at() {
    local pattern=$1 pid code
    shift
    : >err # empty it now: the job may start late, and grep would find the text of the previous command
    "$program" "$@" >out 2>err &
    pid=$!
    await $pid grep -Eq -- "$pattern" err
    kill -TERM $pid 2>/dev/null
    wait $pid
    code=$?
    [ $code -eq 130 ] || bad "exit code $code when stopped: $* ($(cat err))"
}

# has PATTERN: fails unless a line of `out` matches.
has() { grep -Eq -- "$1" out || bad "no '$1' in: $(head -c 600 out)"; }

# json KEY: prints the value (number, string or bool) of KEY in the one-line JSON object in `out`.
json() { sed -n "s/.*\"$1\": *\\(\"[^\"]*\"\\|[^,}]*\\).*/\\1/p" out | head -n 1 | tr -d '"'; }

# near A B TOLERANCE: fails unless abs(A - B) <= TOLERANCE.
near() { awk -v a="$1" -v b="$2" -v t="$3" 'BEGIN { exit !(a != "" && a - b <= t && b - a <= t) }' || bad "$1 is not $2 +- $3"; }

# absent PATH...: fails if a path exists.
absent() {
    local path
    for path in "$@"; do [ ! -e "$path" ] || bad "$path should not be there"; done
}

# present PATH...: fails if a file is missing or empty.
present() {
    local path
    for path in "$@"; do [ -s "$path" ] || bad "$path is missing or empty"; done
}

# Fails if temporary files of unfinished outputs are left in this folder.
no_leftovers() {
    local left
    left=$(find . -maxdepth 2 -type f \( -name '*tmp*' -o -name '.*.part*' \))
    [ -z "$left" ] || bad "left over: $left"
}

# The last command of each test: exits with 1 after any failure.
finish() {
    no_leftovers
    if [ "$failures" -gt 0 ]; then
        echo "$failures failures" >&2
        exit 1
    fi
}
