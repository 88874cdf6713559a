#!/usr/bin/env bash
# sdmgen experiment with fits: every method on the same phantoms, the tables in all formats, a model from another run, mistakes.
# Tests: experiment_fit.c experiment_fit_table.c experiment_phantom.c
. "$(dirname "$0")/common.sh"
export OMP_WAIT_POLICY=passive

# fits FILE PHANTOMS PRIOR: writes an experiment that fits an ellipsoid in images of 8 mm.
fits() {
    cat >"$1" <<END
experiment: {title: fits, baseline: naive, reference: paper}
fit: {phantoms: $2, off_mm: 0.5, off_deg: 10, voxel: 0.5, range: 0.6, prior_sd: $3}
shape: {name: ellipsoid, options: {edge: 0.6}, ranges: {rx: [3.4, 4.2], ry: [2.4, 3], rz: [1.5, 2]}}
grid: {size: [26, 22, 18], spacing: 0.45}
network: {depth: 1, width: 16}
data: {static: 2, online: 32, start: 64, holdout: 4}
train: {steps: 20, batch: 16}
methods:
  - {name: network, network: pod, fit: network, set: {network: {rank: 8, modes: 16, degree: 2, input_degree: 2}, train.refine_batch: 8}}
  - {name: polished, fit: polish}
  - {name: exact, fit: exact}
  - {name: naive, fit: naive}
reference:
  - {row: network, fit_s: 3902.1, difference: {rx: 2e-8, rz: 1e-9}, source: "somebody, table 2"}
END
}

# cell FILE ROW PARAMETER COLUMN: a value of a CSV table whose texts have no comma. PARAMETER is - for tables without such a column.
cell() {
    awk -F, -v row="\"$2\"" -v param="$3" -v name="$4" 'NR == 1 { for (i = 1; i <= NF; i++) if ($i == name) c = i }
        $1 == row && (param == "-" || $2 == param) { print $c }' "$1"
}
holds() { awk "BEGIN { exit !($*) }" || bad "not so: $*"; }
# same COMPUTED CELL: a cell has six digits.
same() { holds "$1 > 0 && ($1 - $2) ^ 2 <= (1e-5 * $1) ^ 2"; }

fits tiny.yaml 2 0
expect 0 - sdmgen experiment tiny.yaml --dry-run --out never
has '^network +pod .*train, fit +20 steps +phantoms 2 '
has '^polished +pod .* fit +phantoms 2 '
has '^naive +naive .* time a map '
absent never

expect 0 - sdmgen experiment tiny.yaml --out run --quiet --threads 1
cmp -s out run/table.md || bad 'stdout is not table.md'
present run/table.csv run/table.json run/parameters.csv run/network/model.sdm run/network/fits.csv run/polished/fits.csv run/exact/fits.csv
absent run/polished/model.sdm run/naive run/network/slices.png
grep -q 'slices.png' run/table.md && bad 'table.md shows pictures that are not there'
t=run/table.csv p=run/parameters.csv

# All fits converge; which engine makes the maps; mean times are those of the fits.
for row in network polished exact; do
    [ "$(cell $t $row - fits)" = 2 ] && [ "$(cell $t $row - shapes)" = 2 ] || bad "$row: fits $(cell $t $row - fits)"
    holds "$(cell $t $row - dice) > 0.94 && $(cell $t $row - fit_s) > 0 && $(cell $t $row - speedup) > 1"
    same "$(awk -F, 'NR > 1 { s += $3 } END { printf "%.9g", s / 2 }' run/$row/fits.csv)" "$(cell $t $row - fit_s)"
done
holds "$(cell $t network - maps_network) > 3 && $(cell $t network - maps_exact) == 0"
# a fit with the network has rivals by the network, a polished one has exact rivals
holds "$(cell $t polished - maps_network) > 3 && $(cell $t polished - maps_network) <= $(cell $t network - maps_network)"
holds "$(cell $t polished - maps_exact) > 0"
holds "$(cell $t exact - maps_network) == 0 && $(cell $t exact - maps_exact) > 3"

# The exact engine reaches the same estimate as the polished network, the network alone one nearby, and all are close to the truth.
for name in rx ry rz; do
    polished=$(cell $p polished $name difference) network=$(cell $p network $name difference) error=$(cell $p exact $name error)
    holds "\"$polished\" != \"\" && $polished < 1e-4 && $network > 10 * $polished && $network < $error"
    holds "$error > 0 && $error < 0.15 && $(cell $p exact $name sd) > 0"
    [ -z "$(cell $p exact $name difference)" ] || bad 'the exact fit differs from itself'
    # Mean error and share within 3 sd, computed again from the fits.
    read -r mean within < <(awk -F, -v name=$name 'NR == 1 { for (i = 1; i <= NF; i++) if ($i == name) c = i; next }
        { d = $c - $(c - 1); if (d < 0) d = -d; sum += d; n++; in3 += d <= 3 * $(c + 1) } END { print sum / n, in3 / n }' run/network/fits.csv)
    near "$(cell $p network $name error)" "$mean" 1e-6
    near "$(cell $p network $name within_3sd)" "$within" 1e-9
done
# True parameters from the middle of the ranges, the same for all methods.
for row in polished exact; do
    [ "$(cut -d, -f1,7,11,15 run/$row/fits.csv)" = "$(cut -d, -f1,7,11,15 run/network/fits.csv)" ] || bad "$row has other phantoms"
done
awk -F, 'NR > 1 && ($7 < 3.56 || $7 > 4.04 || $11 < 2.52 || $11 > 2.88) { exit 1 }' run/exact/fits.csv || bad 'a truth outside of range: 0.6'

# The time of the naive method is computed: its time per map times the number of maps of the exact fits. The speed-up refers to it.
same "$(cell $t naive - fit_s)" "$(awk -v a="$(cell $t naive - ms)" -v b="$(cell $t exact - maps_exact)" 'BEGIN { printf "%.9g", a * b / 1000 }')"
near "$(cell $t exact - speedup)" "$(awk -v a="$(cell $t naive - fit_s)" -v b="$(cell $t exact - fit_s)" 'BEGIN { print a / b }')" 0.01
grep -q "naive: done: not run: the .* maps of a fit of 'exact'" run/table.md || bad 'not said that naive was not run'

# The formats agree; published values appear next to the measured ones.
grep -q '^| polished | rz | mm |' run/table.md || bad 'no table of parameters'
grep -q "\"name\": *\"rx\", *\"unit\": *\"mm\", *\"difference\": *$(cell $p network rx difference), *\"reference_difference\": *2e-08," run/table.json ||
    bad 'JSON and parameters.csv differ'
[ "$(cell $p network rx reference_difference)" = 2e-08 ] && [ -z "$(cell $p network ry reference_difference)" ] || bad 'differences of others'
[ "$(cell $t network - reference_fit_s)" = 3902.1 ] || bad 'fit_s of others'
if command -v python3 >/dev/null; then python3 -m json.tool run/table.json >/dev/null || bad 'table.json is not JSON'; fi

# Again with other threads: the network is loaded, and everything but the times is the same.
numbers() { cut -d, -f1,2,4- "$1"; }
if ! is_brief; then
    expect 0 - sdmgen experiment tiny.yaml --out run2 --quiet --threads 2 fit.model=run/network/model.sdm
    for row in network polished exact; do
        [ "$(numbers run/$row/fits.csv)" = "$(numbers run2/$row/fits.csv)" ] || bad "$row: other results from the same model"
    done
    cmp -s $p run2/parameters.csv || bad 'parameters.csv differs'
    absent run2/network/model.sdm
fi
expect 0 - sdmgen experiment tiny.yaml --dry-run fit.model=run/network/model.sdm
has '^network +pod .*load, fit +phantoms 2 '

# Another configuration that exceeds the budget: the network is not trained, and `polish` must not use the previous network.
sdmgen experiment tiny.yaml network.width=8 train.minutes=3 experiment.minutes=2 fit.phantoms=1 --out run >out 2>err
[ $? -eq 4 ] || bad "over the budget: exit code"
grep -q '^| network (failed) |' run/table.md || bad 'trained over the budget'
grep -q "polished: failed: the network of 'network', which it uses, is not available" run/table.md || bad "polished by another network: $(cat run/table.md)"
! grep -q 'is replaced' err || bad 'said to be replaced, but not trained'

# A start far from the truth: failed fits are counted and reported, not averaged.
expect 0 - sdmgen experiment tiny.yaml --out far --quiet fit.off_mm=9 fit.phantoms=1 fit.model=run/network/model.sdm
[ "$(cell far/table.csv exact - fits)" = 0 ] && [ -z "$(cell far/parameters.csv exact rx error)" ] || bad 'a failed fit was averaged'
grep -q 'exact: done: .*the first failure: ' far/table.md || bad 'no reason of a failed fit'

# Models of another shape or range are refused.
sed 's/rx: \[3.4, 4.2\]/rx: [3.3, 4.2]/' tiny.yaml >wider.yaml
sdmgen experiment wider.yaml --out wider --quiet fit.phantoms=1 fit.model=run/network/model.sdm >out 2>err
[ $? -eq 2 ] || bad 'a model of a smaller range: exit code'
grep -q 'model.sdm was trained on rx = 3.4 .. 4.2, the experiment needs rx = 3.3 .. 4.2' wider/table.md || bad 'no reason: smaller range'
grep -q '^| exact |' wider/table.md || bad 'the rows behind were not done'

# A start beside the torus: the fit ends in the texture of the bone, with a point spread so wide that hardly any pairs of voxels tell the
# correlation of the noise. Such voxels are not taken for independent, which gave this fit an evidence of 114.
cat >beside.yaml <<'END'
experiment: {title: beside, seed: 7, pictures: no}
fit: {phantoms: 1, off_mm: 0.5, off_deg: 10, voxel: 0.3, range: 0.6, eps: 1e-4}
grid: {spacing: 0.3}
methods:
  - {name: torus beside, fit: exact, wrong: moved, set: {shape.name: torus}}
END
if ! is_brief; then
    expect 0 - sdmgen experiment beside.yaml --out beside --quiet
    [ "$(cell beside/table.csv 'torus beside' - fits)" = 0 ] || bad 'a fit to texture was accepted'
fi

# Mistakes are found before any work.
wrong() { sed "$1" tiny.yaml >wrong.yaml; expect 2 "$2" sdmgen experiment wrong.yaml --out wrong; }
wrong '/name: network/d;/^reference:/,$d' "wrong.yaml:9:5: method 'polished' with fit: polish needs one with fit: network before it"
wrong 's/fit: exact/fit: exakt/' "wrong.yaml:11:24: fit: 'exakt' is not one of none, network, polish, exact, naive; did you mean 'exact'"
wrong 's/fit: naive/engine: naive, fit: naive/' "wrong.yaml:12:5: method 'naive' with this fit needs none of the keys network and engine"
wrong 's/network: pod, fit/fit/' "wrong.yaml:9:5: method 'network' with fit: network needs the key network"
wrong 's/fit: polish/fit: polish, set: {train.steps: 3}/' "wrong.yaml:10:5: method 'polished' with fit: polish takes the network before it"
wrong 's/phantoms: 2/phantoms: 0/' 'wrong.yaml:2:.*fit.phantoms: 0 is out of range'
expect 2 'fit.model: one model for 0 methods' sdmgen experiment "$source_folder/configs/grids.yaml" fit.model=x.sdm --dry-run
absent wrong
sed 's/{rx: 2e-8/{rq: 2e-8/' tiny.yaml >unknown.yaml
expect 2 "^unknown.yaml:14:5: reference: difference: the shape has no parameter 'rq'" sdmgen experiment unknown.yaml --out unknown
absent unknown
finish
