# shellcheck shell=bash disable=SC2016,SC2034
# Shared by the tests of the command line (sourced): run a command, demand its exact exit code and its one line of error.
set -u
program=$1
source_folder=$2 # absolute, like program
work=files-of-$(basename "$0" .sh)
rm -rf "$work" && mkdir "$work" && cd "$work" || exit 1
failures=0
unset SDMGEN_PLUGIN_PATH
export LC_ALL=C

sdmgen() { "$program" "$@"; }

bad() {
    failures=$((failures + 1))
    echo "FAILED: $*" >&2
}

# expect CODE PATTERN command...: the exit code is CODE; stderr is empty when PATTERN is -, else it is exactly one line that
# matches PATTERN. stdout is left in the file `out`, stderr in `err`.
expect() {
    local code=$1 pattern=$2 got
    shift 2
    "$@" >out 2>err
    got=$?
    [ "$got" -eq "$code" ] || bad "exit code $got instead of $code: $* ($(cat err))"
    if [ "$pattern" = - ]; then
        [ ! -s err ] || bad "unexpected text on stderr: $*: $(cat err)"
    else
        [ "$(wc -l <err)" -eq 1 ] || bad "not one line on stderr: $*: $(cat err)"
        grep -Eq -- "$pattern" err || bad "stderr of $* does not match '$pattern': $(cat err)"
    fi
}

# stopped_at PATTERN ARGUMENT...: sdmgen gets SIGTERM when its stderr, left in `err`, has the pattern; its exit code is 130.
stopped_at() {
    local pattern=$1 pid code
    shift
    : >err # the job opens it too, but perhaps after the first look, which would find the text of the command before
    "$program" "$@" >out 2>err &
    pid=$!
    for _ in $(seq 300); do grep -Eq -- "$pattern" err && break || sleep 0.2; done
    kill -TERM $pid
    wait $pid
    code=$?
    [ $code -eq 130 ] || bad "exit code $code when stopped: $* ($(cat err))"
}

# has PATTERN: the stdout of the last expect has a line that matches.
has() { grep -Eq -- "$1" out || bad "no '$1' in: $(head -c 600 out)"; }

# json KEY: its number, text or bool in the one-line object of the last expect.
json() { sed -n "s/.*\"$1\": *\\(\"[^\"]*\"\\|[^,}]*\\).*/\\1/p" out | head -n 1 | tr -d '"'; }

# near A B TOLERANCE
near() { awk -v a="$1" -v b="$2" -v t="$3" 'BEGIN { exit !(a != "" && a - b <= t && b - a <= t) }' || bad "$1 is not $2 +- $3"; }

absent() {
    local path
    for path in "$@"; do [ ! -e "$path" ] || bad "$path should not be there"; done
}

present() {
    local path
    for path in "$@"; do [ -s "$path" ] || bad "$path is missing or empty"; done
}

# no file of this folder is a left-over of an unfinished output
no_leftovers() {
    local left
    left=$(find . -maxdepth 2 -type f \( -name '*tmp*' -o -name '.*.part*' \))
    [ -z "$left" ] || bad "left over: $left"
}

finish() {
    no_leftovers
    if [ "$failures" -gt 0 ]; then
        echo "$failures failures" >&2
        exit 1
    fi
}
