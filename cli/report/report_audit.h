/* Prints a mesh audit as text, as JSON and as warnings, and judges the mesh. */
#pragma once

#include "sdm/internal/part_audit.h"
#include "sdm/internal/text.h"

/* Prints all figures of the audit and a table of the parts on stdout. */
void cli_print_audit(const sdm_part_audit *a);

/* Adds the figures of the whole mesh as members of the open object; cli_json_parts() adds those of
 * the union and of the parts, the first 1000. */
void cli_json_audit(sdm_json *json, const sdm_audit *a);
void cli_json_parts(sdm_json *json, const sdm_part_audit *a);

/* Warns of edges whose triangles are badly oriented; prints notices about defects that change
 * nothing: non-manifold edges, degenerate or duplicate triangles. */
void cli_warn_audit(const sdm_audit *a);

/* Appends "part 2 of 3 (12 triangles, vertices 8 .. 15, box ...) ". */
void cli_name_part(const sdm_part_audit *a, size_t index, sdm_text *text);

/* Are the vertices of the triangles of part i to be reversed? Where maps turn the whole mesh for
 * the larger parts, theirs are, not those of the ones that are subtracted then. */
bool cli_part_inside_out(const sdm_part_audit *a, size_t i);

/* Appends "part 2 of 2 (...) lies 2.2 mm from the others; ..." about the smallest part that meets
 * no other, or that it lies inside one; appends nothing if there is none. */
void cli_describe_apart(const sdm_mesh *mesh, const sdm_part_audit *audit, sdm_text *text);

/* Parts whose triangles face inwards (inside out) are missing from maps, unless the exact engine
 * turns them. Appends a sentence to `text` about all those that it does not turn, with the numbers,
 * vertices and boxes of the first four. Appends nothing if there are none. */
void cli_describe_inside_out(const sdm_part_audit *a, sdm_text *text);

/* Appends a sentence about the parts that are inside out and that the exact engine turns: the whole
 * mesh, or the first four of them. Appends nothing if there are none. */
void cli_describe_turned(const sdm_part_audit *a, sdm_text *text);

/* Does the engine turn all parts? */
bool cli_is_turned(const sdm_part_audit *a);

/* Writes one line about the part with most open edges to `text`: where it is, where its first open
 * edge is, and what to do; nothing if the mesh is closed. */
void cli_describe_open(const sdm_part_audit *a, sdm_text *text);

/* Writes one line about vertices of no triangle to `text`; nothing if there are none. */
void cli_describe_unused(const sdm_part_audit *a, sdm_text *text);

/* Writes one line about the part with the largest sdm_part_tangle() to `text`. false: there is
 * none; `text` stays as it was. */
bool cli_describe_folded(const sdm_part_audit *a, sdm_text *text);

/* Writes one line about part `index`, whose thickness is known and too small for voxels of this
 * size (mm), to `text`: where it is, what becomes of it, and which spacing shows it. */
void cli_describe_thin(const sdm_part_audit *a, size_t index, double voxel, sdm_text *text);

/* Judges the mesh. SDM_E_MESH: it is not closed; SDM_E_QUALITY: vertices belong to no triangle,
 * parts are inside out and not turned by the engine or pass through themselves, one part of
 * several is thinner than a thousandth of the mesh, or it encloses no volume. The message says what
 * is wrong and what the user can do (mend, for parts that are inside out). */
sdm_status cli_audit_verdict(const sdm_part_audit *a, const char *mend, sdm_error *err);

/* "fine", "warning" or "broken", for the results of cli_audit_verdict(). */
const char *cli_verdict_name(sdm_status verdict);

/* Audits the mesh and warns as cli_warn_audit() does, and of the part with most open edges, of
 * vertices of no triangle, of parts that are inside out, and of the thinnest
 * part if it is too thin for voxels of this size (mm; 0: there is no grid). mend: what the user can
 * do about an inside-out part. Says nothing if the audit fails: the engine reports that. Returns
 * whether it warned of a thin part. */
bool cli_warn_mesh(const sdm_mesh *mesh, double voxel, const char *mend);

/* Turns the parts of the mesh that are inside out (--turn-parts) and says how many. */
sdm_status cli_turn_parts(sdm_mesh *mesh, sdm_error *err);

/* Adds what is said of a part that is too thin for voxels of this size: "0.2 mm thick, too thin for
 * ...". */
void cli_add_thin(double thick, double voxel, sdm_text *text);

/* What to do about an inside-out part: of the mesh of a shape, and of a mesh file. */
#define CLI_MEND_SHAPE "reverse the vertices of these triangles in mesh() of the shape"
#define CLI_MEND_WHOLE "exchange two vertices of every triangle in mesh() of the shape"
#define CLI_MEND_FILE "--turn-parts mends this"
