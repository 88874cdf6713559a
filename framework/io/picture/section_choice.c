/* Chooses sections that together show most of a shape and of its holes. */
#include "section_choice.h"

#include <stdbool.h>

#include "sdm/memory.h"

enum {
    SAMPLES = 128, /* along each axis, at most */
    WORTH = 200    /* a move must show 1 / WORTH more */
};
/* A place is as good as the best one with this share of what that one shows. */
#define NEARLY 0.9

/* A voxel: its phase, and SEEN << axis if the section of that axis shows it. */
enum { OUTSIDE = 0, INSIDE = 1, HOLE = 2, PHASE = 3, SEEN = 4, SEEN_ALL = 7 * SEEN };

/* The sampled map, and the index of the section of each axis in it. */
typedef struct samples {
    size_t n[3], stride[3], at[3];
    uint8_t *voxel;
} samples;

/* The number of lines along an axis, and the index of the first voxel of line i of them. */
static size_t count_lines(const samples *s, int axis)
{
    return s->n[(axis + 1) % 3] * s->n[(axis + 2) % 3];
}

static size_t line_start(const samples *s, int axis, size_t i)
{
    const int u = (axis + 1) % 3, v = (axis + 2) % 3;
    return i % s->n[u] * s->stride[u] + i / s->n[u] * s->stride[v];
}

/* Adds SEEN << axis to the voxels of a line that are outside and have the inside on both sides. */
static void mark_between(uint8_t *line, size_t n, size_t stride, int axis)
{
    size_t low = 0, high = n;
    while (low < n && (line[low * stride] & PHASE) != INSIDE) low++;
    while (high > low && (line[(high - 1) * stride] & PHASE) != INSIDE) high--;
    for (size_t i = low; i < high; i++)
        if ((line[i * stride] & PHASE) == OUTSIDE) line[i * stride] |= (uint8_t)(SEEN << axis);
}

/* Finds the holes. Returns the number of voxels inside and in holes. */
static size_t mark_holes(samples *s)
{
    size_t shown = 0;
    for (int a = 0; a < 3; a++)
        for (size_t i = 0; i < count_lines(s, a); i++)
            mark_between(s->voxel + line_start(s, a, i), s->n[a], s->stride[a], a);
    for (size_t i = 0; i < s->n[0] * s->n[1] * s->n[2]; i++) {
        int axes = 0;
        for (int a = 0; a < 3; a++) axes += s->voxel[i] >> a & SEEN ? 1 : 0;
        s->voxel[i] = (s->voxel[i] & PHASE) == INSIDE ? INSIDE : axes >= 2 ? HOLE : OUTSIDE;
        shown += s->voxel[i] != OUTSIDE;
    }
    return shown;
}

/* The end of the run of one phase that begins at `first`. */
static size_t run_end(const uint8_t *line, size_t n, size_t stride, size_t first)
{
    size_t end = first + 1;
    while (end < n && ((line[end * stride] ^ line[first * stride]) & PHASE) == 0) end++;
    return end;
}

/* Marks the voxels that the section of an axis shows. */
static void mark_seen(samples *s, int axis)
{
    const size_t stride = s->stride[axis];
    for (size_t i = 0; i < count_lines(s, axis); i++) {
        uint8_t *line = s->voxel + line_start(s, axis, i);
        for (size_t first = 0, end; first < s->n[axis]; first = end) {
            end = run_end(line, s->n[axis], stride, first);
            const bool seen = first <= s->at[axis] && s->at[axis] < end;
            for (size_t k = first; k < end; k++)
                line[k * stride] =
                    (uint8_t)((line[k * stride] & ~(SEEN << axis)) | (seen ? SEEN << axis : 0));
        }
    }
}

/* gain[k] = the number of voxels that a section at k shows and that the other two do not. */
static void find_gains(const samples *s, int axis, size_t gain[SAMPLES])
{
    const size_t stride = s->stride[axis];
    const int others = SEEN_ALL & ~(SEEN << axis);
    for (size_t k = 0; k < s->n[axis]; k++) gain[k] = 0;
    for (size_t i = 0; i < count_lines(s, axis); i++) {
        const uint8_t *line = s->voxel + line_start(s, axis, i);
        for (size_t first = 0, end; first < s->n[axis]; first = end) {
            end = run_end(line, s->n[axis], stride, first);
            if ((line[first * stride] & PHASE) == OUTSIDE) continue;
            size_t unseen = 0;
            for (size_t k = first; k < end; k++) unseen += !(line[k * stride] & others);
            for (size_t k = first; k < end && unseen; k++) gain[k] += unseen;
        }
    }
}

/* The middle of the places around the best one that are nearly as good; the best one, if the middle
 * is not. */
static size_t best_place(const size_t *gain, size_t n)
{
    size_t best = 0;
    for (size_t k = 1; k < n; k++)
        if (gain[k] > gain[best]) best = k;
    const double enough = NEARLY * (double)gain[best];
    size_t low = best, high = best;
    while (low > 0 && (double)gain[low - 1] >= enough) low--;
    while (high + 1 < n && (double)gain[high + 1] >= enough) high++;
    return (low + high) / 2;
}

/* Moves the section that gains most by it. Returns whether one gains more than `worth` voxels. */
static bool move_one(samples *s, size_t worth)
{
    int axis = -1;
    size_t to = 0, gain[SAMPLES];
    for (int a = 0; a < 3; a++) {
        find_gains(s, a, gain);
        const size_t place = best_place(gain, s->n[a]), now = gain[s->at[a]];
        if (gain[place] <= now + worth) continue;
        axis = a;
        to = place;
        worth = gain[place] - now;
    }
    if (axis < 0) return false;
    s->at[axis] = to;
    mark_seen(s, axis);
    return true;
}

/* The middle of the box around the inside, or of the grid. */
static void find_middle(const sdm_grid *g, const float *v, int64_t at[3])
{
    const int64_t *n = g->n;
    int64_t low[3] = {n[0], n[1], n[2]}, high[3] = {-1, -1, -1};
    for (int64_t k = 0; k < n[2]; k++)
        for (int64_t j = 0; j < n[1]; j++)
            for (int64_t i = 0; i < n[0]; i++) {
                if (!(*v++ < 0)) continue;
                const int64_t index[3] = {i, j, k};
                for (int d = 0; d < 3; d++) {
                    if (index[d] < low[d]) low[d] = index[d];
                    if (index[d] > high[d]) high[d] = index[d];
                }
            }
    for (int d = 0; d < 3; d++) at[d] = high[d] < 0 ? (n[d] - 1) / 2 : (low[d] + high[d]) / 2;
}

/* Takes every step[a]-th voxel along axis a, among them the sections. */
static void take_samples(samples *s, const sdm_grid *g, const float *v, const int64_t step[3],
                         const int64_t start[3])
{
    uint8_t *out = s->voxel;
    for (int64_t k = start[2]; k < g->n[2]; k += step[2])
        for (int64_t j = start[1]; j < g->n[1]; j += step[1])
            for (int64_t i = start[0]; i < g->n[0]; i += step[0])
                *out++ = v[(k * g->n[1] + j) * g->n[0] + i] < 0 ? INSIDE : OUTSIDE;
}

sdm_status sdm_sections_choose(const sdm_grid *g, const float *map, int64_t at[3], sdm_error *err)
{
    samples s = {0};
    int64_t step[3], start[3];
    size_t count = 1;
    find_middle(g, map, at);
    for (int a = 0; a < 3; a++) {
        step[a] = (g->n[a] + SAMPLES - 1) / SAMPLES;
        start[a] = at[a] % step[a];
        s.at[a] = (size_t)(at[a] / step[a]);
        s.n[a] = (size_t)((g->n[a] - start[a] + step[a] - 1) / step[a]);
        s.stride[a] = count;
        count *= s.n[a];
    }
    const sdm_status status = SDM_ALLOC(&s.voxel, count, "samples of a picture", err);
    if (status) return status;
    take_samples(&s, g, map, step, start);
    const size_t worth = mark_holes(&s) / WORTH;
    for (int a = 0; a < 3; a++) mark_seen(&s, a);
    while (move_one(&s, worth)) continue;
    for (int a = 0; a < 3; a++) at[a] = start[a] + (int64_t)s.at[a] * step[a];
    sdm_free(s.voxel);
    return SDM_OK;
}
