/* Benchmarks: `sdmgen bench exact` measures all ways to make the distance map of one mesh on one
 * grid, `sdmgen bench network` the maps and derivatives of a model. */
#pragma once

#include "args/options.h"
#include "sdm/exact.h"
#include "sdm/model.h"

/* The mesh and the grid of a benchmark, with the exact map as the reference. */
typedef struct cli_bench_case {
    char title[512]; /* the mesh and the grid in words */
    sdm_mesh mesh;
    sdm_grid grid; /* axis-aligned */
    size_t voxels;
    double band_mm; /* errors are measured where abs(distance) < band_mm; INFINITY: everywhere */
    double share;   /* fraction of the voxels that slow programs compute */
    size_t repeat;  /* largest number of runs */
    int threads;    /* for the row with all cores */
    float *exact;   /* [nz][ny][nx] map of the exact engine, the reference for errors, mm */
    float *winding; /* [nz][ny][nx] distance signed by the winding number of the whole mesh; NaN:
                       not computed */
    bool unioned;   /* the mesh overlaps itself; exact is the distance to its union */
} cli_bench_case;

/* The figures of one method or program. Times are processor times of one thread; only the row with
 * all cores has wall-clock times. */
typedef struct cli_bench_row {
    char name[48];
    char note[256]; /* version and method; without figures: the reason */
    bool done;      /* the row has figures */
    double ms_prepare, ms_map;
    double share;                 /* fraction of the voxels computed; ms_map is scaled to all */
    double peak_mb;               /* growth of the resident memory, MiB; NaN: unknown */
    double max_error, mean_error; /* against case.exact, mm; NaN: no voxel compared */
    size_t compared;              /* voxels compared for the errors */
    size_t wrong, judged;         /* voxels with a wrong sign; voxels with a checked sign */
} cli_bench_row;

typedef struct cli_bench_rows {
    cli_bench_row *items;
    size_t n, capacity;
} cli_bench_rows;

/* Opens the mesh and the grid of the command line, with triangles `refine` times finer (only with
 * --shape) and voxels `scale` times smaller in the same box. Zero-initialise *c;
 * cli_bench_case_dispose() frees it, also after an error. */
sdm_status cli_bench_case_open(const cli_args *args, double refine, double scale, cli_bench_case *c,
                               sdm_error *err);
void cli_bench_case_dispose(cli_bench_case *c);

/* Measures the methods of this library: fills c->exact and c->winding and adds the rows. */
sdm_status cli_bench_own(cli_bench_case *c, cli_bench_rows *rows, sdm_error *err);

/* Measures the other programs (peers) and adds a row for each. A program that is missing or fails
 * has a row without figures; that is no error. */
sdm_status cli_bench_peers(const cli_bench_case *c, const cli_args *args, cli_bench_rows *rows,
                           sdm_error *err);

/* Measures the peer `name`: stores times, memory and errors in *row, and its map in
 * values[nz][ny][nx] (NaN: not computed) unless values is NULL. If the program is missing or fails,
 * row->done is false and row->note is the reason; that is no error. */
sdm_status cli_bench_peer(const cli_bench_case *c, const cli_args *args, const char *name,
                          float *values, cli_bench_row *row, sdm_error *err);

/* Appends a row with this name; its other members are zero. *row is valid until the next call. */
sdm_status cli_bench_add(cli_bench_rows *rows, const char *name, cli_bench_row **row,
                         sdm_error *err);

/* True when row r = j + ny k of voxels along x belongs to the share. The rows are evenly spread,
 * and the rows of a smaller share belong to every larger one. */
bool cli_bench_has_row(double share, int64_t r);

/* Fills c->winding on all threads, for at most about a million voxels. */
sdm_status cli_bench_find_signs(cli_bench_case *c, sdm_error *err);

/* Stores the errors and wrong signs of values[nz][ny][nx] (NaN: not computed) in *row. Errors are
 * measured where the signs agree; if the mesh overlaps itself, only outside, because inside other
 * methods measure the distance to surfaces within the union. */
void cli_bench_compare(const cli_bench_case *c, const float *values, cli_bench_row *row);

/* cli_bench_peak_start() resets the peak of the resident memory (Linux) and returns the memory
 * resident now, kB; -1: unknown. cli_bench_peak_mb() returns by how much the peak since then
 * exceeds `start`, MiB; NaN: unknown. */
long cli_bench_peak_start(void);
double cli_bench_peak_mb(long start);

/* Times of a model as a field (sdm/field.h) on one core: new parameters; a map and a band of 3
 * voxels on a grid, points with gradient in a batch and one by one, all without the time of new
 * parameters. */
typedef struct cli_field_times {
    sdm_grid grid;
    double ms_params, ms_map, ms_band, us_point, us_single;
    size_t blocks; /* of the band */
} cli_field_times;

/* Measures a model on the grid of --size. */
sdm_status cli_bench_field(const sdm_model *m, const cli_args *args, uint64_t seed,
                           cli_field_times *t, sdm_error *err);

/* `sdmgen bench network MODEL`: measures one map, batches, derivatives and threads, compares them
 * with the arithmetic and memory speed of the machine, and prints the result. */
sdm_status cli_bench_network(const cli_args *args, sdm_error *err);

/* `sdmgen bench points`: measures exact distances at points, in batches, one by one and by brute
 * force, and prints the result. */
sdm_status cli_bench_points(const cli_args *args, sdm_error *err);

/* Print the table of one case as text, or add it to the JSON. */
void cli_bench_print(const cli_bench_case *c, const cli_bench_rows *rows);
void cli_bench_json(sdm_json *j, const cli_bench_case *c, const cli_bench_rows *rows);

/* Prints total times of cases[n_grids] with growing grids, then of cases[n_meshes] with growing
 * meshes, and the time per voxel or triangle. */
void cli_bench_print_growth(const cli_bench_case *cases, const cli_bench_rows *rows, size_t n_grids,
                            size_t n_meshes);
