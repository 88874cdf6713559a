/* Candidate pairs of triangles whose bounding boxes overlap (sdm_pairs_visit), compared with a loop
 * over all pairs.
 * Tests: pairs.c */
#include <float.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#include <cmocka.h>

#include "oracle/exact_meshes.h"
#include "sdm/internal/rng.h"
#include "solid/pairs.h"

typedef struct visits {
    uint8_t *seen; // [n_tri][n_tri] or NULL
    size_t n_tri, n;
} visits;

static sdm_status visit(void *user, uint32_t i, uint32_t j)
{
    visits *v = user;
    v->n++;
    if (v->seen) v->seen[i * v->n_tri + j]++, v->seen[j * v->n_tri + i]++;
    return SDM_OK;
}

static void visit_pairs(const sdm_mesh *m, double slack, visits *v)
{
    sdm_arena arena = {0};
    sdm_topology topo = {0};
    sdm_bvh tree = {0};
    assert_int_equal(sdm_topology_build(m, &arena, &topo, NULL), SDM_OK);
    assert_int_equal(sdm_bvh_build(m, &arena, &tree, NULL), SDM_OK);
    assert_int_equal(sdm_pairs_visit(m, &topo, &tree, slack, &arena, visit, v, NULL), SDM_OK);
    sdm_arena_dispose(&arena);
}

static bool share_vertex(const sdm_mesh *m, size_t i, size_t j)
{
    for (size_t k = 0; k < 9; k++)
        if (m->tri[3 * i + k / 3] == m->tri[3 * j + k % 3]) return true;
    return false;
}

static bool boxes_apart(const sdm_mesh *m, size_t i, size_t j, double slack)
{
    for (size_t a = 0; a < 3; a++) {
        double lo[2] = {INFINITY, INFINITY}, hi[2] = {-INFINITY, -INFINITY};
        for (size_t c = 0; c < 3; c++) {
            const double x = m->vert[3 * m->tri[3 * i + c] + a],
                         y = m->vert[3 * m->tri[3 * j + c] + a];
            lo[0] = fmin(lo[0], x), hi[0] = fmax(hi[0], x);
            lo[1] = fmin(lo[1], y), hi[1] = fmax(hi[1], y);
        }
        if (lo[0] - slack > hi[1] + slack || lo[1] - slack > hi[0] + slack) return true;
    }
    return false;
}

static void test_pairs_match_brute_force(void **state)
{
    (void)state;
    for (uint64_t round = 0; round < 200; round++) {
        const size_t n = 1 + sdm_rng_below(5, round, 0, 90),
                     n_vert = 3 + sdm_rng_below(5, round, 1, 2 * n);
        const double off = round % 3 ? 0 : 1e6,
                     scale = ldexp(1, (int)sdm_rng_below(5, round, 2, 400) - 200);
        sdm_mesh m = {0};
        mesh_make(&m, n_vert, n);
        for (size_t i = 0; i < 3 * n_vert; i++)
            m.vert[i] = scale * (off + sdm_rng_uniform(6, round, i));
        for (size_t i = 0; i < 3 * n; i++) m.tri[i] = (uint32_t)sdm_rng_below(7, round, i, n_vert);
        if (round % 4 == 0) m.vert[3 * m.tri[0]] = scale * 1e5; // one vertex far away
        visits v = {.seen = calloc(n, n), .n_tri = n};
        if (!v.seen) abort();
        const double slack = 16 * DBL_EPSILON * scale * (off + (round % 4 ? 1 : 1e5));
        visit_pairs(&m, slack, &v);
        for (size_t i = 0; i < n; i++)
            for (size_t j = i; j < n; j++) {
                const unsigned seen = v.seen[i * n + j];
                const bool never = i == j || share_vertex(&m, i, j),
                           must = !never && !boxes_apart(&m, i, j, slack);
                if (never ? seen != 0 : must ? seen != 1 : seen > 1)
                    fail_msg("round %u: pair %zu, %zu was seen %u times", (unsigned)round, i, j,
                             seen);
            }
        free(v.seen);
        sdm_mesh_dispose(&m);
    }
}

// A mesh that is flat at x = 1 and tiny along y and z: the slack exceeds its extent by any factor,
// up to overflow to infinity in single precision.
static void test_slack_beyond_extent(void **state)
{
    (void)state;
    for (double scale = 1e-10; scale >= 1e-300; scale *= 1e-10) {
        const size_t n = 43;
        sdm_mesh m = {0};
        mesh_make(&m, 3 * n, n);
        for (size_t i = 0; i < 3 * n; i++) {
            mesh_vertex(&m, i, 1, scale * sdm_rng_uniform(8, 0, i),
                        scale * sdm_rng_uniform(8, 1, i));
            m.tri[i] = (uint32_t)i;
        }
        visits v = {.seen = calloc(n, n), .n_tri = n};
        if (!v.seen) abort();
        visit_pairs(&m, 16 * DBL_EPSILON, &v);
        for (size_t i = 0; i < n; i++)
            for (size_t j = i; j < n; j++) {
                if (!boxes_apart(&m, i, j, 16 * DBL_EPSILON))
                    assert_int_equal(v.seen[i * n + j], i != j);
            }
        free(v.seen);
        sdm_mesh_dispose(&m);
    }
}

// A distant part makes the slack larger; the number of visited pairs must at most double.
static void test_far_part_adds_few_pairs(void **state)
{
    (void)state;
    size_t n[2];
    for (int far = 0; far < 2; far++) {
        const double at = far ? 1e6 : 100;
        sdm_mesh m = {0}, box = {0};
        mesh_sphere(&m, (const double[3]){0, 0, 0}, 50, 32);
        mesh_box(&box, (const double[3]){at, at, at}, (const double[3]){at + 1, at + 1, at + 1});
        mesh_append(&m, &box);
        visits v = {0};
        visit_pairs(&m, 16 * DBL_EPSILON * at, &v);
        n[far] = v.n;
        sdm_mesh_dispose(&box);
        sdm_mesh_dispose(&m);
    }
    if (n[1] > 2 * n[0]) fail_msg("%zu pairs, %zu with a part far away", n[0], n[1]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_pairs_match_brute_force),
                                       cmocka_unit_test(test_slack_beyond_extent),
                                       cmocka_unit_test(test_far_part_adds_few_pairs)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
