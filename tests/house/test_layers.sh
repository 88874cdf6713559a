#!/bin/sh
# Order of dependencies: test_layers.sh SOURCE_FOLDER. Checks every #include, then proves on a copy that wrong ones are found.
set -eu
root=$1
work=$(mktemp -d "${TMPDIR:-/tmp}/test_layers.XXXXXX")
trap 'rm -rf "$work"' EXIT

# prints one line for each include that breaks the order
check() {
    (cd "$1" && find framework shapes runtime trainer cli -type f | sort) >"$work/files"
    (cd "$1" && awk -v files="$work/files" '
    function wrong(text) { print FILENAME ":" FNR ": " text; }
    # the part a file or a public header belongs to
    function part_of(path,   n, p, base) {
        n = split(path, p, "/"); base = p[n]
        if (path ~ /\/include\/sdm\//) return base in owner ? owner[base] : "?"
        return p[1] == "framework" ? p[2] : p[1]
    }
    function allow(part, list,   n, p, i) { n = split(list, p, " "); for (i = 1; i <= n; i++) allowed[part, p[i]] = 1 }
    function own(part, list,   n, p, i) { n = split(list, p, " "); for (i = 1; i <= n; i++) owner[p[i] ".h"] = part }
    BEGIN {
        vdb = "^runtime/vdb[a-z_]*[.]cc$"
        own("core", "checksum clock envelope export file grid json memory pose rng status text threads")
        own("config", "config experiment")
        own("geom", "mesh exact methods")
        own("nn", "model pod point_network sdmnn kernels container")
        own("io", "image volume meshfile")
        own("shape", "shape registry")
        own("runtime", "check fit map phantom runtime vdb")
        own("trainer", "train")
        own("shapes", "builtin_shapes")
        allow("core", "core")
        allow("config", "core config")
        allow("geom", "core geom")
        allow("nn", "core nn")
        allow("io", "core geom io")
        allow("shape", "core geom io shape")
        allow("shapes", "core geom shape shapes")
        allow("runtime", "core geom nn io shape runtime")
        allow("trainer", "core config geom nn io shape trainer")
        allow("cli", "core config geom nn io shape shapes runtime trainer cli")
        while ((getline line < files) > 0) {
            exists[line] = 1
            if (line ~ /\.(cc|cpp|cxx|hpp|hh)$/ && line !~ vdb) print line ": C++ outside of runtime/vdb*.cc"
            if (line ~ /\/include\/sdm\/[^\/]*$/ && part_of(line) == "?") print line ": public header without a part in the table of this test"
        }
    }
    !/^[ \t]*#[ \t]*include/ { next }
    {
        name = $0; sub(/^[ \t]*#[ \t]*include[ \t]*/, "", name)
        quoted = substr(name, 1, 1) == "\""
        sub(/^["<]/, "", name); sub(/[">].*$/, "", name)
        folder = FILENAME; sub(/[^\/]*$/, "", folder)
        base = substr(FILENAME, length(folder) + 1)
        # a folder within a part of the framework, e.g. geom/methods, sees the headers of the part
        part_folder = folder; if (!sub(/[^\/]*\/$/, "", part_folder) || part_folder !~ /^framework\/[a-z]*\/$/) part_folder = folder
        part = part_of(FILENAME)
        if (name ~ /^sdm\//) {
            header = substr(name, 5)
            if (!(header in owner)) wrong("unknown public header " name)
            else if (!((part, owner[header]) in allowed)) wrong(part " must not include " name " of " owner[header])
        } else if (quoted && (name ~ /\// || !((folder name) in exists || (part_folder name) in exists))) wrong("\"" name "\" is not in the same folder or in that of its part")
        if (name ~ /(immintrin|x86intrin|emmintrin|arm_neon|arm_sve)\.h$/ && !(FILENAME ~ /^framework\// && (base ~ /kernel/ || base == "lanes.h"))) wrong(name " outside of the kernels")
        if (name ~ /dnnl/ && FILENAME != "framework/nn/sdmnn/conv_kernels_dnnl.c") wrong(name " outside of framework/nn/sdmnn/conv_kernels_dnnl.c")
        if (name ~ /yaml\.h$/ && part != "config") wrong(name " outside of framework/config")
        if (name ~ /^(openvdb|tbb)\// && FILENAME !~ vdb && FILENAME != "runtime/vdb_parts.h") wrong(name " outside of runtime/vdb*")
        if (name ~ /^z(lib|conf)\.h$/ && part != "io") wrong(name " outside of framework/io")
        if (name ~ /^dlfcn\.h$/ && part != "shape") wrong(name " outside of framework/shape")
        if (FILENAME ~ /\/include\/sdm\// && !quoted && name !~ /^std(bool|def|int)\.h$/) wrong(name " in a public header")
    }' $(grep -E '\.(c|cc|h|inc)$' "$work/files"))
}

found=$(check "$root")
if [ -n "$found" ]; then
    echo "$found"
    exit 1
fi
files=$(grep -c . "$work/files")
[ "$files" -gt 40 ] || { echo "only $files source files found in $root"; exit 1; }

# self-test: each wrong line, put into a copy, must be found, and nothing else
copy=$work/copy
mkdir "$copy"
(cd "$root" && tar cf - framework shapes runtime trainer cli) | (cd "$copy" && tar xf -)
must_find() { # must_find FILE LINE
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
must_find framework/core/file.c '#include "sdm/config.h"'
must_find framework/geom/mesh.c '#include "sdm/meshfile.h"'
must_find framework/geom/mesh.c '#include "sdm/model.h"'
must_find framework/nn/blocks.c '#include "sdm/exact.h"'
must_find framework/nn/blocks.c '  #  include <immintrin.h>'
must_find framework/nn/blocks.c '#include <oneapi/dnnl/dnnl.h>'
must_find framework/config/config.c '#include "sdm/registry.h"'
must_find framework/io/npy.c '#include "sdm/registry.h"'
must_find framework/io/npy.c '#include <yaml.h>'
must_find framework/include/sdm/grid.h '#include "sdm/exact.h"'
must_find framework/include/sdm/exact.h '#include <omp.h>'
must_find framework/shape/new.c '#include "sdm/runtime.h"'
must_find framework/geom/new.c '#include "../nn/model_internal.h"'
must_find framework/geom/new.c '#include "bytes.h"'
must_find framework/geom/methods/new.c '#include "bytes.h"'
must_find framework/geom/new.c '#include "method.h"'
must_find framework/geom/new.cc '// C++'
must_find framework/include/sdm/unlisted.h '/* a header nobody placed */'
must_find runtime/runtime.c '#include "sdm/train.h"'
must_find runtime/runtime.c '#include "sdm/builtin_shapes.h"'
must_find runtime/runtime.c '#include <openvdb/openvdb.h>'
must_find runtime/runtime.c '#include "sdm/config.h"'
must_find trainer/new.c '#include "sdm/runtime.h"'
must_find trainer/new.c '#include "sdm/vdb.h"'
must_find trainer/new.c '#include <zlib.h>'
must_find shapes/new.c '#include "sdm/runtime.h"'
must_find shapes/new.c '#include "sdm/train.h"'
must_find cli/new.c '#include <dlfcn.h>'
must_find cli/new.c '#include "sdm/no_such.h"'
echo "$files files in order; 31 wrong includes found"
