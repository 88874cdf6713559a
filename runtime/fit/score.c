/* score = sum over voxels of residual e_n * root_n. With C(lag) = E[e_n e_(n+lag)], estimated from the residuals near the surface,

       cov(score) = sum over n and lags of C(lag) root_n root_(n+lag)^T     (Conley 1999, here with the e of one stationary field)

   The weight of a lag is 1 in the inner half of a window and falls linearly to its edge (Politis and Romano 1995), or, should the sum not
   be positive definite so, falls linearly from the middle (Bartlett 1950), where it always is. */
#include "score.h"

#include <math.h>
#include <string.h>

#include "sdm/memory.h"
#include "sdm/rng.h"
#include "sdm/threads.h"

// largest lag along an axis, in steps of the voxels that are used
#define LAG_MOST 10
#define LAGS (2 * LAG_MOST + 1)
// sums over neighbours begin at some of the voxels, so that there are about as many: of a correlation, of the covariance
#define PAIRS_OF_LAG 8000
#define PAIRS 30000000
// the part of them that serves where only weights are wanted
#define ROUGH 0.2

/* Voxels near the surface, found by their place in a box of the image. */
typedef struct near_voxels {
    size_t n, n_unknowns;
    int64_t size[3], from[3], step; // the box, in steps
    uint32_t *at;                   // [size] 1 + number of the voxel, or 0
    int32_t *place;                 // [n][3] in the box
    float *lot;                     // [n] 0 .. 1 at random, of the voxel alone: the lowest begin sums
    double effort;                  // part of the pairs that are taken
    uint32_t *begin;                // [n_begin] voxels where sums of correlations begin
    size_t n_begin;
    float *residual, *weight; // [n]
    float *root;              // [n][n_unknowns]
    float *push;              // [n][n_unknowns] score by an error of the map of 1 mm
} near_voxels;

static void place_of(const sdm_grid *g, size_t voxel, int64_t index[3])
{
    index[0] = (int64_t)voxel % g->n[0];
    index[1] = (int64_t)voxel / g->n[0] % g->n[1];
    index[2] = (int64_t)voxel / g->n[0] / g->n[1];
}

// whether a voxel's score says anything of the shape; those that hardly do would thin out the others, of which some are taken
static bool is_near(const fit_problem *p, size_t site)
{
    return p->sites.slot[site] != SIZE_MAX && !(p->maps.share && fabs(fabs(p->sites.field[site] - 0.5) - 0.5) <= 1e-6);
}

static size_t count_near(const fit_problem *p)
{
    size_t n = 0;
    for (size_t i = 0; i < p->sites.n; i++) n += is_near(p, i);
    return n;
}

static void find_box(const fit_problem *p, near_voxels *v)
{
    int64_t to[3] = {0, 0, 0}, index[3];
    for (int a = 0; a < 3; a++) v->from[a] = INT64_MAX;
    for (size_t i = 0; i < p->sites.n; i++) {
        if (!is_near(p, i)) continue;
        place_of(&p->target->grid, p->sites.voxel[i], index);
        for (int a = 0; a < 3; a++) {
            if (index[a] < v->from[a]) v->from[a] = index[a];
            if (index[a] > to[a]) to[a] = index[a];
        }
    }
    for (int a = 0; a < 3; a++) v->size[a] = (to[a] - v->from[a]) / v->step + 1;
}

// what an error of the map of 1 mm does to the field: the slope of the field across the surface
static double field_slope(const fit_problem *p, const float *columns)
{
    const float *shift = columns + fit_at_translation(p->n_params);
    if (!p->maps.share) return 1;
    return -sqrt((double)(shift[0] * shift[0]) + (double)(shift[1] * shift[1]) + (double)(shift[2] * shift[2]));
}

static void fill_near(const fit_problem *p, near_voxels *v)
{
    const fit_sites *s = &p->sites;
    const size_t nc = s->n_columns, n = v->n_unknowns;
    size_t count = 0;
    for (size_t i = 0; i < s->n; i++) {
        if (!is_near(p, i)) continue;
        const float *columns = s->columns + s->slot[i] * nc;
        fit_response r;
        sdm_fit_respond(&p->laws, (double)s->value[i], fit_place(s, i), s->field[i], true, &r);
        float *root = v->root + count * n, *push = v->push + count * n;
        const double slope = field_slope(p, columns);
        for (size_t a = 0; a < nc; a++) {
            root[a] = (float)(r.root[0] * (double)columns[a]);
            push[a] = (float)(r.complete[0] * slope * (double)columns[a]);
        }
        for (size_t a = nc; a < n; a++) {
            root[a] = (float)r.root[1 + a - nc];
            push[a] = (float)(r.complete[1 + a - nc] * slope);
        }
        v->residual[count] = (float)r.residual;
        v->weight[count] = (float)fabs(r.root[0]);
        v->lot[count] = (float)sdm_rng_uniform(0, 0, s->voxel[i]);
        int64_t index[3];
        place_of(&p->target->grid, s->voxel[i], index);
        for (int a = 0; a < 3; a++) v->place[3 * count + (size_t)a] = (int32_t)((index[a] - v->from[a]) / v->step);
        const int32_t *at = v->place + 3 * count;
        v->at[((size_t)at[2] * (size_t)v->size[1] + (size_t)at[1]) * (size_t)v->size[0] + (size_t)at[0]] =
            (uint32_t)++count;
    }
}

// the same for a voxel more or less: other voxels would be chosen
static float stepped(double share) { return (float)exp2(0.25 * floor(4 * log2(share))); }

static void choose_begins(near_voxels *v)
{
    const float share = stepped(v->effort * PAIRS_OF_LAG / (double)v->n);
    for (size_t i = 0; i < v->n; i++)
        if (!(v->lot[i] > share)) v->begin[v->n_begin++] = (uint32_t)i;
}

static void dispose_near(near_voxels *v)
{
    sdm_free(v->begin);
    sdm_free(v->at);
    sdm_free(v->place);
    sdm_free(v->lot);
    sdm_free(v->residual);
    sdm_free(v->weight);
    sdm_free(v->root);
    sdm_free(v->push);
}

static sdm_status make_near(const fit_problem *p, double effort, near_voxels *v, sdm_error *err)
{
    *v = (near_voxels){
        .n = count_near(p), .n_unknowns = p->sums.n_unknowns, .step = (int64_t)p->stride, .effort = effort};
    find_box(p, v);
    size_t count, box;
    sdm_status s = sdm_mul(v->n, v->n_unknowns, &count, err);
    if (!s) s = sdm_mul((size_t)v->size[0] * (size_t)v->size[1], (size_t)v->size[2], &box, err);
    if (!s) s = SDM_ALLOC(&v->at, box, "voxels near the surface", err);
    if (!s) s = SDM_ALLOC(&v->place, 3 * v->n, "voxels near the surface", err);
    if (!s) s = SDM_ALLOC(&v->lot, v->n, "voxels near the surface", err);
    if (!s) s = SDM_ALLOC(&v->begin, v->n, "voxels near the surface", err);
    if (!s) s = SDM_ALLOC(&v->residual, v->n, "voxels near the surface", err);
    if (!s) s = SDM_ALLOC(&v->weight, v->n, "voxels near the surface", err);
    if (!s) s = SDM_ALLOC(&v->root, count, "voxels near the surface", err);
    if (!s) s = SDM_ALLOC(&v->push, count, "voxels near the surface", err);
    if (!s) fill_near(p, v);
    if (!s) choose_begins(v);
    return s;
}

// number of the voxel at a lag from voxel i, or SIZE_MAX
static size_t neighbour(const near_voxels *v, size_t i, const int lag[3])
{
    int64_t k[3];
    for (int a = 0; a < 3; a++) {
        k[a] = v->place[3 * i + (size_t)a] + lag[a];
        if (k[a] < 0 || k[a] >= v->size[a]) return SIZE_MAX;
    }
    const uint32_t found = v->at[(k[2] * v->size[1] + k[1]) * v->size[0] + k[0]];
    return found ? found - 1 : SIZE_MAX;
}

/* Lags are numbered through; those above the middle are the other half of a symmetric table. */
static void lag_of(int number, int lag[3])
{
    lag[0] = number % LAGS - LAG_MOST;
    lag[1] = number / LAGS % LAGS - LAG_MOST;
    lag[2] = number / (LAGS * LAGS) - LAG_MOST;
}

#define MIDDLE (LAGS * LAGS * LAGS / 2)

static int lag_size(const int lag[3])
{
    int most = 0;
    for (int a = 0; a < 3; a++)
        if (lag[a] > most || -lag[a] > most) most = lag[a] > 0 ? lag[a] : -lag[a];
    return most;
}

// weighted mean of e_n e_(n+lag)
static double correlation_at(const near_voxels *v, const int lag[3])
{
    double sum = 0, weight = 0;
    for (const uint32_t *first = v->begin; first < v->begin + v->n_begin; first++) {
        const size_t i = *first, j = neighbour(v, i, lag);
        if (j == SIZE_MAX) continue;
        const double w = (double)v->weight[i] * (double)v->weight[j];
        sum += w * (double)v->residual[i] * (double)v->residual[j];
        weight += w;
    }
    return weight > 0 ? sum / weight : 0;
}

// weight of a lag in a window
static double taper(const int lag[3], int width, bool flat)
{
    double w = 1;
    for (int a = 0; a < 3; a++) {
        const double share = fabs((double)lag[a]) / (double)(width + 1);
        w *= flat ? fmin(fmax(2 - 2 * share, 0), 1) : fmax(1 - share, 0);
    }
    return w;
}

/* C(lag) in c, shell by shell of lags; the window is twice as wide as the last shell before the first whose sum does not stand out.
   Returns its half width. */
static int estimate(const near_voxels *v, int n_threads, double c[MIDDLE + 1])
{
    (void)n_threads; // without OpenMP
    int width = LAG_MOST;
    memset(c, 0, (MIDDLE + 1) * sizeof *c);
    for (int k = 0; k <= width; k++) {
#pragma omp parallel for schedule(dynamic, 64) num_threads(n_threads)
        for (int number = 0; number <= MIDDLE; number++) {
            int lag[3];
            lag_of(number, lag);
            if (lag_size(lag) == k) c[number] = correlation_at(v, lag);
        }
        double sum = 0, lags = 0;
        for (int number = 0; number <= MIDDLE; number++) {
            int lag[3];
            lag_of(number, lag);
            if (lag_size(lag) == k) sum += c[number], lags++;
        }
        // standard error of the sum where nothing is correlated (Bartlett 1946)
        const double error = sqrt(lags / fmin((double)v->n, v->effort * PAIRS_OF_LAG));
        if (width == LAG_MOST && k > 0 && !(sum > fmax(0.05, 2 * error) * c[MIDDLE]))
            width = 2 * (k - 1) < LAG_MOST ? 2 * (k - 1) : LAG_MOST - 1;
    }
    return width;
}

/* out += sum of c(lag) root_n root_(n+lag)^T over voxels and both halves of the lags. Slices of voxels, added in order. */
static sdm_status add_products(const near_voxels *v, const double *c, int width, int n_threads, double *out,
                               sdm_error *err)
{
    const size_t n = v->n_unknowns;
    const float *x = v->root;
    double *parts = NULL;
    const sdm_status s = SDM_ALLOC(&parts, FIT_SLICES * n * n, "covariance of the score", err);
    if (s) return s;
    (void)n_threads; // without OpenMP
    const float share = stepped(v->effort * PAIRS / (pow(2.0 * width + 1, 3) / 2 + 1) / (double)v->n);
    size_t chosen = 0;
    for (size_t i = 0; i < v->n; i++) chosen += v->lot[i] <= share;
    const double scale = (double)v->n / fmax((double)chosen, 1);
#pragma omp parallel for schedule(dynamic) num_threads(n_threads)
    for (size_t slice = 0; slice < FIT_SLICES; slice++)
        for (size_t i = v->n * slice / FIT_SLICES; i < v->n * (slice + 1) / FIT_SLICES; i++) {
            if (v->lot[i] > share) continue;
            float around[FIT_UNKNOWNS_MAX] = {0};
            double *part = parts + slice * n * n;
            for (int number = 0; number <= MIDDLE; number++) {
                int lag[3];
                lag_of(number, lag);
                if (c[number] == 0 || lag_size(lag) > width) continue;
                const size_t j = neighbour(v, i, lag);
                if (j == SIZE_MAX) continue;
                const float w = (float)(number == MIDDLE ? 0.5 * c[number] : c[number]);
                for (size_t a = 0; a < n; a++) around[a] += w * x[j * n + a];
            }
            for (size_t a = 0; a < n; a++)
                for (size_t b = 0; b < n; b++) part[a * n + b] += (double)x[i * n + a] * (double)around[b];
        }
    for (size_t slice = 0; slice < FIT_SLICES; slice++)
        for (size_t a = 0; a < n; a++)
            for (size_t b = 0; b < n; b++)
                out[a * n + b] += scale * (parts[slice * n * n + a * n + b] + parts[slice * n * n + b * n + a]);
    sdm_free(parts);
    return SDM_OK;
}

// voxels far from the surface: they tell of the means of the tissues alone
static void add_far(const fit_problem *p, double factor, double *out)
{
    const size_t n = p->sums.n_unknowns, nc = p->sites.n_columns;
    for (size_t i = 0; i < p->sites.n && p->laws.n_channels > 1; i++) {
        if (is_near(p, i)) continue;
        fit_response r;
        sdm_fit_respond(&p->laws, (double)p->sites.value[i], fit_place(&p->sites, i), p->sites.field[i], true, &r);
        for (size_t a = 1; a < p->laws.n_channels; a++)
            for (size_t b = 1; b < p->laws.n_channels; b++)
                out[(nc + a - 1) * n + nc + b - 1] += factor * r.root[a] * r.root[b];
    }
}

// points have no grid: each on its own (White 1980)
static void add_points(const fit_problem *p, double *out)
{
    const size_t n = p->sums.n_unknowns;
    for (size_t i = 0; i < p->sites.n; i++) {
        fit_response r;
        sdm_fit_respond(&p->laws, 0, NULL, p->sites.field[i], true, &r);
        const float *c = p->sites.columns + p->sites.slot[i] * n;
        for (size_t a = 0; a < n; a++)
            for (size_t b = 0; b < n; b++) out[a * n + b] += r.score[0] * r.score[0] * (double)c[a] * (double)c[b];
    }
}

// weights of the correlations in a window, and their sum over all lags
static double weigh_lags(const double *c, int width, bool flat, double *weighted)
{
    double sum = c[MIDDLE];
    for (int number = 0; number <= MIDDLE; number++) {
        int lag[3];
        lag_of(number, lag);
        weighted[number] = c[number] * taper(lag, width, flat);
        if (number < MIDDLE) sum += 2 * weighted[number];
    }
    return fmax(sum, c[MIDDLE]);
}

static sdm_status add_noise(const fit_problem *p, const near_voxels *v, const double *c, int width, int n_threads,
                            bool definite, fit_scatter *out, sdm_error *err)
{
    const size_t n = v->n_unknowns;
    double weighted[MIDDLE + 1], *work = NULL, scale[FIT_UNKNOWNS_MAX];
    sdm_status s = SDM_ALLOC(&work, 2 * n * n, "covariance of the score", err);
    for (int flat = 1; flat >= 0 && !s; flat--) {
        const double sum = weigh_lags(c, width, flat, weighted);
        if (flat) out->noise_factor = sum;
        memset(out->noise, 0, n * n * sizeof *out->noise);
        s = add_products(v, weighted, width, n_threads, out->noise, err);
        add_far(p, sum, out->noise);
        memcpy(work, out->noise, n * n * sizeof *work);
        sdm_fit_add_ignorance(p, work);
        for (size_t i = 0; i < n; i++)
            if (!(work[i * (n + 1)] > 0)) work[i * (n + 1)] = 1; // the blur, where there is none
        if (!definite || sdm_fit_factorise(n, work, work + n * n, scale)) break;
    }
    sdm_free(work);
    return s;
}

// an error of the map that is the same within cubes of this edge and independent between them
static sdm_status add_model(const fit_problem *p, const near_voxels *v, double edge, double *out, sdm_error *err)
{
    const size_t n = v->n_unknowns;
    int64_t steps[3], count[3];
    for (int a = 0; a < 3; a++) {
        steps[a] = (int64_t)fmax(floor(edge / (p->target->grid.spacing[a] * (double)v->step) + 0.5), 1);
        count[a] = (v->size[a] - 1) / steps[a] + 1;
    }
    const size_t cubes = (size_t)count[0] * (size_t)count[1] * (size_t)count[2];
    double *sum = NULL;
    size_t size;
    sdm_status s = sdm_mul(cubes, n, &size, err);
    if (!s) s = SDM_ALLOC(&sum, size, "covariance of the score", err);
    if (s) return s;
    for (size_t i = 0; i < v->n; i++) {
        int64_t k[3];
        for (size_t a = 0; a < 3; a++) k[a] = v->place[3 * i + a] / steps[a];
        double *of_cube = sum + (size_t)((k[2] * count[1] + k[1]) * count[0] + k[0]) * n;
        for (size_t a = 0; a < n; a++) of_cube[a] += (double)v->push[i * n + a];
    }
    for (size_t cube = 0; cube < cubes; cube++)
        for (size_t a = 0; a < n; a++)
            for (size_t b = 0; b < n; b++) out[a * n + b] += sum[cube * n + a] * sum[cube * n + b];
    sdm_free(sum);
    return SDM_OK;
}

// number of voxels that count, by their information (Kish 1965), over the noise factor
static double effective_number(const near_voxels *v, double noise_factor)
{
    double sum = 0, square = 0;
    for (size_t i = 0; i < v->n; i++) {
        const double w = (double)v->weight[i] * (double)v->weight[i];
        sum += w;
        square += w * w;
    }
    return square > 0 ? sum * sum / (square * fmax(noise_factor, 1)) : 0;
}

static sdm_status of_voxels(const fit_problem *p, double model_mm, bool definite, fit_scatter *out, sdm_error *err)
{
    near_voxels v;
    sdm_status s = make_near(p, definite ? 1 : ROUGH, &v, err);
    double c[MIDDLE + 1];
    const int n_threads = sdm_threads(p->opts->n_threads);
    if (!s) {
        const int width = estimate(&v, n_threads, c);
        s = add_noise(p, &v, c, width, n_threads, definite, out, err);
        out->effective = effective_number(&v, out->noise_factor);
    }
    if (!s && model_mm > 0) s = add_model(p, &v, model_mm, out->model, err);
    dispose_near(&v);
    return s;
}

sdm_status sdm_fit_scatter_create(const fit_problem *p, double model_mm, bool definite, fit_scatter *out,
                                  sdm_error *err)
{
    const size_t n = p->sums.n_unknowns;
    *out = (fit_scatter){.noise_factor = 1, .effective = (double)p->sites.n};
    sdm_status s = SDM_ALLOC(&out->noise, n * n, "covariance of the score", err);
    if (!s) s = SDM_ALLOC(&out->model, n * n, "covariance of the score", err);
    if (!s && p->target->kind == SDM_FIT_POINTS)
        add_points(p, out->noise);
    else if (!s && count_near(p))
        s = of_voxels(p, model_mm, definite, out, err);
    if (s) sdm_fit_scatter_dispose(out);
    return s;
}

void sdm_fit_scatter_dispose(fit_scatter *s)
{
    sdm_free(s->noise);
    sdm_free(s->model);
    *s = (fit_scatter){0};
}
