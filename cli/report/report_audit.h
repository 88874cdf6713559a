/* Prints a mesh audit as text, as JSON and as notices. */
#pragma once

#include "sdm/internal/part_audit.h"
#include "sdm/internal/text.h"

/* Prints all figures of the audit and a table of the parts on stdout. */
void cli_print_audit(const sdm_part_audit *a);

/* Adds the figures of the whole mesh as members of the open object; cli_json_parts() adds those of
 * the union and of the parts, the first 1000. */
void cli_json_audit(sdm_json *json, const sdm_audit *a);
void cli_json_parts(sdm_json *json, const sdm_part_audit *a);

/* Prints a notice for each defect that affects an exact map: boundary, non-manifold or misoriented
 * edges, degenerate or duplicate triangles. */
void cli_notice_audit(const sdm_audit *a);

/* Writes one line about part `index`, which is inside out, to `text`: its number, box and vertices,
 * and what becomes of it. */
void cli_describe_part(const sdm_part_audit *a, size_t index, sdm_text *text);

/* Audits the parts of the mesh and prints one notice for each of the first parts that are inside
 * out and that the engine does not turn. mend: what the user can do. Errors are no notices: the
 * engine reports them. */
void cli_notice_parts(const sdm_mesh *mesh, const char *mend);

/* Turns the parts of the mesh that are inside out (--turn-parts) and says how many. */
sdm_status cli_turn_parts(sdm_mesh *mesh, sdm_error *err);

/* What to do about an inside-out part: of the mesh of a shape, and of a mesh file. */
#define CLI_MEND_SHAPE "reverse the vertices of its triangles in mesh() of the shape"
#define CLI_MEND_FILE "--turn-parts reverses it"
