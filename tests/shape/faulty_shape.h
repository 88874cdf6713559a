/* A shape for tests: a body and a handle, two boxes that overlap; the option `fault` selects what
 * is wrong with them. Some faults begin where size exceeds 2; `trained`, `changed` and `moved`
 * begin when the file trained/model.sdm is there. */
#ifndef SDM_TEST_FAULTY_SHAPE_H
#define SDM_TEST_FAULTY_SHAPE_H

#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "sdm/shape.h"

static const sdm_param FAULTY_PARAMS[] = {{"size", "mm", 1, 3, 2.5, "edge of the body"},
                                          {"reach", "mm", 1, 2, 1.5, "length of the handle"}};
static const sdm_option FAULTY_OPTIONS[] = {
    {"fault", SDM_OPTION_CHOICE, "", 0, 0, 0,
     "none|handle|body|late|jump|kink|sizes|wires|open|fail|velocity|unlike|crash|abort|"
     "exit|trained|metres|hang|flood|heap|beyond|before|print|write|shared|"
     "edge|centimetres|small|wall|step|apart|within|twins|changed|moved|wound|behind|unset|"
     "meets|groups|crumb|spare|offset|around|unlisted|sticky|diagonal|negative|window|swapped|"
     "cache|caches|lapse|pair|hidden|grows|posts|"
     "inverted|averted|converted|mixed|lever|tenfold|ringlet",
     "x"}};

/* Writes box number `box`: 8 vertices, 12 triangles. */
static inline void faulty_box(sdm_mesh_out *out, size_t box, const double low[3],
                              const double high[3], int inside_out)
{
    static const uint32_t TRI[36] = {0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6, 0, 1, 5, 0, 5, 4,
                                     2, 6, 7, 2, 7, 3, 0, 4, 6, 0, 6, 2, 1, 3, 7, 1, 7, 5};
    for (size_t i = 0; i < 8; i++)
        for (size_t d = 0; d < 3; d++)
            out->vert[3 * (8 * box + i) + d] = i >> d & 1 ? high[d] : low[d];
    for (size_t i = 0; i < 36; i++) {
        const size_t corner = inside_out && i % 3 ? i - i % 3 + 3 - i % 3 : i;
        out->tri[36 * box + i] = (uint32_t)(8 * box) + TRI[corner];
    }
}

/* A prism whose outline, of 9 points, goes round three times: 20 vertices, 36 triangles. They come
 * after so many boxes. */
static inline void faulty_wound(const double *p, size_t boxes, sdm_mesh_out *out)
{
    enum { SIDES = 9 };
    double *vert = out->vert + 24 * boxes;
    for (int i = 0; i < SIDES; i++)
        for (int end = 0; end < 2; end++) {
            double *v = vert + 3 * (2 * i + end);
            const double angle = 2.0943951023931953 * i, r = p[0] * (1 + 0.05 * i);
            v[0] = r * cos(angle), v[1] = r * sin(angle), v[2] = end ? p[1] : -p[1];
        }
    for (int i = 0; i < 6; i++) vert[6 * SIDES + i] = i % 3 < 2 ? 0 : i < 3 ? -p[1] : p[1];
    for (uint32_t i = 0; i < SIDES; i++) {
        const uint32_t a = 2 * i, b = 2 * ((i + 1) % SIDES), low = 2 * SIDES;
        const uint32_t tri[12] = {a, b, b + 1, a, b + 1, a + 1, low, b, a, low + 1, a + 1, b + 1};
        for (size_t k = 0; k < 12; k++)
            out->tri[36 * boxes + 12 * i + k] = (uint32_t)(8 * boxes) + tri[k];
    }
}

/* A mast and a handle that meet from a reach of 1.6 on inside of the body (`hidden`), that meet
 * inside of the body always and from there on above it (`grows`), or that stand in the body and
 * meet from there on (`posts`). */
static inline int faulty_is_posts(const char *fault)
{
    return !strcmp(fault, "hidden") || !strcmp(fault, "grows") || !strcmp(fault, "posts");
}

static inline void faulty_posts(const char *fault, const double *p, sdm_mesh_out *out,
                                double handle[2][3])
{
    static const double MAST[2][3] = {{-0.3, -0.3, 0}, {0.3, 0.3, 4}};
    const int grows = !strcmp(fault, "grows"), posts = !strcmp(fault, "posts");
    handle[0][0] = grows ? -0.1 : 1.9 - p[1];
    if (posts) handle[1][0] = handle[0][0] + 0.5;
    if (grows) handle[1][2] = p[0] + p[1] - 1.6;
    if (posts) handle[1][2] = 3.5;
    faulty_box(out, 2, MAST[0], MAST[1], 0);
}

/* How fast vertex v of the handle and the mast moves along axis d, by the size and by the reach. */
static inline void faulty_posts_velocity(const char *fault, size_t v, size_t d, double by[2])
{
    const int grows = !strcmp(fault, "grows"), posts = !strcmp(fault, "posts"),
              far = v & 1 && !posts, top = d == 2 && v >> 2 & 1 && grows;
    by[0] = v < 16 && ((d == 0 && far) || top);
    by[1] = v >= 16 ? 0 : d == 0 ? (far ? 1 : grows ? 0 : -1) : top;
}

/* Faults that a process of its own keeps from the program. */
static inline void faulty_process(const char *fault)
{
    if (!strcmp(fault, "crash")) raise(SIGSEGV);
    if (!strcmp(fault, "abort")) abort();
    if (!strcmp(fault, "exit")) exit(0);
    if (!strcmp(fault, "print")) puts("a line for the user");
    while (!strcmp(fault, "hang")) pause();
    while (!strcmp(fault, "flood")) {
        char *volatile block = (char *)malloc(1 << 20);
        memset(block, 1, 1 << 20);
    }
    if (!strcmp(fault, "heap")) {
        char *volatile block = (char *)malloc(24);
        volatile char *byte = block;
        for (int i = -8; i < 0; i++) byte[i] = (char)-1; // where malloc() keeps the size
        free(block);
    }
}

/* Faults with the arrays of the host. */
static inline void faulty_arrays(const char *fault, const double *p, sdm_mesh_out *out)
{
    double *volatile vert = out->vert;
    if (!strcmp(fault, "beyond")) vert[3 * out->n_vert + 2] = 1;
    if (!strcmp(fault, "before")) vert[-1] = 1;
    if (!strcmp(fault, "write")) *(double *)p = 1;
}

/* Reads a variable that it has not written: 0.1 where it is about 32.5, else 0. */
static inline double faulty_unset(void)
{
    double row[64];
    double *volatile at = row; // so that the compiler does not know
    return at[32] > 32 && at[32] < 33 ? 0.1 : 0;
}

/* What a thread keeps from its last call: `cache`, the reach at which the size was another one than
 * in the call before, and `lapse`, the size at which the reach was another one. `caches`: the reach
 * at which a size came for the first time, for the last sizes. */
static inline double faulty_kept(const char *fault, const double *p, double *reach)
{
    static _Thread_local double key, kept, key_size[64], kept_reach[64];
    static _Thread_local size_t used;
    const int size = strcmp(fault, "lapse") != 0; // compares the size
    size_t i = 0;
    if (!strcmp(fault, "caches")) {
        while (i < 64 && key_size[i] != p[0]) i++;
        if (i == 64) {
            i = used++ % 64;
            key_size[i] = p[0];
            kept_reach[i] = p[1];
        }
        *reach = 0.5 * (p[1] + kept_reach[i]);
    } else if (key != p[!size]) {
        key = p[!size];
        kept = p[size];
    }
    if (!strcmp(fault, "cache")) *reach = 0.5 * (p[1] + kept);
    return !size && p[0] > 2.19 && p[0] < 2.3 ? kept : p[0];
}

static int faulty_mesh(const void *self, const sdm_host *host, const sdm_option_value *options,
                       const double *p, sdm_mesh_out *out)
{
    static _Atomic int calls;
    (void)self;
    const char *fault = options[0].text;
    const int is_large = p[0] > 2;
    if (!strcmp(fault, "edge") && !(p[0] >= 1 && p[0] <= 3)) abort();
    // in parentheses: cmocka defines a macro fail()
    if (!strcmp(fault, "fail") && is_large) return (host->fail)(host, "too large");
    if (!strcmp(fault, "unlisted") && !(p[2] > 3)) return (host->fail)(host, "too short");
    if (!strcmp(fault, "trained") && !access("trained/model.sdm", F_OK))
        return (host->fail)(host, "a model is there");
    if (is_large) faulty_process(fault);
    if (!strcmp(fault, "wound") || !strcmp(fault, "around")) {
        // alone, or around a box
        const size_t box = !strcmp(fault, "around");
        const int none = host->reserve(host, out, 8 * box + 20, 12 * box + 36);
        const double corner[2][3] = {{-p[0], -p[0], -p[0]}, {p[0], p[0], p[0]}};
        if (!none && box) faulty_box(out, 0, corner[0], corner[1], 0);
        if (!none) faulty_wound(p, box, out);
        return none;
    }
    const int groups = !strcmp(fault, "groups"); // body and mast, handle and knob
    const int crumb = !strcmp(fault, "crumb");   // a part in m, which lies inside the body
    const int stand = faulty_is_posts(fault);
    const size_t boxes = groups                                                    ? 4
                         : stand || crumb || (!strcmp(fault, "sizes") && is_large) ? 3
                                                                                   : 2;
    const int inverted = !strcmp(fault, "inverted"); // the whole mesh
    const size_t less = !strcmp(fault, "open");
    // 8 vertices far away, which no triangle uses
    const size_t spare = strcmp(fault, "spare") ? 0 : 8;
    const int failed = host->reserve(host, out, 8 * boxes + spare, 12 * boxes - less);
    if (failed) return failed;
    double shift = 0;
    if (!strcmp(fault, "jump")) shift = is_large ? 0.125 : 0;
    if (!strcmp(fault, "kink")) shift = fabs(p[0] - 2) / 4;
    if (!strcmp(fault, "unlike")) shift = 1e-6 * ++calls;
    if (!strcmp(fault, "behind")) shift = 0.01 * p[3];
    if (!strcmp(fault, "unset")) shift = faulty_unset();
    if (!strcmp(fault, "moved") && !access("trained/model.sdm", F_OK)) shift = 0.125;
    static volatile double shared; // for threads that call at once
    shared = p[0];
    for (int i = 0; i < 20000 && !strcmp(fault, "shared"); i++) shift += 0 * shared;
    double r = !strcmp(fault, "shared") ? shared : p[0];
    static double sticky; // of the first shape
    if (!(sticky > 0)) sticky = p[0];
    if (!strcmp(fault, "sticky")) r = sticky;
    double kept_reach = p[1];
    if (!strncmp(fault, "cache", 5) || !strcmp(fault, "lapse"))
        r = faulty_kept(fault, p, &kept_reach);
    if (!strcmp(fault, "changed") && !access("trained/model.sdm", F_OK)) r *= 1.01;
    const double body[2][3] = {{-r, -r, -r}, {r, r, r}};
    // `wall`: the sides of the handle pass through each other at size 1.75; `step`: a reach above
    // 1.75 counts, and nothing but that
    const double half = !strcmp(fault, "wall") ? p[0] - 1.75 : 0.25,
                 reach = !strncmp(fault, "cache", 5) ? kept_reach
                         : strcmp(fault, "step")     ? p[1]
                                                     : 1 + (p[1] > 1.75);
    // `meets`: the handle meets the body up to a reach of 1.6; `averted`: it is inside out beside
    // it
    const double begin =
        !strcmp(fault, "meets")
            ? p[0] + reach - 1.6
            : p[0] + (strcmp(fault, "apart") && strcmp(fault, "averted") && !groups ? -0.5 : 0.5);
    double handle[2][3] = {{begin, -half, -half + shift}, {p[0] + reach, half, half + shift}};
    // `negative`: the height of the handle becomes negative at size 2; `swapped`: its ends change
    // places there; `pair`: the height becomes negative at a reach of the size and 0.25
    if (!strcmp(fault, "negative")) handle[0][1] = -1, handle[1][1] = 1 - p[0];
    if (!strcmp(fault, "pair")) handle[0][1] = -1, handle[1][1] = p[0] - p[1] - 0.75;
    if (!strcmp(fault, "swapped") && is_large) handle[0][1] = half, handle[1][1] = -half;
    // `tenfold`: a length in cm among others in mm
    if (!strcmp(fault, "tenfold")) handle[1][0] = p[0] + 10 * reach;
    // `converted`: a length in m among others in mm; `mixed`: the size is in m in the handle alone;
    // `lever`: it moves the handle as little, but not everywhere alike
    // `ringlet`: all three edges of the handle are a length in m, its place is in mm
    for (size_t i = 0; i < 6 && !strcmp(fault, "ringlet"); i++)
        handle[i / 3][i % 3] = (i % 3 ? 0 : p[0]) + (i < 3 ? -0.001 : 0.001) * reach;
    if (!strcmp(fault, "converted")) handle[1][0] = p[0] + 0.001 * reach;
    if (!strcmp(fault, "mixed") || !strcmp(fault, "lever")) {
        const double more = !strcmp(fault, "mixed") ? 0.0005 * p[0] : 0.0001 * p[0] * p[0];
        handle[0][0] = 0.5, handle[1][0] = 2.5 + reach;
        handle[0][1] -= more, handle[1][1] += more;
    }
    if (!strcmp(fault, "within")) handle[0][0] -= 1, handle[1][0] -= 2.2;
    if (!strcmp(fault, "twins")) memcpy(handle, body, sizeof handle);
    if (groups) {
        const double end = p[0] + reach, mast[2][3] = {{-0.3, -0.3, 0}, {0.3, 0.3, 4}},
                     knob[2][3] = {{end - 0.125, -0.5, -0.5}, {end + 0.5, 0.5, 0.5}};
        faulty_box(out, 2, knob[0], knob[1], 0);
        faulty_box(out, 3, mast[0], mast[1], 0);
    }
    if (stand) faulty_posts(fault, p, out, handle);
    if (boxes == 3 && !stand) {
        const double unit = crumb ? 0.001 : 1, edge = crumb ? 15 * unit : 11;
        const double far[2][3] = {{10 * unit, 10 * unit, 10 * unit}, {edge, edge, edge}};
        faulty_box(out, 2, far[0], far[1], 0);
    }
    faulty_box(out, 0, body[0], body[1], !strcmp(fault, "body") || inverted);
    // the last box, so that `open` leaves out its last triangle
    sdm_mesh_out all = *out;
    uint32_t tri[72];
    if (less) all.tri = tri;
    faulty_box(&all, 1, handle[0], handle[1],
               inverted || !strcmp(fault, "averted") || !strcmp(fault, "handle") ||
                   (!strcmp(fault, "late") && is_large) ||
                   (!strcmp(fault, "window") && p[1] > 1.25 && p[1] < 1.75 && p[0] < 2.9));
    if (less) memcpy(out->tri + 36, tri + 36, 33 * sizeof *tri);
    if (!strcmp(fault, "wires") && is_large) {
        // the other diagonal of the first face
        static const uint32_t OTHER[6] = {0, 2, 1, 1, 2, 3};
        memcpy(out->tri, OTHER, sizeof OTHER);
    }
    // a corner of the body just beyond the diagonal of its face: the two triangles of it overlap
    for (size_t d = 0; d < 2 && !strcmp(fault, "diagonal"); d++)
        out->vert[18 + d] = (d ? -0.02 : 0.02) * r;
    for (size_t i = 0; i < 3 * spare; i++) out->vert[24 * boxes + i] = 500;
    // the handle has vertices of the body, and leaves out its last four
    for (size_t i = 36; i < 72 && !strcmp(fault, "offset"); i++) out->tri[i] -= 4;
    for (size_t i = 0; i < 24 * boxes && !strcmp(fault, "metres"); i++) out->vert[i] /= 1000;
    for (size_t i = 0; i < 24 * boxes && !strcmp(fault, "centimetres"); i++) out->vert[i] /= 10;
    for (size_t i = 24; i < 48 && !strcmp(fault, "small"); i++) out->vert[i] /= 1000; // the handle
    if (is_large) faulty_arrays(fault, p, out);
    return 0;
}

static int faulty_velocity(const void *self, const sdm_host *host, const sdm_option_value *options,
                           const double *p, size_t n_vert, double *velocity)
{
    (void)self, (void)host;
    const int wrong = !strcmp(options[0].text, "velocity"),
              moves = !strcmp(options[0].text, "meets"), // both ends of the handle
        spare = !strcmp(options[0].text, "spare");
    memset(velocity, 0, 6 * n_vert * sizeof *velocity);
    for (size_t v = 0; v < n_vert; v++) {
        for (size_t d = 0; d < 3 && v < 8; d++) velocity[3 * v + d] = v >> d & 1 ? 1 : -1;
        for (size_t d = 0; d < 3 && v >= 8 && faulty_is_posts(options[0].text); d++) {
            double by[2];
            faulty_posts_velocity(options[0].text, v, d, by);
            velocity[3 * v + d] = by[0];
            velocity[3 * (n_vert + v) + d] = by[1];
        }
        if (faulty_is_posts(options[0].text)) continue;
        if (v < 8 || v >= 24 || (spare && v >= 16)) continue;
        velocity[3 * v] = 1;
        velocity[3 * (n_vert + v)] = moves || v >= 16 || v & 1 ? (wrong ? 1.01 : 1) : 0;
    }
    const double by_size = !strcmp(options[0].text, "mixed")   ? 0.0005
                           : !strcmp(options[0].text, "lever") ? 0.0002 * p[0]
                                                               : 0;
    for (size_t v = 8; v < 16 && by_size > 0; v++)
        velocity[3 * v] = 0, velocity[3 * v + 1] = v >> 1 & 1 ? by_size : -by_size;
    for (size_t v = 8; v < 16 && !strcmp(options[0].text, "converted"); v++)
        velocity[3 * (n_vert + v)] *= 0.001;
    for (size_t v = 8; v < 16 && !strcmp(options[0].text, "tenfold"); v++)
        velocity[3 * (n_vert + v)] *= 10;
    for (size_t d = 0; d < 2 && !strcmp(options[0].text, "diagonal"); d++)
        velocity[18 + d] = d ? -0.02 : 0.02;
    return 0;
}

static int faulty_open_end(const void *self, const sdm_host *host, const sdm_option_value *options,
                           const double *p, sdm_open_end *out)
{
    (void)self, (void)host, (void)options;
    *out = (sdm_open_end){
        .centre = {p[0], 0.3 * p[1], -1}, .outward = {0.1, p[1], -2}, .radius = p[0] * p[1]};
    return 0;
}

static const sdm_shape FAULTY = {.abi = SDM_SHAPE_ABI,
                                 .size = sizeof(sdm_shape),
                                 .name = "faulty",
                                 .summary = "test",
                                 .params = FAULTY_PARAMS,
                                 .n_params = 2,
                                 .options = FAULTY_OPTIONS,
                                 .n_options = 1,
                                 .mesh = faulty_mesh,
                                 .velocity = faulty_velocity,
                                 .open_end = faulty_open_end};
#endif
