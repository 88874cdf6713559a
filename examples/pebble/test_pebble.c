/* Tests the mesh of the shape `pebble` at its corners and at random parameters, through the C
 * interface of sdmgen. Usage: test_pebble PLUGIN */
#include <sdm/sdmgen.h>
#include <stdio.h>
#include <stdlib.h>

enum { MESHES = 200 };

/* p[n] = random parameters: each is the lower end of its range, the upper end, or a value between
 * them. */
static void draw_parameters(const sdm_param *params, size_t n, double *p)
{
    for (size_t i = 0; i < n; i++) {
        const int place = rand() % 3;
        const double share = place < 2 ? place : rand() / (RAND_MAX + 1.0);
        // at 0 and 1 exactly the ends of the range
        p[i] = (1 - share) * params[i].min + share * params[i].max;
    }
}

/* Makes the mesh at p and tests it. *n_vert: the number of vertices that it must have; 0: any
 * number, which is then stored. SDM_E_MESH: err says what is wrong. */
static sdm_status check_mesh(const sdm_instance *shape, const double *p, sdm_mesh *mesh,
                             size_t *n_vert, sdm_error *err)
{
    sdm_audit audit;
    sdm_status s = sdm_instance_mesh(shape, p, mesh, err);
    if (!s) s = sdm_mesh_audit(mesh, &audit, err);
    if (s) return s;
    if (audit.degenerate > 0)
        return sdm_fail(err, SDM_E_MESH, "%zu triangles have no area", audit.degenerate);
    if (!audit.closed)
        return sdm_fail(err, SDM_E_MESH, "the mesh is not closed: %zu edges have one triangle",
                        audit.boundary_edges);
    if (audit.inverted || audit.misoriented_edges > 0)
        return sdm_fail(err, SDM_E_MESH, "triangles are clockwise seen from outside");
    if (*n_vert > 0 && *n_vert != mesh->n_vert)
        return sdm_fail(err, SDM_E_MESH, "%zu vertices, elsewhere %zu", mesh->n_vert, *n_vert);
    *n_vert = mesh->n_vert;
    // add what you know about your shape, such as its volume at p
    return SDM_OK;
}

static sdm_status check_shape(const sdm_instance *shape, sdm_error *err)
{
    size_t n, n_vert = 0;
    const sdm_param *params = sdm_instance_params(shape, &n);
    double *p = NULL;
    sdm_mesh mesh = {0};
    sdm_status s = SDM_ALLOC(&p, n, "parameters", err);
    for (int i = 0; i < MESHES && !s; i++) {
        draw_parameters(params, n, p);
        s = check_mesh(shape, p, &mesh, &n_vert, err);
        for (size_t k = 0; k < n && s; k++) fprintf(stderr, "%s=%g ", params[k].name, p[k]);
    }
    sdm_mesh_dispose(&mesh);
    sdm_free(p);
    return s;
}

int main(int argc, char **argv)
{
    if (argc != 2) {
        fputs("usage: test_pebble PLUGIN\n", stderr);
        return 2;
    }
    sdm_error err = {0};
    sdm_registry *registry = NULL;
    sdm_instance *shape = NULL;
    sdm_status s = sdm_registry_create(&registry, &err);
    if (!s) s = sdm_registry_load(registry, argv[1], &err);
    if (!s) s = sdm_instance_create(sdm_registry_at(registry, 0), NULL, 0, NULL, &shape, &err);
    if (!s) s = check_shape(shape, &err);
    if (s) fprintf(stderr, "test_pebble: %s\n", err.text);
    sdm_instance_free(shape);
    sdm_registry_free(registry);
    return s ? 1 : 0;
}
