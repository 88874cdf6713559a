#!/usr/bin/env bash
# Damaged .vdb files, with a checksum that is right: each gives one line and an exit code of 0, 1 or 3, within limits of time and memory;
# what is no regular file is not read; a full disk is told. Third argument: the program damage_vdb.
# Tests: reader_child.c vdb_child.c vdb_file.cc
damage=$3
. "$(dirname "$0")/common.sh"

expect 0 - sdmgen exact --shape torus -O edge=1 --size 30,30,14 --spacing 0.9 -q -o whole.vdb
size=$(stat -c %s whole.vdb)
harm=0
n=150
if is_brief; then n=40; fi
for i in $(seq $n); do
    at=$(((i * 7919 + i * i * 104729) % (size - 40)))
    "$damage" whole.vdb flipped.vdb $at $((1 << i % 8)) || bad "damage_vdb failed at $at"
    timeout -s KILL 300 "$program" info flipped.vdb >out 2>err
    code=$?
    case $code in
    0) [ ! -s err ] || bad "byte $at: $(cat err)" ;;
    1 | 3) [ "$(wc -l <err)" -eq 1 ] || bad "byte $at, exit code $code: not one line: $(cat err)" ;;
    *) bad "byte $at: exit code $code: $(cat err)" ;;
    esac
    ! grep -Eq 'OpenVDB crashes|asks for more than|takes more than' err || harm=$((harm + 1))
done
[ $harm -gt 0 ] || bad 'no file was harmful: the test does not test'

mkfifo pipe.vdb
expect 1 'pipe.vdb: not a regular file' timeout -s KILL 300 "$program" info pipe.vdb
ln -s /dev/zero zero.vdb
expect 1 'zero.vdb: not a regular file' timeout -s KILL 300 "$program" verify zero.vdb
expect 1 'missing.vdb: cannot open' sdmgen info missing.vdb

# a disk that is full: its own message, and no file
for blocks in 1 4; do
    expect 1 'full\.vdb: cannot write: File too large' bash -c "ulimit -f $blocks; exec '$program' exact --shape torus --size 30,30,14 --spacing 0.9 -q -o full.vdb"
    absent full.vdb full.vdb.*
done
finish
