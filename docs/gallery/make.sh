#!/usr/bin/env bash
# Makes the gallery: trains the networks of four configurations and writes a page of each, and an index. Finished models are kept, so the
# command can be run again.
#   docs/gallery/make.sh [--fast] [FOLDER]
# FOLDER: where pages and runs go (build/gallery). --fast: tiny networks, in seconds: for tests, their errors are large.
# SDMGEN: the program (build/release/cli/sdmgen). Ten minutes on two cores without --fast.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
sdmgen=${SDMGEN:-$root/build/release/cli/sdmgen}
bytes_max=12000000
small=()
if [ "${1-}" = --fast ]; then
    small=(network='{kind: pod, depth: 1, width: 16, rank: 8, modes: 16, degree: 2, input_degree: 2}'
        data='{static: 2, start: 24, online: 16, holdout: 4}' train='{steps: 20, batch: 8}')
    shift
fi
folder=${1:-$root/build/gallery}
if [ $# -gt 1 ] || [[ $folder == -* ]]; then
    echo 'usage: make.sh [--fast] [FOLDER]' >&2
    exit 2
fi
if [ ! -x "$sdmgen" ]; then
    echo "no program $sdmgen: build it (./run), or name it by the variable SDMGEN" >&2
    exit 1
fi
mkdir -p "$folder"
cd "$folder"

# page NAME CONFIGURATION SIZE SPACING OPTION...: trains the network and writes NAME.html; SIZE and SPACING: the grid of --fast.
page() {
    local name=$1 config=$2 grid=()
    if [ ${#small[@]} -gt 0 ]; then grid=("${small[@]}" "grid.size=$3" "grid.spacing=$4"); fi
    shift 4
    if [ ! -f "runs/$name/model.sdm" ]; then "$sdmgen" train "$config" "${grid[@]}" "$@" --out "runs/$name" --quiet; fi
    "$sdmgen" report "runs/$name" "$@" -o "$name.html"
    if [ "$(wc -c <"$name.html")" -gt $bytes_max ]; then
        echo "$name.html has more than $bytes_max bytes" >&2
        exit 1
    fi
    echo "$folder/$name.html"
}

# card NAME TEXT: the entry of the index.
card() {
    local error
    error=$(sed -n 's/.*"accuracy": {[^}]*"rmse_mm": *\([0-9.e-]*\).*/\1/p' "$1.html" | head -n 1)
    printf '<li><a href="%s.html"><b>%s</b><span>%s</span><small>error %s mm, %s MB</small></a></li>\n' "$1" "$1" "$2" \
        "$(awk -v e="$error" 'BEGIN { printf "%.2g", e }')" "$(awk -v n="$(wc -c <"$1.html")" 'BEGIN { printf "%.1f", n / 1e6 }')"
}

"${CC:-cc}" -O2 -shared -fPIC -I"$root/framework/include" "$root/examples/gear/gear.c" -lm -o gear.so
page cochlea "$root/configs/cochlea.yaml" '[20, 17, 17]' 0.6
page linkage "$root/configs/linkage.yaml" '[15, 21, 17]' 0.72
page statistical "$root/configs/statistical.yaml" '[13, 10, 10]' 1
page gear "$root/examples/gear/gear.yaml" '[17, 17, 8]' 0.65 --plugin "$PWD/gear.so"

{
    cat "$root/docs/gallery/index-head.html"
    card cochlea 'The human cochlea: a tube that winds around and overlaps itself.'
    card linkage 'A mechanism: an arm of rigid links with joints that turn.'
    card statistical 'A statistical shape model: a mean and its modes, from files.'
    card gear 'A gear wheel with sharp teeth, from a plug-in.'
    echo '</ul></body></html>'
} >index.html.part
mv index.html.part index.html
echo "$folder/index.html"
