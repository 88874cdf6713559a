/* Tells which flat faces lie on planes of voxel centres. */
#include "grid_hits.h"

#include "report/terminal.h"
#include "survey/findings.h"

void cli_tell_hits(const sdm_mesh *mesh, const sdm_grid *g, bool counted, bool has_origin)
{
    sdm_face_hits h;
    sdm_text text = {0};
    if (sdm_grid_face_hits(mesh, g, &h, NULL) || h.share < SDM_FACE_HITS_MIN) return;
    cli_describe_hits(&h, &text);
    if (has_origin)
        sdm_text_add(&text, "; with --origin %.10g,%.10g,%.10g they lie between the planes",
                     h.moved.origin[0], h.moved.origin[1], h.moved.origin[2]);
    if (!text.failed && counted) cli_warn("%s", text.data);
    if (!text.failed && !counted) cli_notice("%s", text.data);
    sdm_text_dispose(&text);
}
