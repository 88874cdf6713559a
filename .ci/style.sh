#!/usr/bin/env bash
# Format and a short list of mistakes: clang-format and clang-tidy of Debian 12 (version 14) over every C and C++ file. Prints what is wrong and exits with 1.
#   .ci/style.sh          checks
#   .ci/style.sh --fix    formats the files first
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

format=$(command -v clang-format-14 || command -v clang-format)
tidy=$(command -v clang-tidy-14 || command -v clang-tidy)
mapfile -t files < <(git ls-files '*.c' '*.h' '*.cc' '*.inc')
# two need oneDNN or MPI, which are off by default
mapfile -t sources < <(git ls-files framework shapes runtime trainer cli | grep '\.c$' | grep -Fv -e conv_kernels_dnnl.c -e mpi_module.c)

if [ "${1:-}" = --fix ]; then "$format" -i "${files[@]}"; fi
wrong=0
"$format" --dry-run -Werror "${files[@]}" || wrong=1
long=$(awk 'length > 100 { print FILENAME ":" FNR ": over 100 columns" }' "${files[@]}")
if [ -n "$long" ]; then
    echo "$long" >&2
    wrong=1
fi
. .ci/setup.sh
configure release -DSDM_TESTS=ON -DSDM_BENCH=ON

printf '%s\0' "${sources[@]}" | xargs -0 -P "$(nproc)" -n 16 "$tidy" -p build/release --quiet 2>/dev/null || wrong=1
[ $wrong = 0 ] || {
    echo "style: see above; .ci/style.sh --fix formats" >&2
    exit 1
}
echo "style: ${#files[@]} files formatted, ${#sources[@]} sources without a warning"
