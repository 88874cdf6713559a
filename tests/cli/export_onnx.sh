#!/usr/bin/env bash
# sdmgen export: networks as ONNX. onnx_tool.py reads the files without the package onnx and evaluates pod with numpy; the package onnx
# (python3-onnx) checks them and onnxruntime-web (npm, in SDM_NODE_MODULES, the folder that holds node_modules) evaluates all kinds, where
# they are installed. The maps are those of sdmgen generate.
# Tests: cmd_export.c model_onnx.c onnx_file.c onnx_graph.c onnx_ops.c pod_onnx.c point_onnx.c protobuf.c sdmnn_onnx.c template_onnx.c
# template_onnx_blocks.c template_onnx_lookup.c template_onnx_warp.c
. "$(dirname "$0")/common.sh"
coarse_grids=yes
tool=$source_folder/tests/cli/onnx_tool.py
python=
for p in python3 /usr/bin/python3; do $p -c 'import numpy' 2>/dev/null && python=$p && break; done
[ -n "$python" ] || { echo "python3 with numpy is missing"; exit 77; }
run_web() { node "$source_folder/tests/cli/onnx_run.mjs" "$1" "$2" "$3"; }
web= checker=
[ -n "${SDM_NODE_MODULES:-}" ] && [ -d "$SDM_NODE_MODULES/node_modules/onnxruntime-web" ] && web=yes
$python -c 'import onnx' 2>/dev/null && checker=yes

generate_without_warnings() { sdmgen generate "$@" 2>warnings; }
# compare NAME BATCH LIMIT: the maps of NAME.onnx at BATCH parameter vectors against those of generate; LIMIT in mm
compare() {
    local name=$1 limit=$3
    rm -f m*.npy
    expect 0 - "$python" "$tool" params "$name.onnx" "$2" p.csv
    # networks of a few steps are poor, and generate warns
    expect 0 - generate_without_warnings "$name/model.sdm" --params p.csv -o m%04d.npy
    if [[ $name = pod* ]]; then
        expect 0 - "$python" "$tool" run "$name.onnx" p.csv a.f32
        expect 0 - "$python" "$tool" compare a.f32 "$limit" m*.npy
    fi
    [ -z "$web" ] || { expect 0 - run_web "$name.onnx" p.csv b.f32 && expect 0 - "$python" "$tool" compare b.f32 "$limit" m*.npy; }
}

# pod: with bytes, halves and floats, one or several levels, blocks that the grid cuts, with and without MLP; the others on a grid whose
# sizes are odd on lower levels
train() { expect 0 - sdmgen train "$source_folder/tests/cli/tiny.yaml" --json --quiet --out "$@"; }
train pod network.levels=3
train pod_half network.weights=f16 network.activation=tanh
train pod_float network.weights=f32 network.depth=0 network.levels=1 network.block=5
small="network.depth=2 network.width=16"
# shellcheck disable=SC2086 # several words
{
    train sdmnn network.kind=sdmnn $small network.channels=3
    train sdmnn_one network.kind=sdmnn $small network.channels=1 network.block=3 network.activation=tanh
    train deepsdf network.kind=deepsdf $small
    train imnet network.kind=imnet $small network.weights=f32
}
# template: affine with a correction, rigid parts that depend on each other, a warp; blocks that are interpolated and others
template="network.kind=template train.steps=4 data.start=24 data.online=0 data.holdout=2"
statistical=$source_folder/configs/statistical
# shellcheck disable=SC2086 # several words
{
    train affine shape.name=ellipsoid $template grid.spacing=1
    train rigid shape.name=linkage shape.options.motion=spatial $template "grid.size=[18,26,21]" grid.spacing=0.75 "grid.centre=[4.27,0,0]"
    train warp shape.name=statistical shape.options.mean="$statistical/mean.ply" shape.options.modes="$statistical/modes.npy" \
        shape.options.count=4 $template network.modes=8 data.static=0 "grid.size=[26,22,21]" grid.spacing=0.5
}
for name in pod pod_half pod_float sdmnn sdmnn_one deepsdf imnet affine rigid warp; do
    expect 0 - sdmgen export $name/model.sdm -o $name.onnx
    present $name.onnx
    case $name in affine) size="3 12 14 16" ;; rigid) size="3 21 26 18" ;; warp) size="4 21 22 26" ;; *) size="4 12 14 16" ;; esac
    if [ -n "$checker" ]; then
        expect 0 - "$python" -c '
import onnx, sys
m = onnx.load(sys.argv[1])
onnx.checker.check_model(m, full_check=True)
onnx.shape_inference.infer_shapes(m, strict_mode=True)
dims = [[d.dim_param or d.dim_value for d in v.type.tensor_type.shape.dim] for v in (m.graph.input[0], m.graph.output[0])]
size = [int(n) for n in sys.argv[2].split()]
assert dims == [["N", size[0]], ["N", *size[1:]]], dims' $name.onnx "$size"
    fi
    case $name in pod) limit=3e-4 ;; affine | rigid | warp) limit=5e-4 ;; *) limit=1e-5 ;; esac
    [[ $name != pod* ]] || compare $name 1 $limit
    compare $name 5 $limit
done

# a fine level is no part of the file, which a notice tells
expect 0 'pod_fine.sdm: ONNX holds the map on the grid of the model; its fine level is left out' \
    sdmgen export "$source_folder/tests/golden/pod_fine.sdm" -o fine.onnx

# the same bytes each time
for name in pod warp; do
    expect 0 - sdmgen export $name/model.sdm -o again.onnx
    cmp -s $name.onnx again.onnx || bad "a second export of $name gives other bytes"
done
echo "checked by: numpy${checker:+, onnx}${web:+, onnxruntime-web}"
finish
