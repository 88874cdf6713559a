/* Finds the pieces of the inside of a map by union-find over the runs of voxels inside along x. */
#include "inside_pieces.h"

#include "sdm/memory.h"

/* A piece with less than 1 / SPECK of all voxels inside is left out. */
enum { SPECK = 1000 };

/* Voxels first .. end - 1 of a row along x are inside, those next to them are not. */
typedef struct run {
    int64_t first, end;
    size_t parent; /* union-find: the run itself for a root, else a run with a smaller number */
} run;

static size_t find_root(run *r, size_t i)
{
    for (; r[i].parent != i; i = r[i].parent) r[i].parent = r[r[i].parent].parent;
    return i;
}

static void join(run *r, size_t a, size_t b)
{
    a = find_root(r, a);
    b = find_root(r, b);
    if (a < b)
        r[b].parent = a;
    else
        r[a].parent = b;
}

/* Writes the runs of a row of n values to r[], numbered from `first`, or only counts them if r is
 * NULL. Returns their number. */
static size_t row_runs(const float *row, int64_t n, run *r, size_t first)
{
    size_t count = 0;
    for (int64_t i = 0; i < n;) {
        if (!(row[i] < 0)) {
            i++;
            continue;
        }
        const int64_t begin = i;
        while (i < n && row[i] < 0) i++;
        if (r) r[first + count] = (run){begin, i, first + count};
        count++;
    }
    return count;
}

/* Joins the runs a .. a_end - 1 of one row with those of a neighbouring row that they touch. */
static void join_rows(run *r, size_t a, size_t a_end, size_t b, size_t b_end)
{
    while (a < a_end && b < b_end) {
        if (r[a].first < r[b].end && r[b].first < r[a].end) join(r, a, b);
        if (r[a].end < r[b].end)
            a++;
        else
            b++;
    }
}

/* Adds run r of row (j, k) to its piece. */
static void piece_add(sdm_piece *p, const run *r, int64_t j, int64_t k)
{
    const int64_t low[3] = {r->first, j, k}, high[3] = {r->end - 1, j, k};
    for (int d = 0; d < 3; d++) {
        if (!p->voxels || low[d] < p->low[d]) p->low[d] = low[d];
        if (!p->voxels || high[d] > p->high[d]) p->high[d] = high[d];
    }
    p->voxels += r->end - r->first;
}

/* Fills the pieces from joined runs; piece[] is indexed by the roots. start[q] is the number of
 * the first run of row q. */
static void pieces_fill(const int64_t n[3], run *r, const size_t *start, sdm_piece *piece)
{
    for (int64_t k = 0; k < n[2]; k++)
        for (int64_t j = 0; j < n[1]; j++)
            for (size_t q = (size_t)(k * n[1] + j), i = start[q]; i < start[q + 1]; i++)
                piece_add(&piece[find_root(r, i)], &r[i], j, k);
}

/* Moves the pieces that are no specks to the front of piece[n]. Returns their number. */
static size_t pieces_compact(sdm_piece *piece, size_t n)
{
    int64_t inside = 0;
    size_t kept = 0;
    for (size_t i = 0; i < n; i++) inside += piece[i].voxels;
    for (size_t i = 0; i < n; i++)
        if (piece[i].voxels && SPECK * piece[i].voxels >= inside) piece[kept++] = piece[i];
    return kept;
}

sdm_status sdm_pieces_find(const int64_t n[3], const float *map, sdm_piece **out, size_t *count,
                           sdm_error *err)
{
    const size_t rows = (size_t)(n[1] * n[2]), row = (size_t)n[0], above = (size_t)n[1];
    size_t *start = NULL, runs = 0;
    run *r = NULL;
    *out = NULL;
    *count = 0;
    sdm_status s = SDM_ALLOC(&start, rows + 1, "rows of a picture", err);
    for (size_t q = 0; q < rows && !s; q++) {
        start[q] = runs;
        runs += row_runs(map + q * row, n[0], NULL, 0);
        start[q + 1] = runs;
    }
    if (!s) s = SDM_ALLOC(&r, runs, "runs of a picture", err);
    if (!s) s = SDM_ALLOC(out, runs, "pieces of a picture", err);
    for (size_t q = 0; q < rows && !s; q++) {
        row_runs(map + q * row, n[0], r, start[q]);
        if (q % above) join_rows(r, start[q], start[q + 1], start[q - 1], start[q]);
        if (q >= above)
            join_rows(r, start[q], start[q + 1], start[q - above], start[q - above + 1]);
    }
    if (!s) pieces_fill(n, r, start, *out);
    if (!s) *count = pieces_compact(*out, runs);
    sdm_free(r);
    sdm_free(start);
    return s;
}
