/* Which sections of a map are drawn: a part or a hole beside the middle moves one, a shape that the
 * middle shows moves none; pieces of the inside, and those that no section cuts.
 * Tests: inside_pieces.c section_choice.c sections.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "picture/section_choice.h"
#include "picture/sections.h"
#include "sdm/internal/rng.h"
#include "sdm/memory.h"

enum { N = 40 };

typedef bool is_inside(double x, double y, double z);

/* The map of a shape on n voxels of 1 mm that begin at 0: -1 inside, 1 outside. */
static float *make_map(const int64_t n[3], is_inside *inside, sdm_grid *g)
{
    *g = (sdm_grid){
        .n = {n[0], n[1], n[2]}, .spacing = {1, 1, 1}, .dir = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
    float *v = malloc(sdm_grid_count(g) * sizeof *v), *out = v;
    assert_non_null(v);
    for (int64_t k = 0; k < n[2]; k++)
        for (int64_t j = 0; j < n[1]; j++)
            for (int64_t i = 0; i < n[0]; i++)
                *out++ = inside((double)i, (double)j, (double)k) ? -1 : 1;
    return v;
}

static void choose(is_inside *inside, int64_t at[3])
{
    sdm_grid g;
    float *v = make_map((const int64_t[]){N, N, N}, inside, &g);
    sdm_error err = {0};
    if (sdm_sections_choose(&g, v, at, &err)) fail_msg("%s", err.text);
    free(v);
}

/* A column along z with two fins along the diagonals of x and y at its lower end. */
static bool in_finned(double x, double y, double z)
{
    const double u = x - 20, w = y - 20;
    const bool fin = z >= 4 && z <= 9 && hypot(u, w) < 16 && (fabs(u - w) < 2 || fabs(u + w) < 2);
    return fin || (hypot(u, w) < 5 && z >= 2 && z <= 37);
}

/* A plate with a hole, and a wall at one of its ends. */
static bool in_drilled(double x, double y, double z)
{
    const bool plate = z >= 2 && z <= 5 && x >= 2 && x <= 37, wall = x >= 2 && x <= 5 && z >= 2;
    return (plate || wall) && z <= 37 && y >= 2 && y <= 37 && hypot(x - 28, y - 11) > 3;
}

/* A cup with a handle, a half ring that lies in the plane y = 9. */
static bool in_cup(double x, double y, double z)
{
    const double r = hypot(x - 14, y - 20), ring = hypot(x - 24, z - 20);
    const bool cup = r < 13 && z >= 2 && z <= 37 && (r > 10 || z < 5),
               handle = hypot(ring - 9, y - 9) < 2.2 && x > 20 && r > 11;
    return cup || handle;
}

static bool in_ring(double x, double y, double z)
{
    return hypot(hypot(x - 20, y - 20) - 17, z - 20) < 2;
}

static bool in_ball(double x, double y, double z)
{
    return hypot(hypot(x - 20, y - 20), z - 20) < 11;
}

static bool in_nothing(double x, double y, double z) { return x + y + z < -1; }

static void test_sections_show_every_part(void **state)
{
    (void)state;
    int64_t at[3];
    choose(in_finned, at); // the middle is at z = 19
    assert_true(at[2] >= 4 && at[2] <= 9);
    assert_int_equal(at[0], 20);
    assert_int_equal(at[1], 20);
    choose(in_drilled, at);
    assert_true(at[2] >= 2 && at[2] <= 5);
    choose(in_cup, at);
    assert_true(at[1] >= 7 && at[1] <= 11);
}

static void test_sections_stay_in_the_middle(void **state)
{
    (void)state;
    static is_inside *const shapes[] = {in_ring, in_ball};
    int64_t at[3];
    for (size_t i = 0; i < 2; i++) {
        choose(shapes[i], at);
        for (int a = 0; a < 3; a++) assert_int_equal(at[a], 20);
    }
    choose(in_nothing, at);
    for (int a = 0; a < 3; a++) assert_int_equal(at[a], (N - 1) / 2);
}

/* Two blocks in a grid of 300 voxels along x, which is sampled: the middle lies between them. */
static bool in_two(double x, double y, double z)
{
    return ((x >= 20 && x < 90) || (x >= 240 && x < 280)) && y > 1 && z > 1;
}

static void test_large_maps_are_sampled(void **state)
{
    (void)state;
    sdm_grid g;
    float *v = make_map((const int64_t[]){300, 6, 5}, in_two, &g);
    int64_t at[3];
    assert_int_equal(sdm_sections_choose(&g, v, at, NULL), SDM_OK);
    // y = 3 shows both blocks, so x stays in the middle
    assert_int_equal(at[0], (20 + 279) / 2);
    assert_int_equal(at[1], 3);
    assert_int_equal(at[2], 3);
    free(v);
}

/* The number of pieces, by flooding: the independent way. */
static size_t flood(const int64_t n[3], const float *map)
{
    const int64_t count = n[0] * n[1] * n[2];
    size_t pieces = 0;
    bool *seen = calloc((size_t)count, 1);
    int64_t *stack = malloc((size_t)count * sizeof *stack);
    assert_true(seen && stack);
    for (int64_t v = 0; v < count; v++) {
        int64_t depth = 0;
        if (seen[v] || !(map[v] < 0)) continue;
        pieces++;
        seen[v] = true;
        stack[depth++] = v;
        while (depth) {
            const int64_t at = stack[--depth],
                          index[3] = {at % n[0], at / n[0] % n[1], at / n[0] / n[1]},
                          stride[3] = {1, n[0], n[0] * n[1]};
            for (int d = 0; d < 6; d++) {
                const int a = d / 2, step = d % 2 ? 1 : -1;
                if (index[a] + step < 0 || index[a] + step >= n[a]) continue;
                const int64_t next = at + step * stride[a];
                if (seen[next] || !(map[next] < 0)) continue;
                seen[next] = true;
                stack[depth++] = next;
            }
        }
    }
    free(seen);
    free(stack);
    return pieces;
}

/* Random maps of fewer than 1000 voxels inside, in which no piece is a speck. */
static void test_pieces_are_those_of_flooding(void **state)
{
    (void)state;
    for (uint64_t seed = 0; seed < 60; seed++) {
        const int64_t n[3] = {1 + (int64_t)sdm_rng_below(seed, 0, 0, 14),
                              1 + (int64_t)sdm_rng_below(seed, 0, 1, 10),
                              1 + (int64_t)sdm_rng_below(seed, 0, 2, 10)};
        const size_t count = (size_t)(n[0] * n[1] * n[2]);
        float map[14 * 10 * 10];
        size_t inside = 0, found, sum = 0;
        for (size_t i = 0; i < count; i++) {
            map[i] = sdm_rng_below(seed, 1, i, 100) < 20 + seed ? -1 : 1;
            inside += map[i] < 0;
        }
        if (inside >= 1000) continue;
        sdm_piece *piece;
        assert_int_equal(sdm_pieces_find(n, map, &piece, &found, NULL), SDM_OK);
        assert_int_equal(found, flood(n, map));
        for (size_t i = 0; i < found; i++) sum += (size_t)piece[i].voxels;
        assert_int_equal(sum, inside);
        sdm_free(piece);
    }
}

/* Five blocks, which three sections cannot all cut, and a speck. */
static bool in_five(double x, double y, double z)
{
    for (int i = 0; i < 5; i++)
        if (fabs(x - 3 - 8 * i) < 3 && fabs(y - 3 - 8 * (i * 2 % 5)) < 3 &&
            fabs(z - 3 - 8 * (i * 3 % 5)) < 3)
            return true;
    return false;
}

static void test_pieces_in_no_section_are_found(void **state)
{
    (void)state;
    sdm_grid g;
    sdm_piece *piece;
    size_t n;
    float *v = make_map((const int64_t[]){N, N, N}, in_five, &g);
    sdm_sections s;
    assert_int_equal(sdm_pieces_find(g.n, v, &piece, &n, NULL), SDM_OK);
    assert_int_equal(n, 5);
    for (int a = 0; a < 3; a++) {
        assert_int_equal(piece[0].low[a], 1);
        assert_int_equal(piece[0].high[a], 5);
    }
    sdm_free(piece);
    assert_int_equal(sdm_sections_place(&s, &g, v, NULL), SDM_OK);
    assert_int_equal(s.n_hidden, 2);
    assert_int_equal(s.hidden.voxels, 125);
    for (int a = 0; a < 3; a++)
        assert_true(s.at[a] < s.hidden.low[a] || s.at[a] > s.hidden.high[a]);
    free(v);
    v = make_map((const int64_t[]){N, N, N}, in_ball, &g);
    v[0] = -1; // a speck
    assert_int_equal(sdm_sections_place(&s, &g, v, NULL), SDM_OK);
    assert_int_equal(s.n_hidden, 0);
    free(v);
}

/* Grid axes that are turned: the nearest world axis, and the angle to it. */
static void test_axes_of_a_turned_grid(void **state)
{
    (void)state;
    const double c = cos(0.5), s = sin(0.5);
    sdm_grid g;
    sdm_sections place;
    float *v = make_map((const int64_t[]){N, N, N}, in_ball, &g);
    memcpy(g.dir, (const double[]){0, c, s, -1, 0, 0, 0, -s, c}, sizeof g.dir);
    assert_int_equal(sdm_sections_place(&place, &g, v, NULL), SDM_OK);
    const int want[3] = {1, 0, 2};
    for (int a = 0; a < 3; a++) {
        assert_int_equal(place.world[a], want[a]);
        assert_true(fabs(place.degrees[a] - (a ? 0.5 * 180 / acos(-1) : 0)) < 1e-5);
    }
    free(v);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_sections_show_every_part),
        cmocka_unit_test(test_sections_stay_in_the_middle),
        cmocka_unit_test(test_large_maps_are_sampled),
        cmocka_unit_test(test_pieces_are_those_of_flooding),
        cmocka_unit_test(test_pieces_in_no_section_are_found),
        cmocka_unit_test(test_axes_of_a_turned_grid),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
