#!/usr/bin/env bash
# search.sh BUILD SECONDS [NAME...]: lets the fuzz targets in BUILD (preset "fuzz"; all but h5, or fuzz_NAME...) look for inputs that break a
# promise, SECONDS each, from their corpora. One line each: inputs tried, inputs kept, what was found. The inputs are kept in BUILD/found;
# exit code 1: something was found.
set -uo pipefail
build=$(cd "$1" && pwd)
seconds=$2
shift 2
source=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
# not h5: faults of libhdf5 itself would end the search; the program reads such files in a child process
[ $# -gt 0 ] || set -- $(cd "$build/tests/fuzz" && find . -maxdepth 1 -name 'fuzz_*' -type f -perm -u+x | sed 's/.*fuzz_//' | grep -vx h5 | sort)
TMPDIR=$(mktemp -d "$([ -w /dev/shm ] && echo /dev/shm || echo /tmp)/fuzz.XXXXXX")
export TMPDIR
trap 'rm -rf "$TMPDIR"' EXIT

failed=0
for name in "$@"; do
    found=$build/found/$name
    mkdir -p "$found/corpus"
    folders=("$found/corpus" $(ls -d "$source/corpus/$name" 2>/dev/null))
    limits=(-max_len=8192)
    case $name in
    model) limits=(-max_len=110000) && folders+=("$source/../golden") ;;
    checkpoint | h5) limits=(-max_len=40000) ;;
    esac
    # libhdf5 asks for any number of bytes that a file states, and forgets blocks after an error
    if [ "$name" = h5 ]; then
        export ASAN_OPTIONS=allocator_may_return_null=1:detect_leaks=0
        limits+=(-malloc_limit_mb=100000000)
    fi
    (cd "$found" && "$build/tests/fuzz/fuzz_$name" "${limits[@]}" -rss_limit_mb=2500 -timeout=20 -max_total_time="$seconds" -print_final_stats=1 "${folders[@]}") \
        >"$found/log" 2>&1
    code=$?
    unset ASAN_OPTIONS
    printf '%-12s %10d tried %6d kept%s\n' "$name" "$(sed -n 's/.*number_of_executed_units: *//p' "$found/log")" \
        "$(find "$found/corpus" -type f | wc -l)" "$([ $code = 0 ] || echo "  FAILED: $(grep -hE '^SUMMARY|ERROR: ' "$found/log" | tail -n 1)")"
    [ $code = 0 ] || failed=1
done
exit $failed
