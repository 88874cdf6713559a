/* Prints a mesh audit as text, as JSON and as notices. */
#pragma once

#include "sdm/internal/text.h"
#include "sdm/mesh.h"

/* Prints all figures of the audit on stdout, one per line. */
void cli_print_audit(const sdm_audit *a);

/* Adds the figures as members of the open object. */
void cli_json_audit(sdm_json *json, const sdm_audit *a);

/* Prints a notice for each defect that affects an exact map: boundary, non-manifold or misoriented
 * edges, degenerate or duplicate triangles. */
void cli_notice_audit(const sdm_audit *a);
