#!/usr/bin/env bash
# sdmgen shapes check, and what mesh, exact, config and train say about a shape with faults (tests/shape/faulty_shape.h): one line each.
# Tests: repeat_process.c report_survey.c teller.c warn_repeats.c tell_causes.c tell_meshes.c tell_notes.c tell_params.c tell_walls.c report_audit.c part_turns.c grid_hits.c shapes_check.c part_moves.c cmd_mesh.c crash_guard.c callback.c
. "$(dirname "$0")/common.sh"
plugin=$(cd ../../plugins/faulty && pwd)/faulty.so

# A good shape passes; so do the built-in shapes. JSON, picture.
expect 0 - sdmgen shapes check faulty --plugin "$plugin" --samples 16 -o nine.png
has "^fine: the shape can be trained; give a configuration .*; read the table 'moves': does each parameter move the right parts\?\$"
has '^volume +8\.25 \.\. 216\.5 mm\^3, of the union$'
has '^note +overlaps .* in all 21 shapes'
# Corners of the body go from (1, 1, 1) to (3, 3, 3); the handle begins at the body, along x, and ends at the reach.
has '^moves    the longest way of a vertex of each part over the range of a parameter, mm'
has '^         part        1       2$'
has '^         size     3\.46       2$'
has '^         reach       0       1$'
if grep -q 'does mesh() multiply it by 10' out; then bad "a good shape is asked about a factor: $(cat out)"; fi
present nine.png
expect 0 - sdmgen shapes check --plugin "$plugin" --samples 16 --json
has '"shape": "faulty", "verdict": "fine", "shapes": 21, "corners": 4, "samples": 16'
has '"jumps": \[\]'
has '"moves": \[\{"parameter": "size", "parts_mm": \[3\.46410[0-9]*, 2\]\}, \{"parameter": "reach", "parts_mm": \[0, 1\]\}\]'
# A length in cm in one part: the table shows 10 mm over a range of 1 mm, and the line below it asks.
expect 0 - sdmgen shapes check faulty -O fault=tenfold --plugin "$plugin" --samples 16
has '^         reach       0      10$'
has "^note     1 mm of 'reach' moves vertices by 10 mm, as if it were in another unit: does mesh\(\) multiply it by 10\? See part 2\$"
for shape in duct ellipsoid torus capsule linkage; do
    expect 0 - sdmgen shapes check $shape --samples 8
    has '^fine'
done
# Tubes that bend sharply: up to 1.2 % of the surface faces the wrong way.
sdmgen shapes check duct -O section=lobes -O free=section --samples 8 >out 2>err
if grep -q 'passes through itself' out; then bad "a bend is told as a mistake: $(cat out)"; fi

expect 0 - sdmgen shapes check faulty -O fault=apart --plugin "$plugin" --samples 16
has '^note +groups of parts that meet no other part in all 21 shapes, up to 2 at .*: part 2 of 2 \(12 triangles, .*\) lies 0\.5 mm from the others; where they belong together, let them overlap$'

has '^21 of 21 shapes have groups of parts that meet no other part .*: if they are meant to be apart, the shape can be trained; else let them overlap$'
expect 4 "mend what is marked 'warning'" sdmgen shapes check faulty -O fault=within --plugin "$plugin" --samples 16
has "^warning +the parameter 'reach' moves no part of the surface: it moves vertices inside of other parts alone\$"
has '^note +groups of parts that meet no other part .*: part 2 of 2 \(12 triangles, .*\) lies inside part 1 and changes nothing; if it is to be a cavity, reverse'

# Groups of parts: each part meets another one, the groups do not meet. In a training, too.
expect 0 - sdmgen shapes check faulty -O fault=groups --plugin "$plugin" --samples 16
has '^note +groups of parts that meet no other part in all 21 shapes, up to 2 at .*: parts 2 \(vertices 8 \.\. 15, box .* mm\), 3 \(vertices 16 \.\. 23, box .* mm\) of 4 lie 0\.5 mm from the others; where they belong together, let them overlap$'
has '^21 of 21 shapes have groups of parts that meet no other part'

# Parts that meet in some shapes only: a note, with the parameter that decides.
expect 0 - sdmgen shapes check faulty -O fault=meets --plugin "$plugin" --samples 64
has "^note +part 1 of 2 \(12 triangles, .*\) and part 2 of 2 \(.*\) meet in [0-9]+ of 69 shapes and lie apart in the others: 'reach' decides, they meet up to about reach=1\.[56][0-9]*; the surface joins or splits there, where a network errs most"

# Where another part covers them, the surface neither joins nor splits. Parts that stand in another one join above it.
for fault in hidden grows; do
    expect 0 - sdmgen shapes check faulty -O fault=$fault --plugin "$plugin" --samples 64
    has '^fine: '
    if grep -q 'joins or splits' out; then bad "parts that meet inside of another one: $(cat out)"; fi
done
expect 0 - sdmgen shapes check faulty -O fault=posts --plugin "$plugin" --samples 64
has "^note +part 2 of 3 \(.*\) and part 3 of 3 \(.*\) meet in [0-9]+ of 69 shapes and lie apart in the others: 'reach' decides, they meet from about reach=1\.[56][0-9]*; the surface joins or splits there"

# faulty FAULT CODE PATTERN: the finding is a line of the output.
faulty() {
    local word=warning
    [ "$2" -eq 4 ] || word=broken
    expect "$2" "mend what is marked '$word'" sdmgen shapes check faulty -O fault="$1" --plugin "$plugin" --samples 16
    has "$3"
}
inside_out='part 2 of 2 \(12 triangles, vertices 8 \.\. 15, box 2 -0\.25 -0\.25 \.\. 4 0\.25 0\.25 mm\) is inside out and overlaps another'
faulty handle 4 "^warning +$inside_out.*\(at size=[0-9.]+ reach=[0-9.]+; parts are inside out in all 21 shapes\); reverse the vertices"
# Maps turn the whole mesh, or a part that meets no other: the line names which, and what to do.
faulty inverted 4 '^warning +the whole mesh is inside out; maps turn it \(at size=2\.5 reach=1\.5; meshes are inside out in all 21 shapes\); exchange two vertices of every triangle in mesh\(\) of the shape$'
faulty averted 4 '^warning +part 2 of 2 \(12 triangles, vertices 8 \.\. 15, box 3 -0\.25 -0\.25 \.\. 4 0\.25 0\.25 mm\) is inside out; maps turn it \(at size=2\.5 reach=1\.5; parts are inside out in all 21 shapes\); reverse the vertices of these triangles in mesh\(\) of the shape$'
first='; mend this first: findings that may follow from it are left out$'
# turns WHERE WHY: where part 2 turns over in some shapes only, and why
turns() {
    echo "^warning +part [12] of 2 .* is inside out.*; parts are inside out in [0-9]+ of 21 shapes\); in the other shapes the vertices are in the right order: here part 2 turns over where $1: $2$first"
}
faulty late 4 "$(turns "'size' rises above about 2" "mesh\(\) writes its triangles in another order there: look for an if on 'size'")"
faulty window 4 "$(turns "'size' falls below about 2\.9 and 'reach' is between about 1\.25 and 1\.75" "mesh\(\) writes its triangles in another order there: look for an if on 'size' and 'reach'")"
faulty swapped 4 "$(turns "'size' rises above about 2" "its vertices jump there: look for an if on 'size'")"
# two parameters decide: a range that ends as the line says is enough, for either of them
faulty pair 4 "$(turns "'size' falls below about 1\.75 and 'reach' rises above about 1\.25" "a length of this part becomes negative there; let the range of 'size' begin at 1\.76, or that of 'reach' end at 1\.24 \(one of them is enough\), or limit the length in mesh\(\)")"
for narrow in 'size=[1.76,3]' 'reach=[1,1.24]' 'size=[1.6,3]' 'reach=[1,1.4]'; do
    printf 'shape: {name: faulty, options: {fault: pair}}\ngrid: auto\ntrain: {minutes: 1}\n' >pair.yaml
    sdmgen shapes check pair.yaml "shape.ranges.$narrow" --plugin "$plugin" --samples 4 >out 2>err
    case $narrow in
    *1.76* | *1.24*) if grep -q 'inside out' out; then bad "pair with $narrow: $(cat out)"; fi ;;
    *) has 'is inside out' ;;
    esac
done
faulty negative 4 "$(turns "'size' rises above about 2" "a length of this part becomes negative there; let the range of 'size' end at 1\.99, or limit the length in mesh\(\)")"
if grep -q 'walls pass through each other' out; then bad "a part that turns over, and a wall: $(cat out)"; fi
faulty body 4 '^warning +part 1 of 2 .* is inside out and larger than the rest: maps turn the whole mesh for it, and subtract part 2 of 2 from what that overlaps \(at size=[0-9.]+ reach=[0-9.]+; parts are inside out in all 21 shapes\)'
if grep -q 'maps turn it' out; then bad "the parts that maps turn are told beside those that they lose: $(cat out)"; fi
expect 4 'is inside out and larger' sdmgen mesh --shape faulty -O fault=body --plugin "$plugin" --audit
has '^inside out +1 of 2 parts$'
has '^  1 .* inside out '
has '^  2 .* subtracted '
faulty jump 4 '^warning +vertex (8|9|1[0-5]) jumps by 0\.125 mm at size=2, with reach='
faulty sizes 4 '^warning +the numbers of vertices and triangles change: 24 and 36 at first, others in [0-9]+ of 21 shapes, for example 16 vertices at size=[0-9.]+ reach=[0-9.]+: .size. changes them; derivatives need'
faulty sizes 4 '^warning +the number of vertices or triangles changes at size=2, with reach='
faulty wires 4 '^warning +the triangles get other vertices in .* at size=[0-9.]+ reach=[0-9.]+: .size. changes them; derivatives need'
faulty twins 4 '^warning +triangles given twice in all 21 shapes, up to 12 at .*: they count once; do two parts lie in the same place\?'
faulty velocity 4 '^warning +velocity\(\) is off by 0\.0099 of the largest velocity by reach, at vertex 9'
faulty unlike 4 '^warning +meshes have other bits when they are made again, for example at size=2\.5 reach=1\.5; mesh\(\) keeps something from one call to the next: .*; mend this first'
# a cache of one mesh that does not compare the reach, and state in a part of the range, which looks like a jump
cache='; a static variable or a cache in mesh\(\) is the usual cause: let mesh\(\) compute everything anew in every call'
beside="mesh\(\) depends on an earlier call: after a call in which only 'reach' differs it gives another mesh, for example at size=[0-9.]+ reach=[0-9.]+$cache; mend this first"
faulty cache 4 "^warning +$beside"
expect 4 'mend' sdmgen shapes check faulty -O fault=cache --plugin "$plugin" --isolate --samples 4
has "^warning +$beside"
faulty lapse 4 "^warning +mesh\(\) depends on an earlier call about size=2\.[0-9]+, with reach=[0-9.]+: meshes there have other bits when they are made again in another order$cache\$"
if grep -q 'jumps' out; then bad "state is told as a jump: $(cat out)"; fi
expect 4 'mend' sdmgen shapes check faulty -O fault=lapse --plugin "$plugin" --samples 16 --json
has '"jumps": \[\{"kind": "state", "parameter": "size"'
faulty shared 4 '^warning +meshes have other bits when they are made again by several threads at once, for example at .*; mesh\(\) writes a static or global variable or array'
faulty unset 4 '^warning +meshes have other bits when they are made again, for example at .*; mesh\(\) reads memory that it has not written'
if [ $emulated = no ]; then
    sticky='a static or global variable keeps what the first call of mesh\(\) set: let mesh\(\) compute it anew in every call'
    faulty sticky 4 "^warning +meshes have other bits when they are made again in another process, which made another shape first, for example at size=[0-9.]+ reach=[0-9.]+; $sticky; mend this first"
    # a cache of many meshes: a process of its own for every thread would not help
    faulty caches 4 "^warning +$beside"
    if grep -q 'isolate' out; then bad "a cache is told as a matter of threads: $(cat out)"; fi
    (ulimit -n 7 && sdmgen shapes check faulty --plugin "$plugin" --samples 4) >out 2>err || bad "without another process: $(cat err)"
    has '^note +not tested: meshes in another process, which show a static variable that keeps what the first call of mesh\(\) set; plug-in .*: no connection to a process for it'
fi
faulty behind 3 "^broken +mesh\(\) reads p\[3\], but the last parameter is p\[1\], 'reach'; mesh\(\) reads more parameters than the shape has: is a row missing in the table, or \.n_params smaller"
expect 3 "shape 'faulty' at .*: mesh\(\) reads p\[3\], but the last parameter is p\[1\], 'reach': its row is missing in the table, or \.n_params is too small" \
    sdmgen exact --shape faulty -O fault=behind --plugin "$plugin" --measure
# also where the mesh cannot be made with most values there
faulty unlisted 3 "^broken +mesh\(\) reads p\[2\], but the last parameter is p\[1\], 'reach'; "

faulty open 3 '^broken +open or badly oriented edges in all 21 shapes, up to 3 at .*: part 2 of 2 \(11 triangles, vertices 8 \.\. 15, .* has 3 edges .*, the first at [0-9.]+ -?[0-9.]+ -?[0-9.]+ mm: add the triangles'
faulty metres 4 '^warning +the shape is 0\.008 mm in size, 1 mm of the parameter .size. moves its vertices by 0\.0017 mm; the unit of sdmgen is mm: are the vertices in m\? Multiply them by 1000$'
# A part in metres beside one in millimetres: named with its size, and no other line explains it.
faulty crumb 4 '^warning +part 3 of 3 \(12 triangles, vertices 16 \.\. 23, box 0\.01 0\.01 0\.01 \.\. 0\.015 0\.015 0\.015 mm\) is 1200 times smaller than part 1 of 3 \(.*\) at size=3 reach=[0-9.]+ \(in all 21 shapes\): are the vertices of one of them in another unit than mm\? Multiply those in m by 1000, those in um by 0\.001; if it is a leftover speck, remove it$'
expect 4 mend sdmgen shapes check faulty -O fault=crumb --plugin "$plugin" --samples 4 --json
has '"tiny": \{"shapes": 9, "most": 12[0-9.]+, "at": '
faulty small 4 '^warning +part 2 of 2 \(.*\) is [0-9]+ times smaller than part 1 of 2 \('
if grep -q 'are its vertices in m?' out; then bad "a part in metres is told twice: $(cat out)"; fi
# A length in metres among others in millimetres: both commands ask for the factor, in the same words.
told="1 mm of the parameter 'reach' moves no vertex of part 2 of 2 by more than 0\.001 mm, and no other part: does mesh\(\) multiply 'reach' by 0\.001\?$"
faulty converted 4 "^warning +$told"
[ "$(grep -cE '^(warning|broken)' out)" -eq 1 ] || bad "a converted length has consequences: $(cat out)"
sdmgen shapes test faulty -O fault=converted --plugin "$plugin" --samples 4 >out 2>err
has "^doubtful units +$told"
# The length makes the part tiny: the line about the part asks for the factor, not to multiply its vertices.
faulty ringlet 4 "^warning +part 2 of 2 \(.*\) is [0-9]+ times smaller than part 1 of 2 \(.*\) at .*\): does mesh\(\) multiply 'reach' by 0\.001\?$"
if grep -q 'Multiply those in m' out; then bad "vertices of a converted length are to be multiplied: $(cat out)"; fi
sdmgen exact --shape faulty -O fault=ringlet --plugin "$plugin" --spacing 0.2 -o ringlet.stl 2>err
grep -q 'is 0\.00[0-9]* mm thick, .* no grid of the whole shape shows it: are its vertices, or a length of it, in another unit than mm?$' err || bad "thin part: $(cat err)"
expect 0 - sdmgen shapes check faulty -O fault=mixed --plugin "$plugin" --samples 16
has "^note +'size' moves part 2 by 0\.0005 mm per mm, part 1 by 1\.7: is it in m in one place\?$"
expect 0 - sdmgen shapes check faulty -O fault=lever --plugin "$plugin" --samples 16
if grep -q 'in m in one place' out; then bad "a small motion is taken for metres: $(cat out)"; fi
faulty fail 3 "^broken +no mesh in [0-9]+ of 21 shapes: shape 'faulty' at size=2\.5 reach=1\.5: too large"
faulty wall 4 '^warning +walls pass through each other in [0-9]+ of the [0-9]+ shapes that were followed from the default shape: on the way from the default shape to size=1 reach=[12] [0-9]+ % of the surface turns over, at about size=1\.[78][0-9]* reach='
faulty step 4 '^warning +vertex (9|1[0-5]) jumps by 1 mm at reach=1\.75'
if grep -q 'moves no vertex' out; then bad "a parameter with a threshold moves no vertex: $(cat out)"; fi
expect 4 'mend' sdmgen shapes check faulty -O fault=jump --plugin "$plugin" --samples 16 --json
has '"verdict": "warning".*"jumps": \[\{"kind": "jump", "parameter": "size", "value": [12]\.[0-9]+, "vertex": [0-9]+, "mm": 0\.125'

# A part whose outline goes round three times, and pairs of its triangles that meet.
faulty wound 4 '^warning +part 1 of 1 \(36 triangles, .*\) winds around its inside more than once: it encloses [0-9.]+ mm\^3, 2\.[0-9]+ times the volume that it fills, and [0-9]+ pairs of its triangles meet \(at size=[0-9.]+ reach=[0-9.]+; parts wind more than once in all 21 shapes\); does a tube go round more than once, or is an angle in degrees, such as 360 \* j / n, given to cos\(\) or sin\(\)\? These want rad$'
has '^note +overlaps .*: the union counts; [0-9]+ of them within part 1 of 1 \(36 triangles, .* mm\) alone \([0-9.e+]+ % of its surface\); to see what faces the wrong way there: exact --shape faulty -p size=[0-9.]+ -p reach=[0-9.]+ --certify -o x\.nrrd$'
# Triangles of one face that overlap beside a vertex of both are no pairs within the part.
expect 0 - sdmgen shapes check faulty -O fault=diagonal --plugin "$plugin" --samples 16
has '^note +overlaps \(pairs of triangles that meet\) in all 21 shapes, up to [0-9]+ at size=[0-9.]+ reach=[0-9.]+: the union counts$'
# In a shape of several parts as well, of which the others fill more than it does.
faulty around 4 '^warning +part 2 of 2 \(36 triangles, .*\) winds around its inside more than once: it encloses [0-9.]+ mm\^3, 2\.[0-9]+ times the volume that it fills, .*; parts wind more than once in all 21 shapes\)'

# Triangles that begin at a wrong vertex leave out vertices: the first line names the cause of the others.
unused='belong to no triangle: is an offset of vertex indices wrong, so that triangles have vertices of another part\? If they are left over, remove them'
faulty spare 4 "^warning +8 vertices \(16 \.\. 23\) $unused \(in all 21 shapes\); mend this first: findings that may follow from it are left out\$"
faulty offset 4 "^warning +4 vertices \(12 \.\. 15\) $unused"
[ "$(grep -cE '^(warning|broken|note)' out)" -eq 1 ] || bad "consequences are told beside their cause: $(cat out)"
sdmgen shapes test faulty -O fault=spare --plugin "$plugin" --samples 4 >out 2>err
has '^doubtful meshes +vertices belong to no triangle in 9 of 9 shapes, up to 8: is an offset of vertex indices wrong\?'

# With a configuration: its ranges and its grid.
cat >good.yaml <<'YAML'
shape: {name: faulty, ranges: {size: [1, 2]}}
grid: {size: [49, 33, 33], spacing: 0.25, centre: [0, 0, 0]}
train: {minutes: 0.02}
YAML
expect 0 - sdmgen shapes check good.yaml --plugin "$plugin" --samples 16
has "^fine: the shape can be trained; read the table 'moves': does each parameter move the right parts\?\$"
# The sides of the handle, which stay, lie on planes of voxel centres.
planes='flat faces lie exactly on planes of voxel centres along y and z: .* may be off by [0-9.]+ % of the volume; with grid.centre: \[0, [-0-9.]+, [-0-9.]+\] \(and without grid.origin\) they lie'
has "^note +$planes"
centre=$(grep -oE 'grid.centre: \[[^]]*\]' out)
expect 0 - sdmgen shapes check good.yaml "${centre/: /=}" --plugin "$plugin" --samples 16
if grep -q planes out; then bad "the centre proposed has faces on planes: $(cat out)"; fi
expect 4 mend sdmgen shapes check good.yaml 'grid.size=[29,33,33]' --plugin "$plugin" --samples 16 -o cut.svg
cuts='over the parameters the shape reaches from \(-2, -2, -2\) to \(4, 2, 2\) mm; the grid covers \(-3\.5, -4, -4\) to \(3\.5, 4, 4\) mm and cuts [0-9.]+ % of the shapes \(by up to 0\.5 mm at the upper end of x\); use grid: \{spacing: 0\.25\} \(size: \[[0-9, ]+\], spacing: 0\.25, origin: \[[-0-9., ]+\]\)'
has "^warning +$cuts$"
present cut.svg
# A grid far larger than the shapes, which need 8 + 1.75 mm and 4 + 1.75 mm of it.
large='the grid has 2[0-9.]+ times as many voxels as a grid around the shapes with a margin of 3 voxels: it is 2 times as long along x, 3\.4 along y, 3\.4 along z; use grid: \{spacing: 0\.25\} \(size: \[[0-9, ]+\], spacing: 0\.25, origin: \[[-0-9., ]+\]\)'
expect 4 mend sdmgen shapes check good.yaml 'grid.size=[62,78,78]' --plugin "$plugin" --samples 16
has "^warning +$large$"
expect 0 "^sdmgen: warning: $large$" sdmgen config good.yaml 'grid.size=[62,78,78]' --plugin "$plugin" -q
# The handle is 0.5 mm thick.
thin='part 2 of 2 \(box [^a-z]* mm\) is 0\.5 mm thick, too thin for voxels of 0\.5 mm: it will be missing or broken in surfaces; a spacing of at most 0\.25 mm shows it'
expect 4 mend sdmgen shapes check good.yaml grid.spacing=0.5 grid.size=[25,17,17] --plugin "$plugin" --samples 16
has "^warning +$thin \(the thinnest of all, at size=.*; parts are too thin in all 21 shapes\); use grid: \{spacing: 0\.25\} \(about 0\.058 million voxels, 8 times as many, which take as many times longer; maps of up to [0-9.]+ GB in memory\)$"
# What it costs, where the memory for maps is too small.
expect 4 mend sdmgen shapes check good.yaml grid.spacing=0.5 grid.size=[25,17,17] data.memory_gb=0.05 --plugin "$plugin" --samples 4
has 'use grid: .* GB in memory: raise data.memory_gb, which is 0\.05\)$'
expect 0 "^sdmgen: warning: $thin" sdmgen config good.yaml grid.spacing=0.5 grid.size=[25,17,17] --plugin "$plugin" -q
# A handle that turns over in some shapes is told alone.
sdmgen config good.yaml shape.options.fault=negative shape.ranges.size='[1,3]' grid.spacing=0.5 grid.size=[33,33,33] --plugin "$plugin" -q >out 2>err || bad "config: $(cat err)"
grep -q 'is inside out' err || bad "no part is inside out: $(cat err)"
if grep -q 'too thin' err; then bad "a part that is inside out, and a thin one: $(cat err)"; fi
has '^good\.yaml: no mistakes in the file; the shape has 1 \(above\)$'
expect 0 "^sdmgen: warning: $thin$" sdmgen exact --shape faulty --plugin "$plugin" --spacing 0.5 -o thin.nrrd -q

# A rod that is too thin for 96 voxels along its longest edge: grid: auto shows it, and says how it could be finer.
cat >rod.yaml <<'YAML'
shape: {name: linkage, options: {links: 1, length: 24, radius: 0.15, tip: 0.15, base: 0.1}, ranges: {q1: [0, 0.1]}}
train: {minutes: 0.02}
YAML
grid='grid: [0-9]+ x [0-9]+ x [0-9]+ voxels of 0\.13 mm, from \(.*\) to \(.*\) mm; sdmgen config gives the reasons$'
expect 0 "^sdmgen: $grid" sdmgen shapes check rod.yaml --samples 8
has "^fine: the shape can be trained; read the table 'moves': does each parameter move the right parts\?\$"
expect 0 'voxels of 0\.13 mm in place of .*; no more than two voxels across it, as the longest edge has over 96; still finer with grid: \{spacing: 0\.087\} \(about 0\.2 million voxels, 3\.3 times as many, .* GB in memory\)$' sdmgen config rod.yaml

# A longer one would be missing with 400,000 voxels, and gets more of them; one that a million do not show is a note, so that the test of a new shape passes.
long() { # QMAX: a rod that turns up to QMAX
    printf 'shape: {name: linkage, options: {links: 1, length: 100, radius: 0.15, tip: 0.15, base: 0.1}, ranges: {q1: [0, %s]}}\ntrain: {minutes: 0.02}\n' "$1" >long.yaml
}
long 0.2
expect 0 '^sdmgen: grid: 565 x 120 x 10 voxels of 0\.18 mm' sdmgen shapes check long.yaml --samples 8
has "^fine: the shape can be trained; read the table 'moves': does each parameter move the right parts\?\$"
if grep -q 'too thin' out; then bad "grid: auto does not show a rod that a million voxels show: $(cat out)"; fi
long 0.7
expect 0 '^sdmgen: grid: [0-9x ]+ voxels of 0\.4 mm' sdmgen shapes check long.yaml --samples 8
has '^note +part 2 of 2 .* too thin for voxels of 0\.4 mm: .*; grid: auto makes up to 1,000,000 voxels to show a part, as far as data\.memory_gb holds their maps; use grid: \{spacing: 0\.13\} \(about 11 million voxels'
sdmgen shapes check long.yaml grid.spacing=0.4 --samples 8 >out 2>err && bad 'a grid of its own that shows no rod passes'
has '^warning +part 2 of 2 .* too thin for voxels of 0\.4 mm: '

# More maps than the memory for them holds: refused, or a warning where a template may do with fewer.
expect 2 'good.yaml: data.static .* need [0-9.]+ GB, data.memory_gb is 0.002' sdmgen config good.yaml network.kind=pod data.memory_gb=0.002 --plugin "$plugin"
expect 2 'need [0-9.]+ GB, data.memory_gb is 0.002' sdmgen shapes check good.yaml network.kind=pod data.memory_gb=0.002 --plugin "$plugin" --samples 16
expect 0 'warning: good.yaml: data.static .* need [0-9.]+ GB, .*\(network.kind: template needs less\)$' sdmgen config good.yaml network.kind=auto data.memory_gb=0.002 --plugin "$plugin" -q

# A mesh file in metres: a question about its units.
printf 'OFF\n4 4 0\n0 0 0\n0.02 0 0\n0 0.02 0\n0 0 0.02\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n' >metres.off
expect 0 - sdmgen mesh --mesh metres.off --audit
has '^units: the mesh measures 0\.0[0-9]* mm across: is it in m\? lengths are mm$'

# The other commands say it in one line on stderr (and that the mesh overlaps itself).
expect 0 "warning: $inside_out" sdmgen mesh --shape faulty -O fault=handle -o x.ply --plugin "$plugin" -q
expect 4 "error: $inside_out" sdmgen mesh --shape faulty -O fault=handle --audit -o y.ply --plugin "$plugin"
present y.ply
has '^inside out +1 of 2 parts$'
has '^volume of the union +124\.875 mm\^3$'
has '^  2 +12 +8 \.\. 15 +inside out +no +yes +-0\.5 '
expect 0 - sdmgen mesh --shape faulty --audit --plugin "$plugin"
has '^volume +125\.5 mm\^3, the sum over all triangles: overlaps count twice$'
has '^volume of the union +125\.375 mm\^3$'
has '^fine: the mesh is closed; it overlaps itself, and the union counts$'
expect 3 'error: the mesh is not closed: part 2 of 2 \(11 triangles, .* has 3 edges .*, the first at' sdmgen mesh --shape faulty -O fault=open --audit --plugin "$plugin"
expect 0 'warning: the mesh is open: 3 boundary edges' sdmgen mesh --shape faulty -O fault=open -o open.ply --plugin "$plugin" -q
expect 3 'not closed' sdmgen mesh --mesh open.ply --json
has '"verdict": "broken"'
expect 0 - sdmgen info open.ply
printf 'OFF\n3 2 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n3 0 2 1\n' >flat.off
expect 4 'encloses no volume' sdmgen mesh --mesh flat.off --audit
told() {
    [ "$(grep -Ec "$1" err)" -eq 1 ] || bad "not told once: $1: $(cat err)"
}
for command in "exact --shape faulty -O fault=handle -o x.nrrd" "config good.yaml shape.options.fault=handle" \
    "train good.yaml shape.options.fault=handle --out run" "phantom --shape faulty -O fault=handle --size 32,32,32 --spacing 0.4 -o ct.nrrd" \
    "fit --shape faulty -O fault=handle ct.nrrd --rotation 0,0,0 --spacing 0.8 --max-iterations 1 --force"; do
    # shellcheck disable=SC2086
    sdmgen $command --plugin "$plugin" >out 2>err
    [ $? -eq 0 ] || [ "${command%% *}" = fit ] || bad "$command: $(cat err)"
    told 'part 2 of 2 .* is inside out and overlaps another'
done
sdmgen config good.yaml 'grid.size=[29,33,33]' --plugin "$plugin" >out 2>err || bad 'config of a grid that cuts'
told "$cuts"
expect 0 "^sdmgen: warning: $cuts" sdmgen config good.yaml 'grid.size=[29,33,33]' --plugin "$plugin" -q
has '^good\.yaml: no mistakes, 1 warning$'
expect 0 'warning: meshes have other bits when they are made again, .* memory that it has not written' sdmgen config good.yaml shape.options.fault=unset --plugin "$plugin" -q
# a fit with exact maps of a plug-in, too
sdmgen phantom --shape faulty --spacing 0.4 -o good.nii --label good-label.nii --plugin "$plugin" -q >out 2>err || bad "good.nii: $(cat err)"
sdmgen fit --shape faulty -O fault=cache good-label.nii --label 1 --rotation 0,0,0 --max-iterations 1 --plugin "$plugin" -q >out 2>err
grep -q "^sdmgen: warning: shape 'faulty': mesh() depends on an earlier call: after a call in which only 'reach' differs .* Results of exact maps may be wrong; sdmgen shapes check faulty tells more$" err ||
    bad "no warning of a fit with a cache: $(cat err)"
sdmgen fit --shape faulty good-label.nii --label 1 --rotation 0,0,0 --max-iterations 1 --plugin "$plugin" -q >out 2>err
grep -q 'depends on\|made again' err && bad "a warning of a fit without a cache: $(cat err)"
expect 0 "warning: mesh\(\) depends on an earlier call: after a call in which only 'reach' differs" sdmgen config good.yaml shape.options.fault=cache --plugin "$plugin" -q
expect 0 "warning: mesh\(\) depends on an earlier call: after a call in which only 'reach' differs" \
    sdmgen train good.yaml shape.options.fault=cache data='{static: 0, start: 16, online: 0, holdout: 4}' --plugin "$plugin" --out cache -q
expect 0 'warning: the shape is 0\.0[0-9]+ mm in size' sdmgen config good.yaml shape.options.fault=metres --plugin "$plugin" -q
# a warning about the grid, which cuts the third box, and one about the shape
sdmgen config good.yaml shape.options.fault=sizes 'shape.ranges.size=[1,3]' --plugin "$plugin" -q >out 2>err || bad "config of changing numbers: $(cat err)"
grep -q 'warning: the numbers of vertices and triangles change: ' err && grep -q 'and cuts ' err || bad "shape and grid: $(cat err)"
has '^good\.yaml: no mistakes in the file, 1 warning; the shape has 1 \(above\)$'
sdmgen exact --shape faulty -O fault=handle --certify -o z.nrrd --plugin "$plugin" >out 2>err
[ $? -eq 4 ] || bad "exact --certify of a part that is inside out: $(cat err)"
told '^sdmgen: error: signs: [0-9]+ voxels are in a part of the mesh that is inside out'
present z.nrrd

# The verdict of a training repeats that a parameter changes the triangles.
expect 0 'the triangles get other vertices' sdmgen train good.yaml shape.options.fault=wires 'shape.ranges.size=[1,3]' data='{static: 0, start: 16, online: 0, holdout: 4}' --plugin "$plugin" --out wires -q
has '^(  not for| ) +derivatives of exact maps \(exact --jacobian, fit --exact or --polish\) where the triangles change with size: vertices'

# Vertices of no triangle, far away, change no box: pictures, grids, maps and fits are those of the shape without them.
for fault in none spare; do
    sdmgen shapes check faulty -O fault=$fault --plugin "$plugin" --samples 8 -o $fault.svg >out 2>err
    has '^box +-3 -3 -3 \.\. 5 3 3 mm$'
    sdmgen exact --shape faulty -O fault=$fault --plugin "$plugin" --json 2>err | grep -o '"values_crc64".*' >$fault.exact
    if grep -q 'leaves the grid' err; then bad "the grid cuts vertices of no triangle: $(cat err)"; fi
    sdmgen phantom --shape faulty -O fault=$fault --plugin "$plugin" --spacing 0.4 --rotation 0.1,0.2,0 -o $fault.nrrd --surface $fault.npy -q 2>err || bad "phantom: $(cat err)"
    sdmgen info $fault.nrrd --json | grep -o '"grid": {[^}]*}' >$fault.phantom
    sdmgen phantom --shape faulty -O fault=$fault --plugin "$plugin" --like none.nrrd -o like.nrrd >out 2>err || bad "phantom --like: $(cat err)"
    if grep -q 'leaves the grid' err; then bad "the grid cuts vertices of no triangle: $(cat err)"; fi
    sdmgen fit --shape faulty -O fault=$fault none.npy --plugin "$plugin" --rotation 0.1,0.2,0 --max-iterations 1 --force -o fit.nrrd -q >out 2>err
    sdmgen info fit.nrrd --json | grep -o '"size": [^}]*' >$fault.fit
    sdmgen config good.yaml grid=auto shape.options.fault=$fault --plugin "$plugin" >out 2>err || bad "config: $(cat err)"
    grep '^sdmgen: grid: ' err >$fault.config
    if grep -q 'as many voxels' err; then bad "a grid around vertices of no triangle: $(cat err)"; fi
done
for file in svg exact phantom fit config; do
    present none.$file
    cmp -s none.$file spare.$file || bad "vertices of no triangle change $file: $(diff none.$file spare.$file | head -n 5)"
done

expect 4 "error: 4 vertices \(12 \.\. 15\) $unused" sdmgen mesh --shape faulty -O fault=offset --audit --plugin "$plugin"
has '^unused vertices +4$'
expect 0 "warning: 8 vertices \(16 \.\. 23\) $unused \(in all" sdmgen config good.yaml shape.options.fault=spare --plugin "$plugin" -q
expect 0 "warning: 8 vertices \(16 \.\. 23\) $unused\$" sdmgen exact --shape faulty -O fault=spare --plugin "$plugin" -o x.npy -q
spared() { # spared BEFORE BETWEEN AFTER: a tetrahedron among so many vertices of no triangle
    printf 'OFF\n%d 4 0\n' $((4 + $1 + $2 + $3))
    yes '9 9 9' | head -n "$1"
    printf '0 0 0\n2 0 0\n0 2 0\n'
    yes '9 9 9' | head -n "$2"
    printf '0 0 2\n'
    yes '9 9 9' | head -n "$3"
    printf '3 %d %d %d\n' "$1" $(($1 + 2)) $(($1 + 1)) "$1" $(($1 + 1)) $(($1 + $2 + 3)) "$1" $(($1 + $2 + 3)) $(($1 + 2)) $(($1 + 1)) $(($1 + 2)) $(($1 + $2 + 3))
}
spared 0 0 1 >one.off
expect 4 'error: vertex 4 belongs to no triangle: is an offset' sdmgen mesh --mesh one.off --json
has '"unused_vertices": 1, "parts_inside_out": 0, "verdict": "warning"'
spared 1 2 0 >runs.off
expect 4 'error: 3 vertices \(the first: 0\) belong to no triangle' sdmgen mesh --mesh runs.off --audit
spared 0 2 1 >runs.off
expect 4 'error: 3 vertices \(the first: 3 \.\. 4\) belong to no triangle' sdmgen mesh --mesh runs.off --audit
has '^box +0 0 0 \.\. 2 2 2 mm$'

# The rim of a knob, half a circle in steps of 20: where the angles go to cos() in degrees, its outline crosses itself.
knob() {
    awk -v unit="$1" 'BEGIN {
        n = 9; s = 24
        print "OFF\n" n * s + 2, 2 * n * s, 0
        for (i = 0; i < n; i++) for (j = 0; j < s; j++) {
            a = (20 * i + 10) * unit; r = 4 * sin(a) + 6 * (i > 0 && i < n - 1); t = 6.283185307179586 * j / s
            print r * cos(t), r * sin(t), -4 * cos(a) }
        print "0 0 -4\n0 0 4"
        for (j = 0; j < s; j++) {
            k = (j + 1) % s
            print 3, n * s, k, j "\n" 3, n * s + 1, (n - 1) * s + j, (n - 1) * s + k
            for (i = 0; i + 1 < n; i++) { a = i * s + j; b = i * s + k; print 3, a, b, b + s "\n" 3, a, b + s, a + s } } }' >knob.off
}
knob 0.017453292519943295
expect 0 - sdmgen mesh --mesh knob.off --audit
knob 1
expect 4 'part 1 of 1 .* passes through itself, and [0-9.]+ % of its surface faces the wrong way: what lies behind that is missing; are two of its vertices exchanged, is the radius of a fillet larger than half of the thickness, a wall thicker than the part is wide, or an angle in degrees given to cos\(\) or sin\(\)\?$' \
    sdmgen mesh --mesh knob.off --audit

# Several parts: all are named, once. Boxes along x, each overlapping the one before; those of which the digit is 1 are inside out.
boxes() {
    awk -v parts="$1" 'BEGIN {
        n = length(parts); print "OFF\n" 8 * n, 12 * n, 0
        for (k = 0; k < n; k++) for (i = 0; i < 8; i++) print 3 * k + 4 * (i % 2), (k ? 2 : 9) * (int(i / 2) % 2), (k ? 2 : 9) * int(i / 4)
        split("0 2 1 1 2 3 4 5 6 5 7 6 0 1 4 1 5 4 2 6 3 3 6 7 0 4 2 2 4 6 1 3 5 3 7 5", t, " ")
        for (k = 0; k < n; k++) for (i = 1; i < 36; i += 3) {
            turned = substr(parts, k + 1, 1)
            print 3, t[i] + 8 * k, t[i + 1 + turned] + 8 * k, t[i + 2 - turned] + 8 * k } }' >boxes.off
}
boxes 0111111
sdmgen exact --mesh boxes.off -q -o x.npy 2>err || bad "exact of boxes: $(cat err)"
told '^sdmgen: warning: parts 2 \(vertices 8 \.\. 15, box 3 0 0 \.\. 7 2 2 mm\), 3 \(.*\), 4 \(.*\), 5 \(.*\) and 2 more of 7 are inside out and overlap others: they'
[ "$(wc -l <err)" -eq 1 ] || bad "more than one line: $(cat err)"
boxes 1000
sdmgen exact --mesh boxes.off -o x.npy 2>err || bad "exact of boxes: $(cat err)"
told 'warning: part 1 of 4 .* is inside out and larger than the rest: maps turn the whole mesh for it, and subtract parts 2, 3, 4 of 4 from what these overlap'
[ "$(grep -c 'inside out' err)" -eq 1 ] || bad "told more than once: $(cat err)"
boxes 11
sdmgen exact --mesh boxes.off -o x.npy 2>err || bad "exact of boxes: $(cat err)"
told '^sdmgen: the whole mesh is inside out; maps turn it$'

# A part in m beside one in mm.
boxes 00
awk 'NR > 10 && NR < 19 {$2 = 1 + $2 / 2000; $3 = 1 + $3 / 2000} {print}' boxes.off >needle.off
expect 4 "part 2 of 2 \(.*\) is 0\.001 mm thick, less than a thousandth of the mesh: no grid shows it; are its vertices, or a radius, in m\?" sdmgen mesh --mesh needle.off --audit

# Mending a file: --turn-parts.
expect 4 'is inside out and overlaps another.*--turn-parts mends this' sdmgen mesh --mesh x.ply --json
near "$(json union_volume_mm3)" 124.875 1e-9
near "$(json parts_inside_out)" 1 0
expect 0 'parts turned: 1' sdmgen mesh --mesh x.ply --turn-parts -o mended.ply
expect 0 - sdmgen mesh --mesh mended.ply --json
near "$(json union_volume_mm3)" 125.375 1e-9
expect 0 - sdmgen exact --mesh mended.ply -q --json
crc=$(json values_crc64)
expect 0 - sdmgen exact --mesh x.ply --turn-parts -q --json
[ "$(json values_crc64)" = "$crc" ] || bad 'exact --turn-parts differs from the map of the mended file'
expect 0 - sdmgen info mended.ply
has '^volume of the union +125\.375'

# An interrupt: the findings so far, and a word that they are not all. Without --foreground, timeout sends the signal
# twice: to the program and to its group.
for one in '' --foreground; do
    timeout $one --preserve-status -s INT 4 "$program" shapes check duct --samples 60000 >out 2>err
    [ $? -eq 130 ] || bad "an interrupted check: $(cat out err)"
    has '^mesh +[0-9]+ vertices'
    told 'interrupted: these are the findings as far as tested; not tested before the interrupt: [0-9]+ of 60065 shapes'
done
# Two signals at once are one interrupt, and the first mesh is not in it: so no line of its size.
"$program" shapes check duct --samples 60000 >out 2>err &
check=$!
sleep 0.6
kill -INT $check; kill -INT $check
wait $check
[ $? -eq 130 ] || bad "a check that is interrupted at once: $(cat out err)"
told 'interrupted: these are the findings as far as tested; not tested before the interrupt: [0-9]+ of 60065 shapes'
if grep -Eq '^mesh +0 vertices' out; then bad "the size of no mesh: $(cat out)"; fi

# Mistakes.
expect 2 'usage: sdmgen shapes check NAME' sdmgen shapes check
expect 2 "unknown shape 'tours'; did you mean 'torus'" sdmgen shapes check tours
expect 2 "unexpected argument 'more'" sdmgen shapes check torus more
expect 2 "unexpected argument 'more'" sdmgen shapes torus more
expect 2 'o needs .shapes check' sdmgen shapes torus -o x.png
expect 2 'O belongs to NAME' sdmgen shapes check good.yaml -O fault=none --plugin "$plugin"
expect 2 'x\.ply' sdmgen shapes check torus -o x.ply
expect 1 'missing\.yaml' sdmgen shapes check missing.yaml
expect 2 'either --shape NAME or --mesh FILE' sdmgen mesh --audit
expect 2 'p and -O need --shape' sdmgen mesh --mesh mended.ply -p a=1 --audit
# A plug-in that ends the program: one line names it, the callback and the parameters; no file is left.
for fault in crash abort exit; do
    case $fault in
    crash) reason='the plug-in used memory that is not its own' ;;
    abort) reason='the plug-in called abort\(\), or damaged memory' ;;
    exit) reason='the plug-in called exit\(\), which it must not' ;;
    esac
    expect 3 "shape 'faulty', mesh\(\) at size=2.5 reach=1.5: $reason" \
        sdmgen mesh --shape faulty -O fault=$fault --plugin "$plugin" -o ended.ply
    expect 3 "shape 'faulty', mesh\(\) at .*: $reason" sdmgen shapes check faulty -O fault=$fault --plugin "$plugin" --samples 4
done
absent ended.ply
expect 0 - sdmgen mesh --shape faulty -O fault=crash -p size=1.5 --plugin "$plugin" -o fine.ply

# an angle in degrees that the plug-in takes for radians; an emulated program cannot load the file that cc builds
[ $emulated = no ] || { finish && exit 0; }
sed -E 's/"mm"/"rad"/; s/\.min = [0-9.]+/.min = 120/; s/\.max = [0-9.]+/.max = 140/; s/\.def = [0-9.]+/.def = 130/' \
    "$source_folder/examples/plugin/octahedron.c" >degrees.c
cc -shared -fPIC -I"$source_folder/framework/include" degrees.c -o degrees.so -lm || bad 'the plug-in degrees.so was not built'
expect 4 'mend' sdmgen shapes check --plugin ./degrees.so --samples 4
has "^warning +the parameter 'radius' ranges from 120 to 140 rad: are these degrees"
# a plug-in that ends the program outside of its callbacks: a line about --isolate
{ cat "$source_folder/examples/plugin/octahedron.c" && printf '#include <stdlib.h>\n__attribute__((destructor)) static void end(void) { abort(); }\n'; } >late.c
cc -shared -fPIC -I"$source_folder/framework/include" late.c -o late.so -lm || bad 'the plug-in late.so was not built'
sdmgen shapes octahedron --plugin ./late.so >out 2>err
grep -q '^sdmgen: error: the program crashed; a plug-in that has written beyond its arrays may be the reason: --isolate finds it$' err || bad "a crash elsewhere: $(cat err)"
# a length that three parameters decide, of which the third is at its best end in the shape with the most parts inside out:
# radius - wall - gap > 0 needs a radius above 4 + 1, or a wall below 3 - 1
cat >lid.c <<'END'
#include "faulty_shape.h"
static const sdm_param LID[] = {
    {"radius", "mm", 3, 6, 5, "x"}, {"wall", "mm", 1, 4, 1.5, "x"}, {"gap", "mm", 0, 1, 0.25, "x"}};
static int lid_mesh(const void *self, const sdm_host *host, const sdm_option_value *options, const double *p, sdm_mesh_out *out)
{
    (void)self, (void)options;
    const int failed = host->reserve(host, out, 16, 24);
    const double r = p[0], top = 1 + r - p[1] - p[2];
    if (failed) return failed;
    faulty_box(out, 0, (const double[3]){-r, -r, -r}, (const double[3]){r, r, 2}, 0);
    faulty_box(out, 1, (const double[3]){-8, -8, 1}, (const double[3]){8, 8, top}, 0);
    return 0;
}
static const sdm_shape SHAPE = {.abi = SDM_SHAPE_ABI, .size = sizeof(sdm_shape), .name = "lid", .summary = "x", SDM_PARAMS(LID), .mesh = lid_mesh};
const sdm_shape *sdm_plugin_shape(uint32_t index) { return index ? NULL : &SHAPE; }
END
cc -shared -fPIC -D_GNU_SOURCE -I"$source_folder/framework/include" -I"$source_folder/tests/shape" lid.c -o lid.so -lm || bad 'the plug-in lid.so was not built'
expect 4 'mend' sdmgen shapes check --plugin ./lid.so --samples 16
has "here part 2 turns over where 'radius' falls below about [0-9.]+ and 'wall' rises above about [0-9.]+.*; let the range of 'radius' begin at 5\.01, or that of 'wall' end at 1\.99 \(one of them is enough\), or limit"
# a part that is inside out in some shapes, and meets a third one in some: the first finding is told, the second may follow from it
sed -E 's/\{"gap", "mm", 0, 1, 0\.25, "x"\}/{"shift", "mm", 0, 4, 1, "x"}/; s/ - p\[2\];/;/; s/out, 16, 24/out, 24, 36/
    s/^ *return 0;/    faulty_box(out, 2, (const double[3]){6 + p[2], -2, -2}, (const double[3]){12, 2, 3}, 0);\n&/' lid.c >pair.c
cc -shared -fPIC -D_GNU_SOURCE -I"$source_folder/framework/include" -I"$source_folder/tests/shape" pair.c -o pair.so -lm || bad 'the plug-in pair.so was not built'
expect 4 'mend' sdmgen shapes check --plugin ./pair.so --samples 16
has '^warning +part 2 of 3 .* is inside out and overlaps another'
if grep -q 'lie apart in the others' out; then bad "parts that meet beside one that is inside out: $(cat out)"; fi
# the other way round: radians that are called degrees; a few degrees are no mistake
for most in 3.1416 5 90; do
    sed -E "s/\"mm\"/\"deg\"/; s/\.min = [0-9.]+/.min = 0.5/; s/\.max = [0-9.]+/.max = $most/; s/\.def = [0-9.]+/.def = 1/" \
        "$source_folder/examples/plugin/octahedron.c" >radians.c
    cc -shared -fPIC -I"$source_folder/framework/include" radians.c -o radians.so -lm || bad 'the plug-in radians.so was not built'
    sdmgen shapes check --plugin ./radians.so --samples 4 >out 2>err
    if [ $most != 3.1416 ]; then
        has "^note +the unit 'deg' of the parameter 'radius' is none that sdmgen knows"
        [ $most = 5 ] || has 'none at all; mesh\(\) must multiply it by 0.017453 before it calls cos\(\) or sin\(\)$'
    else
        has "^warning +the parameter 'radius' has the unit deg, but ranges from 0.5 to 3.1416: are these rad\? Then its unit is \"rad\"$"
    fi
done
# an angle in degrees that makes shapes huge: no question about metres; a length in another unit than mm
sed -E 's/enum \{ RADIUS \}/enum { RADIUS, LEAN }/; s/\.min = 0\.5/.min = 1.5/; s/\.max = 5/.max = 2/; s/p\[RADIUS\]/(p[RADIUS] \/ fabs(cos(p[LEAN])))/g
    s/^static const sdm_param PARAMS.*/&\n    [LEAN] = {.name = "lean", .unit = "deg", .min = 10, .max = 11, .def = 10, .help = "lean"},/' \
    "$source_folder/examples/plugin/octahedron.c" >lean.c
cc -shared -fPIC -I"$source_folder/framework/include" lean.c -o lean.so -lm || bad 'the plug-in lean.so was not built'
expect 4 'mend' sdmgen shapes check --plugin ./lean.so --samples 4
has "^warning +the parameter 'radius' ranges from 1.5 to 2 mm, which moves no vertex of a shape of 90[0-9] mm by more than 0.6 mm; does mesh\(\) give 'lean' \(10 \.\. 11 deg\) to cos\(\) or sin\(\)\? These want rad"
if grep -q 'are these m ' out; then bad "degrees, and a question about metres: $(cat out)"; fi
# a few degrees that turn the shape by as many rad, and degrees that are converted twice; once is right
for factor in 1 0.0003046174 0.0174532925; do
    sed -E "s/enum \\{ RADIUS \\}/enum { RADIUS, TILT }/
        s/^static const sdm_param PARAMS.*/&\\n    [TILT] = {.name = \"tilt\", .unit = \"deg\", .min = 0, .max = 8, .def = 2, .help = \"tilt\"},/
        s|^ *// one triangle per octant.*|for (int i = 0; i < 6; i++) { const double a = $factor * p[TILT], x = out->vert[3 * i], y = out->vert[3 * i + 1]; out->vert[3 * i] = cos(a) * x - sin(a) * y; out->vert[3 * i + 1] = sin(a) * x + cos(a) * y; }|" \
        "$source_folder/examples/plugin/octahedron.c" >tilt.c
    cc -shared -fPIC -I"$source_folder/framework/include" tilt.c -o tilt.so -lm || bad 'the plug-in tilt.so was not built'
    sdmgen shapes check --plugin ./tilt.so --samples 4 >out 2>err
    code=$?
    case $factor in
    1)
        [ $code = 4 ] || bad "degrees taken for rad: exit code $code"
        has "^warning +over its range of 8 deg the parameter 'tilt' turns the surface at vertex 0 by 458 degrees: are degrees taken for rad in mesh\(\)\?.*multiply 'tilt' by 0.017453, or, if its range is in rad, give it the unit \"rad\"; mend this first"
        ;;
    0.0003*)
        [ $code = 4 ] || bad "degrees converted twice: exit code $code"
        has "^warning +over its range of 8 deg the parameter 'tilt' turns the surface at vertex 0 by 0.14 degrees: does mesh\(\) multiply 'tilt' by 0.017453 twice\? Once makes rad of degrees; mend this first"
        ;;
    *) if grep -E '^(warning|broken)' out; then bad "degrees converted once: $(cat out)"; fi ;;
    esac
done
# one that goes to tan(): it comes first
sed -E 's/enum \{ RADIUS \}/enum { RADIUS, RISE }/; s/p\[RADIUS\]/(p[RADIUS] + 0.1 * tan(p[RISE]))/g
    s/^static const sdm_param PARAMS.*/&\n    [RISE] = {.name = "rise", .unit = "", .min = 0, .max = 20, .def = 10, .help = "rise"},/' \
    "$source_folder/examples/plugin/octahedron.c" >rise.c
cc -shared -fPIC -I"$source_folder/framework/include" rise.c -o rise.so -lm || bad 'the plug-in rise.so was not built'
sdmgen shapes check --plugin ./rise.so --samples 4 >out 2>err
grep -Em1 '^(warning|broken)' out >first
grep -q "^warning  the vertices move beyond all bounds 6 times, at 1.571, 4.712 and so on, while the parameter 'rise' goes from 0 to 20, as tan() of so many rad does; if these are degrees, multiply them by 0.017453 in mesh(); mend this first" first || bad "degrees that go to tan() do not come first: $(cat out)"
sed 's/"mm"/"m"/' "$source_folder/examples/plugin/octahedron.c" >unit.c
cc -shared -fPIC -I"$source_folder/framework/include" unit.c -o unit.so -lm || bad 'the plug-in unit.so was not built'
expect 4 'mend' sdmgen shapes check --plugin ./unit.so --samples 4
has "^warning +the parameter 'radius' has the unit m: sdmgen counts in mm; give its range, its default and its unit in mm$"
expect 0 - sdmgen shapes test ./unit.so
has "^doubtful units +.*'radius' has the unit m: sdmgen counts in mm"
finish
