#!/usr/bin/env bash
# sdmgen shapes and sdmgen mesh: lists, meshes for given parameters, mistakes, files that are no plug-ins.
# Tests: cmd_mesh.c cmd_shapes.c report_audit.c setup.c
. "$(dirname "$0")/common.sh"

expect 0 - sdmgen shapes
for shape in cochlea duct ellipsoid torus linkage statistical; do has "^$shape "; done
expect 0 - sdmgen shapes --json
has '"name": "cochlea".*"name": "alpha", "unit": "mm", "min": 0, "max": 1\.2'
expect 0 - sdmgen shapes cochlea
for name in a alpha b phi; do has "^  $name +(mm|rad)? +-?[0-9]"; done
has 'their options are the defaults$' # long texts are not cut
has '^its parameters depend on its options'
expect 0 - sdmgen shapes cochlea --json
has '"options": \['
expect 0 - sdmgen shapes torus --json
has '"default": 3, "distribution": "uniform", "help"'
model=(-O "mean=$source_folder/configs/statistical/mean.ply" -O "modes=$source_folder/configs/statistical/modes.npy")
expect 0 - sdmgen shapes statistical "${model[@]}"
has '^  m8 +sd +-3 \.\. 3, normal, mean 0, deviation 1 +0 +weight of mode 8'
expect 0 - sdmgen shapes statistical "${model[@]}" --json
has '"name": "m8".*"default": 0, "distribution": "normal", "mean": 0, "deviation": 1, "help"'
expect 0 - sdmgen shapes statistical
expect 2 "unknown shape 'cochlae'; did you mean 'cochlea'\?" sdmgen shapes cochlae
expect 2 "unknown shape 'cube'; .* --plugin FILE" sdmgen shapes cube
expect 2 'O needs the NAME' sdmgen shapes -O a=1

expect 0 - sdmgen mesh --shape torus -o t.ply -o t.stl -o t.obj -o t.off --audit
has '^closed +yes'
has '^self-intersections +0$'
present t.ply t.stl t.obj t.off
expect 0 - sdmgen mesh --shape torus --json
triangles=$(json triangles)
volume=$(json volume_mm3)
for file in t.ply t.stl t.obj t.off; do
    expect 0 - sdmgen info $file --json
    near "$(json triangles)" "$triangles" 0
    near "$(json volume_mm3)" "$volume" 1e-3
done

# Parameters change the mesh; mistakes are named.
expect 0 - sdmgen mesh --shape cochlea -p a=3 -p phi=-0.2 --json
small=$(json volume_mm3)
expect 0 - sdmgen mesh --shape cochlea -p a=5 -p phi=-0.2 --json
awk -v s="$small" -v l="$(json volume_mm3)" 'BEGIN { exit !(l > s && s > 0) }' || bad 'a larger a must give a larger cochlea'
expect 2 'either --shape NAME or --mesh FILE is needed' sdmgen mesh -o t.ply
expect 2 'an output is needed' sdmgen mesh --shape torus
expect 2 "unknown parameter 'alhpa'; did you mean 'alpha'\?" sdmgen mesh --shape cochlea -p alhpa=1 -o x.ply
expect 2 "parameter a: 'wide' is not a number" sdmgen mesh --shape cochlea -p a=wide -o x.ply
expect 2 "parameter 'a' is given twice" sdmgen mesh --shape cochlea -p a=3 -p a=4 -o x.ply
expect 2 "'a': need name=value" sdmgen mesh --shape cochlea -p a -o x.ply
expect 2 'sdmgen: error: .*' sdmgen mesh --shape cochlea -O nonsense=1 -o x.ply
expect 5 'a.* 9[^0-9].*2.*5' sdmgen mesh --shape cochlea -p a=9 -o x.ply
expect 5 'a.* nan' sdmgen mesh --shape cochlea -p a=nan -o x.ply
expect 5 'a' sdmgen mesh --shape cochlea -p a=1e999 -o x.ply
expect 2 "its name must end in .ply" sdmgen mesh --shape torus -o x.vdb
expect 2 "is given twice" sdmgen mesh --shape torus -o x.ply -o x.ply
expect 1 'nowhere' sdmgen mesh --shape torus -o nowhere/x.ply
absent x.ply x.vdb nowhere

# Files that are no plug-ins.
echo 'not a library' >false.so
expect 3 'false\.so' sdmgen shapes --plugin ./false.so
expect 1 'plug-in \./missing\.so: No such file' sdmgen shapes --plugin ./missing.so
expect 3 'plug-in .*\.c cannot be loaded: .*; a plug-in is a compiled shared object \(\.so\)$' sdmgen shapes --plugin "$source_folder/shapes/capsule.c"

# Folders of plug-ins: a file given twice is one; one that cannot be loaded is skipped unless its shape is asked for.
good=$(realpath ../../plugins/good)
# a plug-in that is cut
head -c 9000 "$good/octahedron.so" >cut.so
expect 3 'plug-in .*/cut\.so is not complete: 9000 of [0-9]+ bytes' sdmgen shapes --plugin ./cut.so
mkdir path && cp "$good/octahedron.so" path/copy.so && cp false.so path/broken.so
export SDMGEN_PLUGIN_PATH=$good:$PWD/path
expect 0 'skipped a file in SDMGEN_PLUGIN_PATH: plug-in .*/broken\.so cannot be loaded: ' sdmgen shapes octahedron --plugin path/copy.so
has '^  radius '
expect 0 - sdmgen shapes octahedron --quiet
expect 2 "unknown shape 'broken'; plug-in .*/path/broken\.so cannot be loaded: " sdmgen shapes broken --quiet
expect 2 "unknown shape 'cube'; sdmgen shapes lists" sdmgen shapes cube --quiet
printf '        ' >>path/copy.so # another file; --plugin comes before the path
SDMGEN_PLUGIN_PATH=$good expect 0 "^sdmgen: shape 'octahedron' is from --plugin, not from .*/octahedron\.so in SDMGEN_PLUGIN_PATH$" sdmgen shapes octahedron --plugin path/copy.so
if grep -q 'another name' err; then bad "advice that nobody needs: $(cat err)"; fi
mkdir twice && cp path/copy.so twice
SDMGEN_PLUGIN_PATH=$good:$PWD/twice expect 0 "skipped a file in SDMGEN_PLUGIN_PATH: .*/copy\.so: shape 'octahedron' is there already \(.*/octahedron\.so\): choose another name" sdmgen shapes octahedron
SDMGEN_PLUGIN_PATH=$PWD/none:$good expect 0 '^sdmgen: warning: SDMGEN_PLUGIN_PATH: plug-in folder .*/none: No such file' sdmgen shapes octahedron
# one folder too high
SDMGEN_PLUGIN_PATH=$(dirname "$good") expect 2 "unknown shape 'octahedron'; SDMGEN_PLUGIN_PATH=.* holds no plug-in: name the folder in which the \.so file lies" sdmgen shapes octahedron
unset SDMGEN_PLUGIN_PATH
expect 2 "no subcommand 'chek'; did you mean 'shapes check'" sdmgen shapes chek
expect 2 "no subcommand 'chek'; did you mean 'shapes check'" sdmgen shapes chek torus
expect 2 '--samples needs' sdmgen shapes torus --samples 5
expect 2 '--seed needs' sdmgen shapes --seed 5
finish
