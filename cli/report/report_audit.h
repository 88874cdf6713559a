/* A mesh audit as text and as JSON. */
#ifndef CLI_REPORT_AUDIT_H
#define CLI_REPORT_AUDIT_H

#include "sdm/internal/text.h"
#include "sdm/mesh.h"

void cli_print_audit(const sdm_audit *a);
void cli_json_audit(sdm_json *json, const sdm_audit *a);
/* Notices of what an exact map of the mesh has to cope with; none of a closed mesh without blemish.
 */
void cli_notice_audit(const sdm_audit *a);

#endif
