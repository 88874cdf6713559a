/* sdmgen bench exact: one mesh and grid, a row of figures for every way to make the map; sdmgen
 * bench network: a model. */
#ifndef CLI_BENCH_H
#define CLI_BENCH_H

#include "args/options.h"
#include "sdm/exact.h"

typedef struct bench_case {
    char title[512]; /* mesh and grid in words */
    sdm_mesh mesh;
    sdm_grid grid; /* axis-aligned */
    size_t voxels;
    double band_mm; /* only |distance| up to this counts; INFINITY: all */
    double share;   /* of the voxels, for what is slow */
    size_t repeat;  /* runs at most */
    int threads;    /* of the row with all cores */
    float *exact;   /* [nz][ny][nx] map of the exact engine: what the others are compared with */
    float *winding; /* [nz][ny][nx] its sign: by the winding number of the whole mesh; NaN: not
                       asked */
    bool unioned;   /* the mesh overlaps itself */
} bench_case;

/* One way to make the map. Times are of one thread's processor, but for the row with all cores: the
 * clock's. */
typedef struct bench_row {
    char name[48];
    char note[256]; /* version, method; or why there are no figures */
    bool done;      /* there are figures */
    double ms_prepare, ms_map;
    double share;                 /* of the voxels done; ms_map is scaled to all */
    double peak_mb;               /* resident memory over that before; NaN: unknown */
    double max_error, mean_error; /* mm, against case.exact; NaN: nothing to compare */
    size_t compared;              /* voxels the errors are over */
    size_t wrong, judged;         /* signs that are wrong, signs looked at */
} bench_row;

typedef struct bench_rows {
    bench_row *items;
    size_t n, capacity;
} bench_rows;

/* The mesh and grid of the command line, with `refine` times finer triangles (--shape alone) and
   voxels `scale` times smaller in the same box. *c is zero-initialised; bench_case_dispose() frees
   it in every case. */
sdm_status bench_case_open(const cli_args *args, double refine, double scale, bench_case *c,
                           sdm_error *err);
void bench_case_dispose(bench_case *c);

/* Fills c->exact, c->winding and adds the rows of this library's own methods. */
sdm_status bench_own(bench_case *c, bench_rows *rows, sdm_error *err);

/* Adds a row for every other program. Those that are missing or fail are rows without figures, no
 * error. */
sdm_status bench_peers(const bench_case *c, const cli_args *args, bench_rows *rows, sdm_error *err);

/* Other programs by name: entry i of their table, NULL beyond its end. */
const char *bench_peer_name(size_t i);

/* One of them: times, memory and errors into *row, its map into values[nz][ny][nx] (NaN: not done),
   which may be NULL. A program that is missing or fails is a row without figures, its note says
   why, no error. */
sdm_status bench_peer(const bench_case *c, const cli_args *args, const char *name, float *values,
                      bench_row *row, sdm_error *err);

/* Appends a row, zero but for its name. */
sdm_status bench_add(bench_rows *rows, const char *name, bench_row **row, sdm_error *err);

/* Is row r = j + ny k of voxels along x in the share? Evenly spread, and rows of a smaller share
 * are in a larger one's. */
bool bench_has_row(double share, int64_t r);

/* c->winding, on all threads, for a share of at most about a million voxels. */
sdm_status bench_find_signs(bench_case *c, sdm_error *err);

/* Errors and signs of values[nz][ny][nx] (NaN: not done) into *row. Errors count where both maps
   are outside if the mesh overlaps itself, where the signs agree if not: surface inside the union
   is no mistake of others. */
void bench_compare(const bench_case *c, const float *values, bench_row *row);

/* Starts a new high-water mark of the resident memory: returns kB resident now, -1: unknown. Then:
 * MB above it. */
long bench_peak_start(void);
double bench_peak_mb(long start);

/* sdmgen bench network MODEL: one map, batches, derivatives and threads, with the share of the
 * machine that is used. */
sdm_status bench_network(const cli_args *args, sdm_error *err);

/* Tables and JSON. bench_report_growth: three grids, then three meshes. */
void bench_print(const bench_case *c, const bench_rows *rows);
void bench_json(sdm_json *j, const bench_case *c, const bench_rows *rows);
void bench_print_growth(const bench_case *cases, const bench_rows *rows, size_t n_grids,
                        size_t n_meshes);

#endif
