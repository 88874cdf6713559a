#!/usr/bin/env bash
# sdmgen export: messages; shapes as binary glTF, read by glb_tool.py and, if it is there, by the npm package gltf-validator in
# SDM_NODE_MODULES (the folder that holds node_modules).
# Tests: cmd_export.c glb.c shape_targets.c
. "$(dirname "$0")/common.sh"
command -v python3 >/dev/null || { echo "python3 is missing"; exit 77; }
tool=$source_folder/tests/cli/glb_tool.py
model=$source_folder/configs/statistical
statistical="--shape statistical -O mean=$model/mean.ply -O modes=$model/modes.npy -O deviations=$model/deviations.npy"

expect 2 "^sdmgen: error: export: either a MODEL \(-o FILE.onnx\) or --shape NAME \(-o FILE.glb\) is needed" sdmgen export -o x.onnx
expect 2 "export: an output is needed: -o FILE.glb" sdmgen export --shape torus
expect 2 "export: 'x.stl': a shape is written as \*.glb" sdmgen export --shape torus -o x.stl
expect 2 "export: 'x.glb': a model is written as \*.onnx" sdmgen export model.sdm -o x.glb
expect 2 "export: -p and -O need --shape" sdmgen export model.sdm -p a=1 -o x.onnx
expect 1 "none.sdm" sdmgen export none.sdm -o x.onnx
expect 5 "'radius' = 99 mm" sdmgen export --shape capsule -p radius=99 -o x.glb
absent x.onnx x.glb x.stl

# shapes that are linear in their parameters: the targets give the mesh at any parameters
# shellcheck disable=SC2086 # several words
{
    expect 0 - sdmgen export $statistical -p m2=1.5 -p m7=-2 -o s.glb
    expect 0 - sdmgen mesh $statistical -p m2=1.5 -p m7=-2 -o s.ply
    expect 0 - sdmgen mesh $statistical -p m1=-3 -p m8=2 -o t.ply
}
expect 0 - python3 "$tool" s.glb 8 s.ply
has '"targetNames": \["m1", "m2", .*"m8"\]'
has '"name": "m2", "unit": "sd", "value": 1.5, "default": 0, "at": 1, "weight_min": -3, "weight_max": 3'
expect 0 - python3 "$tool" s.glb 8 t.ply -3 0 0 0 0 0 0 2
expect 0 - sdmgen export --shape ellipsoid -p rx=3 -o e.glb
expect 0 - sdmgen mesh --shape ellipsoid -p rx=3 -o e.ply
expect 0 - python3 "$tool" e.glb 3 e.ply

# other shapes: the mesh at its parameters
expect 0 'c.glb: the vertices are no linear functions of the parameters: the mesh alone' sdmgen export --shape cochlea -p a=3 -o c.glb
expect 0 - sdmgen mesh --shape cochlea -p a=3 -o c.ply
expect 0 - python3 "$tool" c.glb 0 c.ply

if [ -n "${SDM_NODE_MODULES:-}" ] && [ -d "$SDM_NODE_MODULES/node_modules/gltf-validator" ]; then
    for file in s.glb e.glb c.glb; do
        node -e '
            const require2 = require("node:module").createRequire(process.argv[1] + "/x.js");
            const bytes = new Uint8Array(require("node:fs").readFileSync(process.argv[2]));
            require2("gltf-validator").validateBytes(bytes).then((report) => {
                console.log(JSON.stringify(report.issues));
                process.exit(report.issues.numErrors + report.issues.numWarnings ? 1 : 0);
            });' "$SDM_NODE_MODULES" $file || bad "$file: gltf-validator"
    done
fi
finish
