#!/bin/sh
# test_circles.sh SOURCE_FOLDER LIBRARY_OR_OBJECT...: checks that files do not depend on each other in a cycle. A file here is a source
# together with the header of the same name. File a uses file b if a includes the header of b or if the object code of a calls a function
# defined in b.
set -eu
root=$1
shift
work=$(mktemp -d "${TMPDIR:-/tmp}/test_circles.XXXXXX")
trap 'rm -rf "$work"' EXIT

# circles: reads pairs "a b" (a uses b) and prints those that belong to a cycle, that is, from b one gets back to a
circles() {
    awk '$1 != $2 && !seen[$1, $2]++ { from[++n] = $1; to[n] = $2; next_of[$1] = next_of[$1] " " $2 }
    function reaches(start, goal,   queue, head, tail, visited, m, list, i) {
        queue[tail = 1] = start
        for (head = 1; head <= tail; head++) {
            if (queue[head] == goal) return 1
            m = split(next_of[queue[head]], list, " ")
            for (i = 1; i <= m; i++) if (!visited[list[i]]++) queue[++tail] = list[i]
        }
        return 0
    }
    END { for (i = 1; i <= n; i++) if (reaches(to[i], from[i])) print from[i], "uses", to[i] }'
}

# calls OBJECT...: prints pairs "a b" for every symbol that the object code of a uses and b defines
calls() {
    nm -A -P "$@" | awk '
        NF >= 3 {
            object = $1; sub(/\]?:$/, "", object); sub(/^.*[\/[]/, "", object); sub(/[.](c|cc)[.]o$/, "", object)
            if ($3 ~ /^[TDBRVW]$/) defined[$2] = object
            if ($3 == "U") { use[++n] = object; symbol[n] = $2 }
        }
        END { for (i = 1; i <= n; i++) if (symbol[i] in defined) print use[i], defined[symbol[i]] }'
}

# includes FOLDER: prints pairs "a b" for every #include. Headers in include/sdm/ count as files of their own, since their names may differ
# from the source's.
includes() {
    (cd "$1" && grep -rnoE '^[ \t]*#[ \t]*include[ \t]*"[^"]+"' framework shapes runtime trainer cli --include='*.c' --include='*.cc' \
        --include='*.h' --include='*.inc') | awk -F: '
        function unit(path) {
            if (sub(/^(.*\/include\/)?sdm\//, "sdm/", path)) return path
            sub(/^.*\//, "", path); sub(/[.][a-z]+$/, "", path)
            return path
        }
        { name = $3; gsub(/^.*include[ \t]*"|"$/, "", name); print unit($1), unit(name) }'
}

calls "$@" >"$work/calls"
includes "$root" >"$work/includes"
[ "$(wc -l <"$work/calls")" -gt 500 ] || { echo "only $(wc -l <"$work/calls") calls between files found in $*"; exit 1; }
[ "$(wc -l <"$work/includes")" -gt 500 ] || { echo "only $(wc -l <"$work/includes") includes found in $root"; exit 1; }
found=$(cat "$work/calls" "$work/includes" | circles)
if [ -n "$found" ]; then
    echo "circles of files:"
    echo "$found"
    exit 1
fi

# self-test: an added cycle of three files is found, and nothing else
found=$({ cat "$work/calls"; printf 'one two\ntwo three\nthree one\none status\n'; } | circles | sort | tr '\n' ,)
[ "$found" = "one uses two,three uses one,two uses three," ] || { echo "self-test: found '$found'"; exit 1; }
echo "$(sort -u "$work/calls" "$work/includes" | wc -l) uses between files, no circle"
