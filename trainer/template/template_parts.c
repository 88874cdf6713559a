/* Finds the parts of a shape from its meshes. */
#include "template_parts.h"

#include <math.h>
#include <string.h>

#include "pieces.h"
#include "sdm/memory.h"

enum { SAMPLES = 192, FIRST_SAMPLES = 8 };

/* Pieces that flex overlap their neighbours by this multiple of the tolerance: four voxels. */
static const double OVERLAP = 200;

double trainer_template_motion(const template_design *d, size_t c, const double *vert, motion *out)
{
    const uint32_t *v = d->vertices + d->first[c];
    const size_t n = d->first[c + 1] - d->first[c];
    const double *from = d->family.base.vert;
    if (d->parts[c].frame == SDM_FRAME_AFFINE) return trainer_motion_affine(from, vert, v, n, out);
    if (d->parts[c].frame == SDM_FRAME_RIGID) return trainer_motion_rigid(from, vert, v, n, out);
    *out = (motion){{1, 0, 0, 0, 1, 0, 0, 0, 1}, {0}};
    return 0;
}

// Lists the vertices of each component as a part; one part with those of all components if `whole`.
static sdm_status list_vertices(template_design *d, bool whole, sdm_error *err)
{
    const size_t n = d->family.base.n_vert;
    sdm_free(d->vertices);
    const sdm_status s = SDM_ALLOC(&d->vertices, n, "parts", err);
    if (s) return s;
    d->n_parts = whole ? 1 : d->family.n_components;
    size_t at = 0;
    for (size_t c = 0; c < d->n_parts; c++) {
        d->first[c] = at;
        for (size_t v = 0; v < n; v++)
            if (whole ? d->family.component[v] != UINT32_MAX : d->family.component[v] == c)
                d->vertices[at++] = (uint32_t)v;
    }
    d->first[d->n_parts] = at;
    return SDM_OK;
}

// Largest distances that remain over the samples, and the largest rotation angle, of each part.
typedef struct residuals {
    double still[SDM_TEMPLATE_MAX_PARTS], rigid[SDM_TEMPLATE_MAX_PARTS],
        affine[SDM_TEMPLATE_MAX_PARTS], angle[SDM_TEMPLATE_MAX_PARTS];
} residuals;

// The residuals of all parts in the first n random meshes.
static sdm_status measure(const template_design *d, size_t n_meshes, residuals *r, sdm_error *err)
{
    sdm_mesh mesh = {0};
    double p[SDM_POD_MAX_PARAMS];
    sdm_status s = SDM_OK;
    *r = (residuals){0};
    for (size_t i = 0; i < n_meshes && !s; i++) {
        trainer_family_params(&d->family, i, p);
        s = trainer_family_mesh(&d->family, p, &mesh, err);
        for (size_t c = 0; c < d->n_parts && !s; c++) {
            const uint32_t *v = d->vertices + d->first[c];
            const size_t n = d->first[c + 1] - d->first[c];
            const double *from = d->family.base.vert;
            motion m;
            double sum = 0, rotation[3], stretch[6];
            for (size_t k = 0; k < n; k++)
                for (size_t a = 0; a < 3; a++) {
                    const double e = mesh.vert[3 * v[k] + a] - from[3 * v[k] + a];
                    sum += e * e;
                }
            r->still[c] = fmax(r->still[c], sqrt(sum / (double)n));
            r->affine[c] = fmax(r->affine[c], trainer_motion_affine(from, mesh.vert, v, n, &m));
            r->rigid[c] = fmax(r->rigid[c], trainer_motion_rigid(from, mesh.vert, v, n, &m));
            trainer_motion_polar(m.m, rotation, stretch);
            r->angle[c] =
                fmax(r->angle[c], sqrt(rotation[0] * rotation[0] + rotation[1] * rotation[1] +
                                       rotation[2] * rotation[2]));
        }
    }
    sdm_mesh_dispose(&mesh);
    return s;
}

/* Which parameters a part's motion relative to another part depends on; world = n_parts. */
typedef struct dependence {
    uint64_t on[SDM_TEMPLATE_MAX_PARTS][SDM_TEMPLATE_MAX_PARTS + 1];
} dependence;

// Bounding box of a part in the base mesh.
static void part_box(const template_design *d, size_t c, double min[3], double max[3])
{
    for (int a = 0; a < 3; a++) min[a] = INFINITY, max[a] = -INFINITY;
    for (size_t k = d->first[c]; k < d->first[c + 1]; k++)
        for (int a = 0; a < 3; a++) {
            const double x = d->family.base.vert[3 * d->vertices[k] + (size_t)a];
            min[a] = fmin(min[a], x), max[a] = fmax(max[a], x);
        }
}

// Largest distance between the places to which two motions carry the corners of a box.
static double box_distance(const motion *a, const motion *b, const double min[3],
                           const double max[3])
{
    double largest = 0;
    for (int k = 0; k < 8; k++) {
        const double x[3] = {k & 1 ? max[0] : min[0], k & 2 ? max[1] : min[1],
                             k & 4 ? max[2] : min[2]};
        double sum = 0;
        for (int i = 0; i < 3; i++) {
            double e = a->b[i] - b->b[i];
            for (int j = 0; j < 3; j++) e += (a->m[3 * i + j] - b->m[3 * i + j]) * x[j];
            sum += e * e;
        }
        largest = fmax(largest, sqrt(sum));
    }
    return largest;
}

// Motions of all parts at p.
static sdm_status motions_at(const template_design *d, const double *p, sdm_mesh *mesh, motion *m,
                             sdm_error *err)
{
    const sdm_status s = trainer_family_mesh(&d->family, p, mesh, err);
    for (size_t c = 0; c < d->n_parts && !s; c++) trainer_template_motion(d, c, mesh->vert, &m[c]);
    m[d->n_parts] = (motion){{1, 0, 0, 0, 1, 0, 0, 0, 1}, {0}};
    return s;
}

// Varies one parameter at a time around a few points of the parameter space.
static sdm_status find_dependence(const template_design *d, double tolerance, dependence *dep,
                                  sdm_error *err)
{
    enum { POINTS = 3, VALUES = 5 };
    const family *f = &d->family;
    sdm_mesh mesh = {0};
    sdm_status s = SDM_OK;
    *dep = (dependence){0};
    double min[SDM_TEMPLATE_MAX_PARTS][3], max[SDM_TEMPLATE_MAX_PARTS][3];
    for (size_t c = 0; c < d->n_parts; c++) part_box(d, c, min[c], max[c]);
    for (size_t point = 0; point < POINTS; point++)
        for (size_t k = 0; k < f->n_params; k++) {
            double p[SDM_POD_MAX_PARAMS];
            motion first[SDM_TEMPLATE_MAX_PARTS + 1], here[SDM_TEMPLATE_MAX_PARTS + 1];
            trainer_family_params(f, point, p);
            for (int v = 0; v < VALUES && !s; v++) {
                p[k] = f->min[k] + (f->max[k] - f->min[k]) * (v + 0.5) / VALUES;
                s = motions_at(d, p, &mesh, v ? here : first, err);
                for (size_t c = 0; c < d->n_parts && v && !s; c++)
                    for (size_t b = 0; b <= d->n_parts; b++) {
                        motion x, y;
                        trainer_motion_relative(&first[b], &first[c], &x);
                        trainer_motion_relative(&here[b], &here[c], &y);
                        if (box_distance(&x, &y, min[c], max[c]) > tolerance)
                            dep->on[c][b] |= UINT64_C(1) << k;
                    }
            }
        }
    sdm_mesh_dispose(&mesh);
    return s;
}

static int count_bits(uint64_t v)
{
    int n = 0;
    for (; v; v &= v - 1) n++;
    return n;
}

// Merges parts without a warp that never move relative to each other; those that never move at all
// become one part without a frame.
static sdm_status merge_parts(template_design *d, dependence *dep, sdm_error *err)
{
    size_t to[SDM_TEMPLATE_MAX_PARTS], n = 0, old[SDM_TEMPLATE_MAX_PARTS];
    for (size_t c = 0; c < d->n_parts; c++) {
        to[c] = SDM_TEMPLATE_MAX_PARTS;
        for (size_t b = 0; b < c && to[c] == SDM_TEMPLATE_MAX_PARTS; b++)
            if (!d->parts[c].n_modes && !d->parts[b].n_modes &&
                (!dep->on[c][b] || (!dep->on[c][d->n_parts] && !dep->on[b][d->n_parts])))
                to[c] = to[b];
        if (to[c] == SDM_TEMPLATE_MAX_PARTS) old[n] = c, to[c] = n++;
    }
    // vertices, part after part
    uint32_t *vertices = NULL;
    const sdm_status s = SDM_ALLOC(&vertices, d->first[d->n_parts], "parts", err);
    if (s) return s;
    size_t at = 0, first[SDM_TEMPLATE_MAX_PARTS + 1];
    for (size_t m = 0; m < n; m++) {
        first[m] = at;
        for (size_t c = 0; c < d->n_parts; c++)
            for (size_t k = d->first[c]; k < d->first[c + 1] && to[c] == m; k++)
                vertices[at++] = d->vertices[k];
    }
    first[n] = at;
    dependence merged = {0};
    for (size_t m = 0; m < n; m++) {
        d->parts[m] = d->parts[old[m]];
        for (size_t b = 0; b < n; b++) merged.on[m][b] = dep->on[old[m]][old[b]];
        merged.on[m][n] = dep->on[old[m]][d->n_parts];
        if (!merged.on[m][n] && !d->parts[m].n_modes) d->parts[m].frame = SDM_FRAME_NONE;
    }
    memcpy(d->first, first, (n + 1) * sizeof *first);
    sdm_free(d->vertices);
    d->vertices = vertices;
    d->n_parts = n;
    *dep = merged;
    return SDM_OK;
}

// Parents: each part joins the world or a part that has a parent already, where its relative motion
// depends on the fewest parameters. Reorders the parts so that parents come first.
static sdm_status order_parts(template_design *d, const dependence *dep, sdm_error *err)
{
    const size_t n = d->n_parts;
    size_t order[SDM_TEMPLATE_MAX_PARTS], place[SDM_TEMPLATE_MAX_PARTS];
    int parent[SDM_TEMPLATE_MAX_PARTS];
    bool placed[SDM_TEMPLATE_MAX_PARTS] = {false};
    for (size_t i = 0; i < n; i++) {
        size_t best = 0, best_parent = n;
        int fewest = 1000;
        for (size_t c = 0; c < n; c++) {
            if (placed[c]) continue;
            for (size_t b = 0; b <= n; b++) {
                const size_t candidate = b == 0 ? n : b - 1; // the world first
                if (candidate < n && !placed[candidate]) continue;
                // an affine parent would stretch its children, a joint moves only by half
                if (candidate < n &&
                    (d->parts[candidate].frame == SDM_FRAME_AFFINE || d->parts[candidate].n_modes))
                    continue;
                const int bits = count_bits(dep->on[c][candidate]);
                if (bits < fewest) fewest = bits, best = c, best_parent = candidate;
            }
        }
        placed[best] = true;
        order[i] = best;
        place[best] = i;
        parent[i] = best_parent == n ? -1 : (int)place[best_parent];
    }
    uint32_t *vertices = NULL;
    const sdm_status s = SDM_ALLOC(&vertices, d->first[n], "parts", err);
    if (s) return s;
    sdm_template_part parts[SDM_TEMPLATE_MAX_PARTS];
    size_t first[SDM_TEMPLATE_MAX_PARTS + 1], at = 0;
    for (size_t i = 0; i < n; i++) {
        const size_t c = order[i], count = d->first[c + 1] - d->first[c];
        parts[i] = d->parts[c];
        parts[i].parent = parent[i];
        first[i] = at;
        memcpy(vertices + at, d->vertices + d->first[c], count * sizeof *vertices);
        at += count;
    }
    first[n] = at;
    memcpy(d->parts, parts, n * sizeof *parts);
    memcpy(d->first, first, (n + 1) * sizeof *first);
    sdm_free(d->vertices);
    d->vertices = vertices;
    return SDM_OK;
}

// True if a component is inside out, as the surface of a cavity is: the solid is then not the union
// of the components. At most SDM_TEMPLATE_MAX_PARTS components.
static bool has_cavity(const family *f)
{
    double volume[SDM_TEMPLATE_MAX_PARTS] = {0};
    for (size_t t = 0; t < f->base.n_tri; t++) {
        const uint32_t *v = f->base.tri + 3 * t;
        const double *a = f->base.vert + 3 * v[0], *b = f->base.vert + 3 * v[1],
                     *c = f->base.vert + 3 * v[2];
        volume[f->component[v[0]]] += a[0] * (b[1] * c[2] - b[2] * c[1]) +
                                      a[1] * (b[2] * c[0] - b[0] * c[2]) +
                                      a[2] * (b[0] * c[1] - b[1] * c[0]);
    }
    for (size_t c = 0; c < f->n_components; c++)
        if (volume[c] < 0) return true;
    return false;
}

// True if the components are one part in any case.
static bool is_whole(const family *f)
{
    return f->n_components > SDM_TEMPLATE_MAX_PARTS || has_cavity(f);
}

// Replaces the components that bend by their pieces; those without rigid pieces stay as they are.
// The list of parts is left empty if there would be too many.
static sdm_status split_parts(template_design *d, const residuals *r, double tolerance,
                              sdm_error *err)
{
    const family *f = &d->family;
    const double overlap = OVERLAP * tolerance;
    uint32_t *vertices = NULL;
    size_t first[SDM_TEMPLATE_MAX_PARTS + 1] = {0}, n = 0;
    sdm_status s = SDM_OK;
    for (uint32_t c = 0; c < f->n_components && !s; c++) {
        const uint32_t *own = d->vertices + d->first[c];
        pieces found = {0};
        if (r->affine[c] > tolerance)
            s = trainer_pieces_find(f, c, tolerance, overlap, &found, err);
        const bool split = found.n > 0;
        const size_t count = split ? found.n : 1,
                     added = split ? found.first[found.n] : d->first[c + 1] - d->first[c];
        if (n + count > SDM_TEMPLATE_MAX_PARTS) {
            trainer_pieces_dispose(&found);
            n = 0;
            break;
        }
        uint32_t *longer = NULL;
        if (!s) s = SDM_ALLOC(&longer, first[n] + added, "parts", err);
        if (!s) {
            if (n) memcpy(longer, vertices, first[n] * sizeof *longer);
            memcpy(longer + first[n], split ? found.vertices : own, added * sizeof *longer);
            sdm_free(vertices);
            vertices = longer;
            for (size_t k = 1; k <= count; k++)
                first[n + k] = first[n] + (split ? found.first[k] : added);
            n += count;
        }
        trainer_pieces_dispose(&found);
    }
    sdm_free(d->vertices);
    d->vertices = vertices;
    d->n_parts = s ? 0 : n;
    memcpy(d->first, first, sizeof first);
    return s;
}

// The frames that the residuals ask for.
static void choose_frames(template_design *d, const residuals *r, double tolerance)
{
    for (size_t c = 0; c < d->n_parts; c++) {
        sdm_template_part *p = &d->parts[c];
        p->parent = -1;
        p->n_modes = r->affine[c] > tolerance;
        p->frame = r->still[c] <= tolerance              ? SDM_FRAME_NONE
                   : r->rigid[c] <= tolerance            ? SDM_FRAME_RIGID
                   : r->affine[c] <= tolerance           ? SDM_FRAME_AFFINE
                   : r->angle[c] > 0.7 || d->n_parts > 1 ? SDM_FRAME_RIGID
                                                         : SDM_FRAME_NONE;
    }
}

sdm_status trainer_template_bends(const family *from, double tolerance, bool *out, sdm_error *err)
{
    template_design d = {.family = *from};
    residuals r;
    sdm_status s = trainer_family_create(&d.family, err);
    const bool whole = !s && is_whole(&d.family);
    if (!s) s = list_vertices(&d, whole, err);
    if (!s) s = measure(&d, FIRST_SAMPLES, &r, err);
    *out = false;
    for (size_t c = 0; c < d.n_parts && !s; c++)
        *out |= (d.n_parts > 1 ? r.affine[c] : r.rigid[c]) > tolerance;
    trainer_family_dispose(&d.family);
    sdm_free(d.vertices);
    return s;
}

sdm_status trainer_template_divides(const family *from, double tolerance, bool *out, sdm_error *err)
{
    family f = *from;
    pieces found = {0};
    sdm_status s = trainer_family_create(&f, err);
    const bool whole = !s && is_whole(&f);
    if (!s && !whole && f.n_components == 1)
        s = trainer_pieces_find(&f, 0, tolerance, OVERLAP * tolerance, &found, err);
    *out = !s && !whole && (f.n_components > 1 || found.n > 1);
    trainer_pieces_dispose(&found);
    trainer_family_dispose(&f);
    return s;
}

sdm_status trainer_template_parts(template_design *d, double tolerance, sdm_error *err)
{
    const bool whole = is_whole(&d->family);
    residuals r;
    sdm_status s = list_vertices(d, whole, err);
    if (!s) s = measure(d, SAMPLES, &r, err);
    if (s) return s;
    bool bends = false;
    for (size_t c = 0; c < d->n_parts; c++) bends |= r.affine[c] > tolerance;
    if (bends && d->split && !whole) {
        s = split_parts(d, &r, tolerance, err);
        if (!s && d->n_parts > 1) s = measure(d, SAMPLES, &r, err);
    }
    // a component that bends: the whole shape becomes one part with a warp
    if (!s && bends && d->n_parts != 1 && (!d->split || d->n_parts == 0)) {
        s = list_vertices(d, true, err);
        if (!s) s = measure(d, SAMPLES, &r, err);
    }
    if (s) return s;
    choose_frames(d, &r, tolerance);
    if (d->n_parts == 1) return SDM_OK;
    dependence dep;
    s = find_dependence(d, 2 * tolerance, &dep, err);
    if (!s) s = merge_parts(d, &dep, err);
    if (!s) s = order_parts(d, &dep, err);
    return s;
}
