/* Prints the figures of a mesh audit. */
#include "report_audit.h"

#include <stdio.h>

#include "json_values.h"
#include "terminal.h"

void cli_print_audit(const sdm_audit *a)
{
    printf("vertices             %zu\n", a->n_vert);
    printf("triangles            %zu\n", a->n_tri);
    printf("components           %zu\n", a->components);
    printf("closed               %s\n", a->closed ? "yes" : "no");
    printf("manifold             %s\n", a->manifold ? "yes" : "no");
    printf("inside out           %s\n", a->inverted ? "yes" : "no");
    printf("boundary edges       %zu\n", a->boundary_edges);
    printf("non-manifold edges   %zu\n", a->nonmanifold_edges);
    printf("misoriented edges    %zu\n", a->misoriented_edges);
    printf("degenerate triangles %zu\n", a->degenerate);
    printf("duplicate triangles  %zu\n", a->duplicate);
    printf("self-intersections   %zu\n", a->self_intersections);
    printf("volume               %.6g mm^3\n", a->volume);
    printf("area                 %.6g mm^2\n", a->area);
    printf("box                  %.6g %.6g %.6g .. %.6g %.6g %.6g mm\n", a->min[0], a->min[1],
           a->min[2], a->max[0], a->max[1], a->max[2]);
}

void cli_json_audit(sdm_json *json, const sdm_audit *a)
{
    sdm_json_int(json, "vertices", (int64_t)a->n_vert);
    sdm_json_int(json, "triangles", (int64_t)a->n_tri);
    sdm_json_int(json, "components", (int64_t)a->components);
    sdm_json_bool(json, "closed", a->closed);
    sdm_json_bool(json, "manifold", a->manifold);
    sdm_json_bool(json, "inverted", a->inverted);
    sdm_json_int(json, "boundary_edges", (int64_t)a->boundary_edges);
    sdm_json_int(json, "nonmanifold_edges", (int64_t)a->nonmanifold_edges);
    sdm_json_int(json, "misoriented_edges", (int64_t)a->misoriented_edges);
    sdm_json_int(json, "degenerate", (int64_t)a->degenerate);
    sdm_json_int(json, "duplicate", (int64_t)a->duplicate);
    sdm_json_int(json, "self_intersections", (int64_t)a->self_intersections);
    sdm_json_real(json, "volume_mm3", a->volume);
    sdm_json_real(json, "area_mm2", a->area);
    cli_json_reals(json, "min", a->min, 3);
    cli_json_reals(json, "max", a->max, 3);
}

void cli_notice_audit(const sdm_audit *a)
{
    if (a->boundary_edges > 0)
        cli_notice(
            "the mesh is open: %zu boundary edges; inside is where the winding number exceeds 1/2",
            a->boundary_edges);
    if (a->nonmanifold_edges > 0)
        cli_notice("%zu edges with more than two triangles", a->nonmanifold_edges);
    if (a->misoriented_edges > 0)
        cli_notice("%zu edges with triangles of opposite orientation", a->misoriented_edges);
    if (a->degenerate > 0) cli_notice("%zu degenerate triangles", a->degenerate);
    if (a->duplicate > 0) cli_notice("%zu duplicate triangles", a->duplicate);
}
