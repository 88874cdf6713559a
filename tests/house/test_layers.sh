#!/bin/sh
# test_layers.sh SOURCE_FOLDER: checks the place and name of every source file and that every #include follows the layers of the
# architecture (see docs/architecture.md): which part may use which part, and within a part which folder ("room") may use which. Both rules
# are in the table below. A self-test then adds files and includes that break a rule to a copy and checks that each is found.
set -eu
root=$1
work=$(mktemp -d "${TMPDIR:-/tmp}/test_layers.XXXXXX")
trap 'rm -rf "$work"' EXIT

# check FOLDER: prints a line for every file or include that breaks a rule
check() {
    (cd "$1" && find framework shapes runtime trainer cli -type f | sort) >"$work/files"
    (cd "$1" && awk -v files="$work/files" '
    function wrong(text) { print FILENAME ":" FNR ": " text }
    function basename(path) { sub(/^.*\//, "", path); return path }
    function is_header(path) { return path ~ /\/include\/sdm\// }
    # the part that a file belongs to; for headers in include/sdm/ according to the table of own()
    function part_of(path,   p) {
        if (is_header(path)) return basename(path) in owner ? owner[basename(path)] : "?"
        split(path, p, "/")
        return p[1] == "framework" ? p[2] : p[1]
    }
    # the root folder of the part of a file, with a slash; empty for headers in include/sdm/
    function root_of(path) {
        if (is_header(path)) return ""
        return match(path, /^(framework\/[a-z]+|[a-z]+)\//) ? substr(path, 1, RLENGTH) : ""
    }
    # the room of a file: its folder relative to the root of its part, "." for the root itself
    function room_of(path, root,   room) {
        room = substr(path, length(root) + 1)
        return sub(/\/[^\/]*$/, "", room) ? room : "."
    }
    # a part may use the parts in the list
    function parts(part, list,   n, p, i) { n = split(list, p, " "); for (i = 1; i <= n; i++) allowed[part, p[i]] = 1 }
    # rooms of a part in order: each may use itself and those before it
    function rooms(root, list,   n, r, i) { n = split(list, r, " "); for (i = 1; i <= n; i++) rank[root, r[i]] = i }
    # the headers in include/sdm/ that belong to a part
    function own(part, list,   n, p, i) { n = split(list, p, " "); for (i = 1; i <= n; i++) owner[p[i] ".h"] = part }
    BEGIN {
        own("core", "blocks export grid memory pose shape status") # shape: types alone
         own("core", "block_border box checksum child clock container distribution envelope file foreign heap json_describe json_read mat3 near processor rng rotation sampling sanitized sha256 shared table team text threads units utf8 vec3")
         own("config", "config experiment mistakes")
        own("geom", "exact isosurface map mesh")
        own("geom", "brute_force builder exact_slopes mesh_box mesh_turn methods part_audit same_triangles")
        own("nn", "model")
        own("nn", "fine kernels model_hash model_onnx model_threads pod point_network sdmnn template volume_cause")
        own("io", "glb image meshfile npy picture picture_child ssm volume")
        own("shape", "callback conformance isolation mesh_measures open_end registry shape_box shape_repeat shape_sums shape_survey skipped")
        own("shapes", "builtin_shapes")
        own("runtime", "check field fit phantom runtime vdb")
        own("runtime", "fit_finding hardly_known model_mesh vdb_memory")
         own("all", "sdmgen") # the header that includes all public ones
         own("trainer", "comm map_store ssm_build train train_file train_plan verdict")
        parts("core", "core")
        parts("config", "core config")
        parts("geom", "core geom")
        parts("nn", "core nn")
        parts("io", "core geom io")
        parts("shape", "core geom io shape")
        parts("shapes", "core geom io shape shapes")
        parts("runtime", "core geom nn io shape runtime")
        parts("all", "core geom nn io shape shapes runtime trainer all")
        parts("trainer", "core config geom nn io shape trainer")
        parts("cli", "core config geom nn io shape shapes runtime trainer cli")
        rooms("framework/geom/", "memory simd exactly mesh solid features map sign layers points methods .")
        rooms("framework/nn/", "kernels onnx fine model pod template template/onnx point sdmnn open")
        rooms("framework/io/", ". mesh image picture")
        rooms("runtime/", "maps field phantom fit/open fit/data fit/solver fit/start fit/trust fit/points fit/kept fit/judge fit vdb")
        rooms("trainer/", "comm numerics ssm data shards state pod fine template direct .")
        rooms("cli/", "args slicer report survey inputs measure shapes phantom fit cohort ssm study page train .")
        rooms("framework/core/", "."); rooms("framework/config/", "."); rooms("framework/shape/", ". survey"); rooms("shapes/", ".")
        while ((getline line < files) > 0) {
            exists[line] = 1
            name = basename(line); folder = substr(line, 1, length(line) - length(name))
            if (name == "CMakeLists.txt") continue
            if (name in place) print line ": there is a file of this name in " place[name]
            place[name] = folder
            if (line ~ /\.(cc|cpp|cxx|hpp|hh)$/ && line !~ /^runtime\/vdb\//) print line ": C++ outside of runtime/vdb"
            if (is_header(line) && part_of(line) == "?") print line ": header without a part in the table of this test"
            root = root_of(line)
            if (root != "" && !((root, room_of(line, root)) in rank)) print line ": folder without a place in the table of this test"
            if (!is_header(line) && ++in_folder[folder] == 31) print line ": the 31st file of its folder"
        }
    }
    !/^[ \t]*#[ \t]*include/ { next }
    {
        name = $0; sub(/^[ \t]*#[ \t]*include[ \t]*/, "", name)
        quoted = substr(name, 1, 1) == "\""
        sub(/^["<]/, "", name); sub(/[">].*$/, "", name)
        part = part_of(FILENAME); root = root_of(FILENAME); room = room_of(FILENAME, root)
        folder = FILENAME; sub(/[^\/]*$/, "", folder)
        if (name ~ /^sdm\//) {
            header = basename(name)
            known = header in owner && ((name ~ /^sdm\/internal\//) == !((owner_folder(owner[header]) "include/sdm/" header) in exists))
            if (!known) wrong("unknown header " name)
            else if (!((part, owner[header]) in allowed)) wrong(part " must not include " name " of " owner[header])
            else if (name ~ /^sdm\/internal\// && FILENAME ~ /\/include\/sdm\/[^\/]*$/) wrong(name " in a header for users")
        } else if (quoted && name ~ /\//) {
            target = root name
            if (root == "" || !(target in exists)) wrong("\"" name "\" is no file of " root)
            else if (room_of(target, root) == room) wrong("\"" name "\" is in the same folder: leave the folder out")
            else if (rank[root, room_of(target, root)] > rank[root, room]) wrong(root room " must not include " name)
        } else if (quoted && !((folder name) in exists)) {
            if (!((root name) in exists)) wrong("\"" name "\" is neither in the same folder nor in " root)
            else if (rank[root, "."] > rank[root, room]) wrong(root room " must not include " name)
        }
        if (name ~ /(immintrin|x86intrin|emmintrin|arm_neon|arm_sve)\.h$/ && FILENAME !~ /^framework\/(geom\/(simd|map)|nn\/kernels)\//)
            wrong(name " outside of simd/, map/ and kernels/")
        if (name ~ /dnnl/ && FILENAME != "framework/nn/sdmnn/conv_kernels_dnnl.c") wrong(name " outside of framework/nn/sdmnn/conv_kernels_dnnl.c")
        if (name ~ /yaml\.h$/ && part != "config") wrong(name " outside of framework/config")
        if (name ~ /^(openvdb|tbb)\// && FILENAME !~ /^runtime\/vdb\//) wrong(name " outside of runtime/vdb")
        if (name ~ /cairo.*\.h$/ && FILENAME !~ /^framework\/io\/picture\//) wrong(name " outside of framework/io/picture")
        if (name ~ /^z(lib|conf)\.h$/ && part != "io") wrong(name " outside of framework/io")
        if (name ~ /^dlfcn\.h$/ && part != "shape" && FILENAME != "trainer/comm/comm_mpi.c") wrong(name " outside of framework/shape and trainer/comm/comm_mpi.c")
        if (name == "mpi.h" && FILENAME != "trainer/comm/mpi_module.c") wrong(name " outside of trainer/comm/mpi_module.c")
        if (is_header(FILENAME) && !quoted && name !~ /^(std(arg|bool|def|int)|pthread|math)\.h$/) wrong(name " in a header between parts")
    }
    function owner_folder(part) { return part == "all" ? "runtime/" : part ~ /^(runtime|trainer|shapes)$/ ? part "/" : "framework/" }
    ' $(grep -E '\.(c|cc|h|inc)$' "$work/files"))
}

found=$(check "$root")
if [ -n "$found" ]; then
    echo "$found"
    exit 1
fi
files=$(grep -c . "$work/files")
[ "$files" -gt 40 ] || { echo "only $files source files found in $root"; exit 1; }

# self-test: each line below breaks a rule; appended to a file of a copy, it must be found, and nothing else
copy=$work/copy
mkdir "$copy"
(cd "$root" && tar cf - framework shapes runtime trainer cli) | (cd "$copy" && tar xf -)
tried=0
must_find() { # must_find FILE LINE
    tried=$((tried + 1))
    mkdir -p "$(dirname "$copy/$1")"
    had=no
    if [ -e "$copy/$1" ]; then had=yes; cp "$copy/$1" "$work/kept"; fi
    printf '%s\n' "$2" >>"$copy/$1"
    found=$(check "$copy")
    if [ "$(printf '%s\n' "$found" | grep -c .)" != 1 ] || [ "${found%%:*}" != "$1" ]; then
        echo "self-test: '$2' in $1 gave: ${found:-nothing}"
        exit 1
    fi
    if [ $had = yes ]; then cp "$work/kept" "$copy/$1"; else rm "$copy/$1"; fi
}
must_find framework/core/status.c '#include "sdm/mesh.h"'
must_find framework/core/file.c '#include "sdm/internal/config.h"'
must_find framework/core/file.c '#include "sdm/internal/memory.h"'
must_find framework/geom/mesh/mesh.c '#include "sdm/meshfile.h"'
must_find framework/geom/mesh/mesh.c '#include "sdm/model.h"'
must_find framework/geom/mesh/mesh.c '#include "solid/fan.h"'
must_find framework/geom/mesh/mesh.c '#include "mesh/bvh.h"'
must_find framework/geom/mesh/bvh.c '#include <immintrin.h>'
must_find framework/geom/new.c '#include "../nn/model/model_kind.h"'
must_find framework/geom/new.c '#include "bytes.h"'
must_find framework/geom/methods/new.c '#include "bytes.h"'
must_find framework/geom/new.c '#include "method.h"'
must_find framework/geom/mesh/new.cc '// C++'
must_find framework/geom/solid/bvh.c '/* a name that geom/mesh has */'
must_find framework/geom/room/new.c '/* a room without a place */'
must_find framework/nn/pod/blocks.c '#include "sdm/exact.h"'
must_find framework/nn/pod/blocks.c '  #  include <immintrin.h>'
must_find framework/nn/pod/blocks.c '#include <oneapi/dnnl/dnnl.h>'
must_find framework/nn/model/model_kind.c '#include "pod/blocks.h"'
must_find framework/config/config.c '#include "sdm/registry.h"'
must_find framework/io/image/npy.c '#include "sdm/registry.h"'
must_find framework/io/image/npy.c '#include <yaml.h>'
must_find framework/io/image/npy.c '#include <cairo.h>'
must_find framework/include/sdm/grid.h '#include "sdm/exact.h"'
must_find framework/include/sdm/grid.h '#include "sdm/internal/heap.h"'
must_find framework/include/sdm/exact.h '#include <omp.h>'
must_find framework/include/sdm/unlisted.h '/* a header without a place */'
must_find framework/shape/new.c '#include "sdm/runtime.h"'
must_find runtime/maps/generate.c '#include "sdm/sdmgen.h"'
must_find runtime/maps/generate.c '#include "sdm/internal/train.h"'
must_find runtime/maps/generate.c '#include "sdm/builtin_shapes.h"'
must_find runtime/maps/generate.c '#include <openvdb/openvdb.h>'
must_find runtime/maps/generate.c '#include "sdm/internal/config.h"'
must_find runtime/fit/data/blur.c '#include "fit/solver/newton.h"'
must_find trainer/new.c '#include "sdm/runtime.h"'
must_find trainer/new.c '#include "sdm/vdb.h"'
must_find trainer/new.c '#include <zlib.h>'
must_find shapes/new.c '#include "sdm/runtime.h"'
must_find shapes/new.c '#include "sdm/internal/train.h"'
must_find cli/new.c '#include <dlfcn.h>'
must_find cli/new.c '#include "sdm/no_such.h"'
# a folder may have at most 30 files
n=$(find "$copy/framework/core" -maxdepth 1 -type f | wc -l)
while [ "$n" -lt 30 ]; do
    n=$((n + 1))
    : >"$copy/framework/core/fill_$n.c"
done
must_find framework/core/xyz_one_too_many.c '/* the 31st file */'
echo "$files files in order; $tried wrong ones found"
