/* Exact maps of the parts at the default parameters. */
#include "template_maps.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "motion.h"
#include "sdm/exact.h"
#include "sdm/memory.h"
#include "template_parts.h"

enum { SAMPLES = 64 };

typedef struct box {
    double min[3], max[3];
} box;

static void box_add(box *b, const double x[3])
{
    for (int a = 0; a < 3; a++)
        b->min[a] = fmin(b->min[a], x[a]), b->max[a] = fmax(b->max[a], x[a]);
}

static const box EMPTY = {{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};

// *l = the lattice of the given spacing around a box. false: it has more than `nodes` nodes.
static bool lattice_of(const box *b, double margin, double spacing, double nodes, sdm_lattice *l)
{
    double cells[3], count = 1;
    *l = (sdm_lattice){.spacing = spacing};
    for (int a = 0; a < 3; a++) {
        cells[a] = fmax(1, ceil((b->max[a] - b->min[a] + 2 * margin) / spacing));
        if (!(cells[a] < SDM_TEMPLATE_MAX_SIDE)) return false;
        count *= cells[a] + 1;
    }
    for (int a = 0; a < 3; a++) {
        l->n[a] = (uint32_t)cells[a] + 1;
        l->origin[a] = 0.5 * (b->min[a] + b->max[a]) - 0.5 * cells[a] * spacing;
    }
    return count <= nodes;
}

// *nodes = new array: exact distance and gradient at the nodes
static sdm_status fill_nodes(const sdm_exact *exact, const sdm_lattice *l, const float **nodes,
                             sdm_error *err)
{
    const size_t n = sdm_lattice_count(l);
    sdm_grid grid = {.dir = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
    for (int a = 0; a < 3; a++) {
        grid.n[a] = l->n[a];
        grid.origin[a] = l->origin[a];
        grid.spacing[a] = l->spacing;
    }
    float *out = NULL, *normal = NULL, *values = NULL;
    sdm_status s = SDM_ALLOC(&out, 4 * n, "template", err);
    *nodes = out;
    if (!s) s = SDM_ALLOC(&normal, 3 * n, "template", err);
    if (!s) s = SDM_ALLOC(&values, n, "template", err);
    const sdm_exact_layers layers = {.values = values, .normal = normal};
    if (!s) s = sdm_exact_map_layers(exact, &grid, &layers, err);
    for (size_t i = 0; i < n && !s; i++) {
        out[4 * i] = values[i];
        memcpy(out + 4 * i + 1, normal + 3 * i, 3 * sizeof *out);
    }
    sdm_free(values);
    sdm_free(normal);
    return s;
}

// The triangles of part c at the default parameters.
static sdm_status part_mesh(const template_design *d, size_t c, sdm_mesh *out, sdm_error *err)
{
    const sdm_mesh *m = &d->family.base;
    uint8_t *mine = NULL;
    sdm_status s = SDM_ALLOC(&mine, m->n_vert, "template", err);
    size_t n = 0;
    for (size_t k = d->first[c]; k < d->first[c + 1] && !s; k++) mine[d->vertices[k]] = 1;
    for (size_t t = 0; t < m->n_tri && !s; t++) n += mine[m->tri[3 * t]];
    if (!s) s = sdm_mesh_reserve(out, m->n_vert, n, err);
    if (!s) memcpy(out->vert, m->vert, 3 * m->n_vert * sizeof *out->vert);
    n = 0;
    for (size_t t = 0; t < m->n_tri && !s; t++)
        if (mine[m->tri[3 * t]]) memcpy(out->tri + 3 * n++, m->tri + 3 * t, 3 * sizeof *out->tri);
    sdm_free(mine);
    return s;
}

// Boxes that contain the corners of the grid, carried back into the frame of each part at random
// parameters.
static sdm_status grid_boxes(const template_design *d, box *boxes, sdm_error *err)
{
    sdm_mesh mesh = {0};
    sdm_status s = SDM_OK;
    for (size_t c = 0; c < d->n_parts; c++) boxes[c] = EMPTY;
    for (size_t i = 0; i < SAMPLES && !s; i++) {
        double p[SDM_POD_MAX_PARAMS];
        trainer_family_params(&d->family, i, p);
        s = trainer_family_mesh(&d->family, p, &mesh, err);
        for (size_t c = 0; c < d->n_parts && !s; c++) {
            motion m;
            trainer_template_motion(d, c, mesh.vert, &m);
            for (int k = 0; k < 8; k++) {
                const double index[3] = {k & 1 ? (double)d->grid->n[0] - 1 : 0,
                                         k & 2 ? (double)d->grid->n[1] - 1 : 0,
                                         k & 4 ? (double)d->grid->n[2] - 1 : 0};
                double x[3], y[3];
                sdm_grid_world(d->grid, index, x);
                trainer_motion_back(&m, x, y);
                box_add(&boxes[c], y);
            }
        }
    }
    sdm_mesh_dispose(&mesh);
    return s;
}

// Largest amount by which the distance at a node lies below the tangent at another one outside of
// the part. by_axes[n]: distance in nodes between the two along n axes; 0: such pairs are left out.
static double lattice_sag(const sdm_lattice *l, const float *nodes, const long by_axes[4],
                          double least)
{
    double largest = 0;
    const long n[3] = {l->n[0], l->n[1], l->n[2]};
    for (long z = 0, i = 0; z < n[2]; z++)
        for (long y = 0; y < n[1]; y++)
            for (long x = 0; x < n[0]; x++, i++) {
                const float *a = nodes + 4 * i;
                if (!(a[0] > 0 && (double)a[0] >= least)) continue;
                for (int k = 0; k < 27; k++) {
                    const long sign[3] = {k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1},
                               step = by_axes[labs(sign[0]) + labs(sign[1]) + labs(sign[2])],
                               d[3] = {step * sign[0], step * sign[1], step * sign[2]};
                    if (step == 0 || x + d[0] < 0 || x + d[0] >= n[0] || y + d[1] < 0 ||
                        y + d[1] >= n[1] || z + d[2] < 0 || z + d[2] >= n[2])
                        continue;
                    const float *b = a + 4 * ((d[2] * n[1] + d[1]) * n[0] + d[0]);
                    double below = (double)a[0] - (double)b[0];
                    for (int c = 0; c < 3; c++)
                        below += l->spacing * (double)d[c] * (double)a[1 + c];
                    largest = fmax(largest, below);
                }
            }
    return largest;
}

// Sets sag, far_sag and their bounds: three nodes of `near`. The lattice `far` has four times its
// spacing.
static void measure_sag(sdm_template_part *p)
{
    p->sag_reach = 3 * p->near.spacing;
    p->far_from = 6 * p->near.spacing;
    for (int far = 0; far < 2; far++) {
        const double least = far ? p->far_from : 0,
                     sag = fmax(
                         lattice_sag(&p->near, p->near_nodes, (const long[]){0, 3, 2, 2}, least),
                         lattice_sag(&p->far, p->far_nodes, (const long[]){0, 1, 0, 0}, least));
        *(far ? &p->far_sag : &p->sag) = sag;
    }
}

sdm_status trainer_template_maps(template_design *d, sdm_error *err)
{
    enum { FAR_NODES = 1 << 20, NEAR = 6, NEAR_WARPED = 3 }; // NEAR: voxels around the part
    const double h = fmin(fmin(d->grid->spacing[0], d->grid->spacing[1]), d->grid->spacing[2]);
    box reach[SDM_TEMPLATE_MAX_PARTS];
    sdm_status s = grid_boxes(d, reach, err);
    for (size_t c = 0; c < d->n_parts && !s; c++) {
        sdm_template_part *p = &d->parts[c];
        box b = EMPTY;
        for (size_t k = d->first[c]; k < d->first[c + 1]; k++)
            box_add(&b, d->family.base.vert + 3 * d->vertices[k]);
        const double margin = (p->n_modes ? NEAR_WARPED : NEAR) * h;
        if (!lattice_of(&b, margin, h, SDM_TEMPLATE_MAX_NODES, &p->near))
            return sdm_fail(err, SDM_E_UNSUPPORTED,
                            "shape '%s': too large for a template with the spacing of the grid",
                            sdm_instance_shape(d->family.shape)->name);
        // a warp moves the grid's voxels by as much as the vertices: the margin of the warp's box
        const double extra = p->n_modes ? 2 * p->warp.spacing : 4 * h;
        double spacing = 3 * h;
        while (!lattice_of(&reach[c], extra, spacing, FAR_NODES, &p->far)) spacing *= 1.2;
        sdm_mesh mesh = {0};
        sdm_exact *exact = NULL;
        const sdm_exact_opts opts = {.n_threads = d->family.n_threads};
        s = part_mesh(d, c, &mesh, err);
        if (!s) s = sdm_exact_create(&mesh, &opts, &exact, err);
        if (!s) s = fill_nodes(exact, &p->near, &p->near_nodes, err);
        if (!s) s = fill_nodes(exact, &p->far, &p->far_nodes, err);
        if (!s) measure_sag(p);
        sdm_exact_free(exact);
        sdm_mesh_dispose(&mesh);
    }
    return s;
}
