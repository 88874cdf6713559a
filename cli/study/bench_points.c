/* sdmgen bench points: time per point of exact distances at many points, one by one, by brute force
 * and by other programs. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "bench.h"
#include "bench_programs.h"
#include "report/terminal.h"
#include "sdm/image.h"
#include "sdm/internal/brute_force.h"
#include "sdm/internal/clock.h"
#include "sdm/internal/npy.h"
#include "sdm/internal/rng.h"
#include "sdm/internal/vec3.h"
#include "sdm/memory.h"

#define MOST 100000  // points of the largest batch
#define SINGLE 10000 // points that are computed one by one
#define NAIVE 20     // points that are computed by brute force
#define OTHERS 10000 // points that other programs compute, the first of all; that of a row
#define SEED 2026
// "near the surface": up to this fraction of the diagonal away from it along each axis
#define NEAR 0.015

enum { BATCH, WHOLE, ONE_BY_ONE, BRUTE_FORCE };

static const struct {
    const char *name;
    int kind;
    size_t n;
} rows[] = {{"batch of 1000", BATCH, 1000},     {"batch of 10000", BATCH, 10000},
            {"batch of 100000", BATCH, MOST},   {"and preparation", WHOLE, MOST},
            {"one by one", ONE_BY_ONE, SINGLE}, {"naive", BRUTE_FORCE, NAIVE}};
enum { N_ROWS = sizeof rows / sizeof *rows };

typedef struct bench_points {
    const sdm_mesh *mesh;
    sdm_exact *engine, *all_cores;
    int n_threads;        /* of all_cores */
    double *x, *distance; /* [MOST][3], [MOST] */
} bench_points;

static double triangle_area(const sdm_mesh *m, size_t t)
{
    const double *p[3];
    double normal[3];
    for (size_t k = 0; k < 3; k++) p[k] = &m->vert[3 * (size_t)m->tri[3 * t + k]];
    v3_triangle_normal(p[0], p[1], p[2], normal);
    return 0.5 * v3_norm(normal);
}

/* Random points in twice the bounding box, or near the surface, evenly over its area. */
static void draw_points(const bench_points *b, bool near)
{
    const sdm_mesh *m = sdm_exact_surface(b->engine);
    const sdm_audit *box = &sdm_exact_get_report(b->engine)->audit;
    double diagonal = 0, area = 0, passed = 0;
    for (int a = 0; a < 3; a++)
        diagonal += (box->max[a] - box->min[a]) * (box->max[a] - box->min[a]);
    for (size_t t = 0; t < m->n_tri; t++) area += triangle_area(m, t);
    diagonal = sqrt(diagonal);
    // the points near the surface pass from triangle to triangle in equal steps of area
    size_t t = 0;
    for (size_t i = 0; i < MOST; i++) {
        const double u = sdm_rng_uniform(SEED, i, 0), v = (1 - u) * sdm_rng_uniform(SEED, i, 1);
        while (near && t + 1 < m->n_tri && passed + triangle_area(m, t) < area * (double)i / MOST)
            passed += triangle_area(m, t++);
        for (size_t a = 0; a < 3; a++) {
            const double *p[3];
            for (size_t k = 0; k < 3; k++) p[k] = &m->vert[3 * (size_t)m->tri[3 * t + k]];
            const double shift = 2 * sdm_rng_uniform(SEED, i, 2 + a) - 1;
            b->x[3 * i + a] =
                near ? p[0][a] + u * (p[1][a] - p[0][a]) + v * (p[2][a] - p[0][a]) +
                           NEAR * diagonal * shift
                     : 0.5 * (box->min[a] + box->max[a]) + (box->max[a] - box->min[a]) * shift;
        }
    }
    // random order
    for (size_t i = MOST; i-- > 1;) {
        const size_t k = (size_t)sdm_rng_below(SEED, i, 5, i + 1);
        for (size_t a = 0; a < 3; a++) {
            const double swap = b->x[3 * i + a];
            b->x[3 * i + a] = b->x[3 * k + a];
            b->x[3 * k + a] = swap;
        }
    }
}

/* Does a row use all cores, too? */
static bool is_parallel(int row) { return rows[row].kind == BATCH || rows[row].kind == WHOLE; }

/* Prepares the mesh and computes the distances at all points. */
static sdm_status run_whole(const bench_points *b, int n_threads, sdm_error *err)
{
    sdm_exact *engine = NULL;
    sdm_status s =
        sdm_exact_create(b->mesh, &(sdm_exact_opts){.n_threads = n_threads}, &engine, err);
    if (!s) s = sdm_exact_points(engine, b->x, MOST, &(sdm_exact_at){.distance = b->distance}, err);
    sdm_exact_free(engine);
    return s;
}

/* Seconds of one run of a row. */
static sdm_status run_row(const bench_points *b, int row, const sdm_exact *engine, double *seconds,
                          sdm_error *err)
{
    const double start = sdm_clock();
    sdm_status s = SDM_OK;
    if (rows[row].kind == BATCH)
        s = sdm_exact_points(engine, b->x, rows[row].n, &(sdm_exact_at){.distance = b->distance},
                             err);
    if (rows[row].kind == WHOLE) s = run_whole(b, engine == b->engine ? 1 : b->n_threads, err);
    for (size_t i = 0; i < rows[row].n && rows[row].kind == ONE_BY_ONE; i++)
        b->distance[i] = sdm_exact_point(engine, b->x + 3 * i, NULL, NULL, NULL);
    for (size_t i = 0; i < rows[row].n && rows[row].kind == BRUTE_FORCE; i++)
        b->distance[i] = sdm_naive_point(b->mesh, b->x + 3 * i);
    *seconds = sdm_clock() - start;
    return s;
}

/* Microseconds per point of a row, the fastest of `repeat` runs. */
static sdm_status measure_row(const bench_points *b, int row, const sdm_exact *engine,
                              size_t repeat, double *us, sdm_error *err)
{
    *us = INFINITY;
    for (size_t r = 0; r < repeat; r++) {
        double seconds;
        sdm_status s = run_row(b, row, engine, &seconds, err);
        if (!s) s = cli_check_interrupt(err);
        if (s) return s;
        *us = fmin(*us, 1e6 * seconds / (double)rows[row].n);
    }
    return SDM_OK;
}

/* The figures of another program at OTHERS points; us is NAN where it has none, and the note says
 * why. */
typedef struct other {
    const char *name; /* of *peers */
    char note[256];
    double us[2];      /* microseconds per point, [random, near] */
    double difference; /* largest one from the exact distance, outside, mm */
} other;

/* Microseconds per point of all rows, [random, near], by one thread and by all. */
typedef struct times {
    double one[2][N_ROWS], all[2][N_ROWS];
    cli_peers peers;
    other *others; /* [peers.n] */
} times;

/* The row with as many points as other programs compute. */
static size_t row_of_others(void)
{
    size_t row = 0;
    while (rows[row].n != OTHERS || rows[row].kind != BATCH) row++;
    return row;
}

/* Stores in *o the largest difference of a program's values from b->distance outside the surface:
 * inside, programs that know no union measure to the triangles within it. */
static void compare(const bench_points *b, const char *path, other *o)
{
    double *values = NULL;
    size_t shape[4] = {0};
    int n_dim = 0;
    sdm_error err = {0};
    const sdm_status s = sdm_npy_read(path, &values, shape, &n_dim, &err);
    if (s || shape[0] != OTHERS || n_dim > 2 || (n_dim == 2 && shape[1] != 1))
        snprintf(o->note, sizeof o->note, "%.200s",
                 s ? err.text : "its values are not those of the points");
    for (size_t i = 0; !*o->note && i < OTHERS; i++)
        if (b->distance[i] > 0)
            o->difference = fmax(o->difference, fabs(values[i] - b->distance[i]));
    sdm_free(values);
}

/* Measures all other programs at the first points, b->distance of which are known. */
static sdm_status measure_others(const bench_points *b, size_t repeat, bool near, times *t,
                                 sdm_error *err)
{
    char runs[32], *argument[2] = {t->peers.points_path, runs};
    snprintf(runs, sizeof runs, "%zu", repeat);
    sdm_status s =
        sdm_npy_write_double(t->peers.points_path, b->x, (const size_t[]){OTHERS, 3}, 2, err);
    for (size_t i = 0; i < t->peers.n && !s; i++) {
        other *o = &t->others[i];
        cli_peer_answer answer;
        if (near && isnan(o->us[0])) continue;
        s = cli_peers_run(&t->peers, o->name, argument, 2, &answer, err);
        if (!s && answer.done) compare(b, t->peers.values_path, o);
        if (!s && !answer.done) memcpy(o->note, answer.note, sizeof o->note);
        if (!s && answer.done && !*o->note) o->us[near] = 1e3 * answer.ms_map / OTHERS;
        if (!s && near && answer.done && !*o->note) memcpy(o->note, answer.note, sizeof o->note);
        if (!s) s = cli_check_interrupt(err);
    }
    return s;
}

static sdm_status measure(const bench_points *b, size_t repeat, times *t, sdm_error *err)
{
    sdm_status s = SDM_OK;
    for (int near = 0; near < 2 && !s; near++) {
        draw_points(b, near);
        for (int row = 0; row < N_ROWS && !s; row++) {
            s = measure_row(b, row, b->engine, repeat, &t->one[near][row], err);
            t->all[near][row] = NAN;
            if (!s && is_parallel(row))
                s = measure_row(b, row, b->all_cores, repeat, &t->all[near][row], err);
        }
        if (!s && t->peers.n)
            s = measure_row(b, (int)row_of_others(), b->engine, 1, &(double){0}, err);
        if (!s && t->peers.n) s = measure_others(b, repeat, near, t, err);
    }
    return s;
}

/* Opens the other programs. */
static sdm_status open_others(const cli_bench_case *c, const cli_args *args, times *t,
                              sdm_error *err)
{
    if (args->peers && !strcmp(args->peers, "none")) return SDM_OK;
    sdm_status s = cli_peers_open(args->peers, &c->mesh, &t->peers, err);
    if (!s) s = SDM_ALLOC(&t->others, t->peers.n, "other programs", err);
    for (size_t i = 0; i < t->peers.n && !s; i++)
        t->others[i] = (other){.name = t->peers.names[i], .us = {NAN, NAN}};
    return s;
}

/* The other programs that have figures, then the reasons of those that have none. */
static void print_others(const times *t)
{
    const double *own[2] = {t->one[0], t->one[1]};
    const size_t row = row_of_others();
    if (!t->peers.n) return;
    printf("\nother programs, %d points, without preparation (times \"%s\"):\n", OTHERS,
           rows[row].name);
    for (size_t i = 0; i < t->peers.n; i++) {
        const other *o = &t->others[i];
        if (isnan(o->us[1])) continue;
        printf("  %-16s %9.3f %9.3f   x %.0f, x %.0f; largest difference outside %.1e mm\n",
               o->name, o->us[0], o->us[1], o->us[0] / own[0][row], o->us[1] / own[1][row],
               o->difference);
    }
    for (size_t i = 0; i < t->peers.n; i++)
        printf("  %s: %s\n", t->others[i].name, t->others[i].note);
}

static void print_times(const cli_bench_case *c, double ms_build, const times *t)
{
    printf("%zu triangles, preparation %.2f ms; signed distances, microseconds per point, the "
           "fastest of %zu runs\n\n",
           c->mesh.n_tri, ms_build, c->repeat);
    printf("  %-16s %19s %16d threads\n", "", "one thread", c->threads);
    printf("  %-16s %9s %9s   %9s %9s\n", "", "random", "near", "random", "near");
    for (int row = 0; row < N_ROWS; row++) {
        printf("  %-16s %9.3f %9.3f", rows[row].name, t->one[0][row], t->one[1][row]);
        if (is_parallel(row)) printf("   %9.3f %9.3f", t->all[0][row], t->all[1][row]);
        printf("\n");
    }
    printf("\nrandom: in twice the bounding box; near: up to %g of its diagonal from the surface "
           "along each axis\n",
           NEAR);
    print_others(t);
}

static sdm_status print_times_json(const cli_bench_case *c, double ms_build, const times *t,
                                   sdm_error *err)
{
    sdm_json j = {0};
    sdm_json_open(&j, NULL, '{');
    sdm_json_int(&j, "triangles", (int64_t)c->mesh.n_tri);
    sdm_json_real(&j, "ms_build", ms_build);
    sdm_json_int(&j, "threads", c->threads);
    sdm_json_open(&j, "rows", '[');
    for (int row = 0; row < N_ROWS; row++) {
        sdm_json_open(&j, NULL, '{');
        sdm_json_text(&j, "name", rows[row].name);
        sdm_json_int(&j, "points", (int64_t)rows[row].n);
        sdm_json_real(&j, "us_random", t->one[0][row]);
        sdm_json_real(&j, "us_near", t->one[1][row]);
        sdm_json_real(&j, "us_random_all", t->all[0][row]);
        sdm_json_real(&j, "us_near_all", t->all[1][row]);
        sdm_json_close(&j, '}');
    }
    sdm_json_close(&j, ']');
    sdm_json_open(&j, "peers", '[');
    for (size_t i = 0; i < t->peers.n; i++) {
        const other *o = &t->others[i];
        sdm_json_open(&j, NULL, '{');
        sdm_json_text(&j, "name", o->name);
        sdm_json_int(&j, "points", OTHERS);
        sdm_json_real(&j, "us_random", o->us[0]);
        sdm_json_real(&j, "us_near", o->us[1]);
        sdm_json_real(&j, "max_difference_mm", isnan(o->us[1]) ? NAN : o->difference);
        sdm_json_text(&j, "note", o->note);
        sdm_json_close(&j, '}');
    }
    sdm_json_close(&j, ']');
    sdm_json_close(&j, '}');
    return cli_print_json(&j, err);
}

sdm_status cli_bench_points(const cli_args *args, sdm_error *err)
{
    cli_bench_case c = {0};
    bench_points b = {.mesh = &c.mesh};
    times t = {.others = NULL};
    sdm_status s = cli_bench_case_open(args, 1, 1, &c, err);
    if (!s) s = sdm_exact_create(&c.mesh, &(sdm_exact_opts){.n_threads = 1}, &b.engine, err);
    if (!s)
        s = sdm_exact_create(&c.mesh, &(sdm_exact_opts){.n_threads = c.threads}, &b.all_cores, err);
    b.n_threads = c.threads;
    if (!s) s = SDM_ALLOC(&b.x, 3 * (size_t)MOST, "points", err);
    if (!s) s = SDM_ALLOC(&b.distance, MOST, "distances", err);
    if (!s) s = open_others(&c, args, &t, err);
    if (!s) s = measure(&b, c.repeat, &t, err);
    if (!s) {
        const double ms_build = sdm_exact_get_report(b.engine)->ms_build;
        if (args->json)
            s = print_times_json(&c, ms_build, &t, err);
        else
            print_times(&c, ms_build, &t);
    }
    cli_peers_close(&t.peers);
    sdm_free(t.others);
    sdm_free(b.x);
    sdm_free(b.distance);
    sdm_exact_free(b.engine);
    sdm_exact_free(b.all_cores);
    cli_bench_case_dispose(&c);
    return s;
}
