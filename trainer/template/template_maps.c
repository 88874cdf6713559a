/* Exact maps of the parts at the default parameters. */
#include "template_maps.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "motion.h"
#include "sdm/exact.h"
#include "sdm/internal/box.h"
#include "sdm/memory.h"
#include "template_parts.h"

enum { SAMPLES = 64 };

// *l = the lattice of the given spacing around a box. false: it has more than `nodes` nodes.
static bool lattice_of(const sdm_box *b, double margin, double spacing, double nodes,
                       sdm_lattice *l)
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

/* The solid of a part: the components of the mesh to which it belongs, or what is nearer to its own
   triangles than to the others of these components. */
typedef struct part_solid {
    sdm_exact *whole;      /* the components */
    sdm_exact *own, *rest; /* the triangles of the part, the others; NULL: the part is the whole */
} part_solid;

static void solid_free(part_solid *p)
{
    sdm_exact_free(p->whole);
    sdm_exact_free(p->own);
    sdm_exact_free(p->rest);
    *p = (part_solid){0};
}

// *exact = the triangles of the base mesh with the given flags
static sdm_status make_exact(const family *f, const uint8_t *flags, uint8_t mask, uint8_t value,
                             bool open, sdm_exact **exact, sdm_error *err)
{
    const sdm_mesh *m = &f->base;
    sdm_mesh mesh = {0};
    const sdm_exact_opts opts = {.keep_overlap = open, .n_threads = f->n_threads};
    size_t n = 0;
    for (size_t t = 0; t < m->n_tri; t++) n += (flags[t] & mask) == value;
    sdm_status s = sdm_mesh_reserve(&mesh, m->n_vert, n, err);
    if (!s) memcpy(mesh.vert, m->vert, 3 * m->n_vert * sizeof *mesh.vert);
    n = 0;
    for (size_t t = 0; t < m->n_tri && !s; t++)
        if ((flags[t] & mask) == value)
            memcpy(mesh.tri + 3 * n++, m->tri + 3 * t, 3 * sizeof *mesh.tri);
    if (!s) s = sdm_exact_create(&mesh, &opts, exact, err);
    sdm_mesh_dispose(&mesh);
    return s;
}

// Prepares the solid of part c at the default parameters.
static sdm_status make_solid(const template_design *d, size_t c, part_solid *out, sdm_error *err)
{
    enum { OWN = 1, NEAR = 2 }; // flags of a triangle: all corners in the part; of its components
    const sdm_mesh *m = &d->family.base;
    uint8_t *mine = NULL, *flags = NULL;
    bool touched[SDM_TEMPLATE_MAX_PARTS] = {false}; // more components: one part has them all
    const uint32_t *component = d->family.component;
    const bool all = d->family.n_components > SDM_TEMPLATE_MAX_PARTS;
    sdm_status s = SDM_ALLOC(&mine, m->n_vert, "template", err);
    if (!s) s = SDM_ALLOC(&flags, m->n_tri, "template", err);
    for (size_t k = d->first[c]; k < d->first[c + 1] && !s; k++) {
        mine[d->vertices[k]] = 1;
        if (!all) touched[component[d->vertices[k]]] = true;
    }
    size_t n_rest = 0;
    for (size_t t = 0; t < m->n_tri && !s; t++) {
        const uint32_t *v = m->tri + 3 * t;
        if (all || touched[component[v[0]]]) flags[t] = NEAR;
        if (mine[v[0]] && mine[v[1]] && mine[v[2]]) flags[t] |= OWN;
        n_rest += flags[t] == NEAR;
    }
    if (!s) s = make_exact(&d->family, flags, NEAR, NEAR, false, &out->whole, err);
    if (!s && n_rest) s = make_exact(&d->family, flags, OWN, OWN, true, &out->own, err);
    if (!s && n_rest) s = make_exact(&d->family, flags, OWN | NEAR, NEAR, true, &out->rest, err);
    sdm_free(flags);
    sdm_free(mine);
    return s;
}

/* Distance and its gradient at the nodes of a lattice. */
typedef struct layers {
    float *value, *gradient; /* [n], [n][3] */
} layers;

static void layers_free(layers *l)
{
    sdm_free(l->value);
    sdm_free(l->gradient);
    *l = (layers){0};
}

static sdm_status fill_layers(const sdm_exact *exact, const sdm_grid *grid, layers *l,
                              sdm_error *err)
{
    const size_t n = sdm_grid_count(grid);
    sdm_status s = SDM_ALLOC(&l->gradient, 3 * n, "template", err);
    if (!s) s = SDM_ALLOC(&l->value, n, "template", err);
    const sdm_exact_layers out = {.values = l->value, .normal = l->gradient};
    return s ? s : sdm_exact_map_layers(exact, grid, &out, err);
}

/* Node of a part whose surface is open: u, v = distances to its own triangles and to the rest, with
   gradients. Outside of the whole the distance is u. Inside, the part ends where the rest is as
   near as its own triangles: for a plane across a tube, sqrt|u^2 - v^2| is the distance to this
   cap. Its multiple grows beyond the cap soon to u, so that where the rest has moved away, only
   what lies close to the cap seems nearer than it is; there the neighbours overlap. */
static void open_node(bool inside, double u, const float gu[3], double v, const float gv[3],
                      float out[4])
{
    static const double STEEP = 2, GRADIENT_MAX = 4;
    double value = u, g[3] = {gu[0], gu[1], gu[2]};
    if (inside) {
        const double square = u * u - v * v, cap = sqrt(fabs(square)),
                     signed_cap = square < 0 ? -STEEP * cap : STEEP * cap;
        if (signed_cap < -u) {
            value = -u;
            for (int a = 0; a < 3; a++) g[a] = -g[a];
        } else if (signed_cap < u) {
            value = signed_cap;
            double length = 0;
            for (int a = 0; a < 3; a++) {
                g[a] = STEEP * (u * g[a] - v * (double)gv[a]) / fmax(cap, 1e-30);
                length += g[a] * g[a];
            }
            length = sqrt(length);
            for (int a = 0; a < 3 && length > GRADIENT_MAX; a++) g[a] *= GRADIENT_MAX / length;
        }
    }
    out[0] = (float)value;
    for (int a = 0; a < 3; a++) out[1 + a] = (float)g[a];
}

// *nodes = new array: exact distance and gradient at the nodes
static sdm_status fill_nodes(const part_solid *p, const sdm_lattice *l, const float **nodes,
                             sdm_error *err)
{
    const size_t n = sdm_lattice_count(l);
    sdm_grid grid = {.dir = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
    for (int a = 0; a < 3; a++) {
        grid.n[a] = l->n[a];
        grid.origin[a] = l->origin[a];
        grid.spacing[a] = l->spacing;
    }
    float *out = NULL;
    layers whole = {0}, own = {0}, rest = {0};
    sdm_status s = SDM_ALLOC(&out, 4 * n, "template", err);
    *nodes = out;
    if (!s) s = fill_layers(p->whole, &grid, &whole, err);
    if (!s && p->own) s = fill_layers(p->own, &grid, &own, err);
    if (!s && p->own) s = fill_layers(p->rest, &grid, &rest, err);
    for (size_t i = 0; i < n && !s; i++) {
        if (p->own) {
            // unsigned: signs of open surfaces mean nothing
            for (int a = 0; a < 3; a++) {
                if (own.value[i] < 0) own.gradient[3 * i + (size_t)a] *= -1;
                if (rest.value[i] < 0) rest.gradient[3 * i + (size_t)a] *= -1;
            }
            open_node(whole.value[i] < 0, fabs((double)own.value[i]), own.gradient + 3 * i,
                      fabs((double)rest.value[i]), rest.gradient + 3 * i, out + 4 * i);
        } else {
            out[4 * i] = whole.value[i];
            memcpy(out + 4 * i + 1, whole.gradient + 3 * i, 3 * sizeof *out);
        }
    }
    layers_free(&whole);
    layers_free(&own);
    layers_free(&rest);
    return s;
}

// Boxes that contain the corners of the grid, carried back into the frame of each part at random
// parameters.
static sdm_status grid_boxes(const template_design *d, sdm_box *boxes, sdm_error *err)
{
    sdm_mesh mesh = {0};
    sdm_status s = SDM_OK;
    for (size_t c = 0; c < d->n_parts; c++) boxes[c] = SDM_BOX_EMPTY;
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
                sdm_box_add(&boxes[c], y);
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
    sdm_box reach[SDM_TEMPLATE_MAX_PARTS];
    sdm_status s = grid_boxes(d, reach, err);
    for (size_t c = 0; c < d->n_parts && !s; c++) {
        sdm_template_part *p = &d->parts[c];
        sdm_box b = SDM_BOX_EMPTY;
        for (size_t k = d->first[c]; k < d->first[c + 1]; k++)
            sdm_box_add(&b, d->family.base.vert + 3 * d->vertices[k]);
        const double margin = (p->n_modes ? NEAR_WARPED : NEAR) * h;
        if (!lattice_of(&b, margin, h, SDM_TEMPLATE_MAX_NODES, &p->near))
            return sdm_fail(err, SDM_E_UNSUPPORTED,
                            "shape '%s': too large for a template with the spacing of the grid",
                            sdm_instance_shape(d->family.shape)->name);
        // a warp moves the grid's voxels by as much as the vertices: the margin of the warp's box
        const double extra = p->n_modes ? 2 * p->warp.spacing : 4 * h;
        double spacing = 3 * h;
        while (!lattice_of(&reach[c], extra, spacing, FAR_NODES, &p->far)) spacing *= 1.2;
        part_solid solid = {0};
        s = make_solid(d, c, &solid, err);
        if (!s) s = fill_nodes(&solid, &p->near, &p->near_nodes, err);
        if (!s) s = fill_nodes(&solid, &p->far, &p->far_nodes, err);
        if (!s) measure_sag(p);
        solid_free(&solid);
    }
    return s;
}
