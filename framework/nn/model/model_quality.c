/* The section of a model file that holds the verdict of its training. Programs that do not know it
   ignore it. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "model_kind.h"

void sdm_quality_describe(const sdm_model_quality *q, sdm_text *t)
{
    if (!q->grade[0]) return;
    sdm_text_add(t, "grade=%s\n", q->grade);
    if (!isnan(q->cut)) sdm_text_add_real(t, "cut", q->cut);
    if (!isnan(q->between_mm)) sdm_text_add_real(t, "between_mm", q->between_mm);
    if (!isnan(q->thickness_mm)) sdm_text_add_real(t, "thickness_mm", q->thickness_mm);
    if (!isnan(q->mesh_volume_mm3) && !isnan(q->mesh_area_mm2)) {
        sdm_text_add_real(t, "mesh_volume_mm3", q->mesh_volume_mm3);
        sdm_text_add_real(t, "mesh_area_mm2", q->mesh_area_mm2);
    }
    if (!isnan(q->volume_error)) sdm_text_add_real(t, "volume_error", q->volume_error);
    if (!isnan(q->derivative_error)) sdm_text_add_real(t, "derivative_error", q->derivative_error);
    if (!isnan(q->volume_derivative_error))
        sdm_text_add_real(t, "volume_derivative_error", q->volume_derivative_error);
    if (!isnan(q->surface_volume_error))
        sdm_text_add_real(t, "surface_volume_error", q->surface_volume_error);
    if (!isnan(q->far_error_mm)) sdm_text_add_real(t, "far_error_mm", q->far_error_mm);
    for (int i = 0; i < SDM_MODEL_PROBES; i++) {
        if (isnan(q->probe_volume_mm3[i]) || isnan(q->probe_area_mm2[i])) break;
        sdm_text_add_real(t, "probe_volume_mm3", q->probe_volume_mm3[i]);
        sdm_text_add_real(t, "probe_area_mm2", q->probe_area_mm2[i]);
    }
    for (const char *at = q->unfit; *at; at += strcspn(at, "\n") + 1)
        sdm_text_add(t, "unfit=%.*s\n", (int)strcspn(at, "\n"), at);
    // last, since programs of earlier versions read no further
    if (isnan(q->mesh_moment_mm3)) return;
    sdm_text_add_real(t, "mesh_moment_mm3", q->mesh_moment_mm3);
    for (int i = 0; i < SDM_MODEL_PROBES && !isnan(q->probe_moment_mm3[i]); i++)
        sdm_text_add_real(t, "probe_moment_mm3", q->probe_moment_mm3[i]);
}

/* Reads the lines of the uses for which the model is not good. */
static void read_unfit(sdm_lines *r, char text[SDM_MODEL_UNFIT])
{
    for (size_t n = 0; sdm_lines_next_is(r, "unfit"); text[n++] = '\n') {
        const char *line = sdm_lines_value(r, "unfit");
        r->failed = r->failed || n + strlen(line) + 2 > SDM_MODEL_UNFIT;
        for (const char *c = line; *c && !r->failed; c++) // it goes to terminals
            r->failed = (unsigned char)*c < ' ' || *c == 127;
        if (r->failed) return;
        n += (size_t)snprintf(text + n, SDM_MODEL_UNFIT - n, "%s", line);
    }
}

sdm_status sdm_quality_read(const sdm_section *section, sdm_model_quality *q, sdm_error *err)
{
    static const char *const grades[] = {"good", "usable", "poor"};
    *q = (sdm_model_quality){.cut = NAN,
                             .between_mm = NAN,
                             .thickness_mm = NAN,
                             .mesh_volume_mm3 = NAN,
                             .mesh_area_mm2 = NAN,
                             .volume_error = NAN,
                             .derivative_error = NAN,
                             .volume_derivative_error = NAN,
                             .surface_volume_error = NAN,
                             .far_error_mm = NAN,
                             .probe_volume_mm3 = {NAN, NAN, NAN},
                             .probe_area_mm2 = {NAN, NAN, NAN},
                             .mesh_moment_mm3 = NAN,
                             .probe_moment_mm3 = {NAN, NAN, NAN}};
    if (!section) return SDM_OK;
    sdm_lines r = {.at = section->data};
    r.end = r.at + section->size;
    sdm_lines_text(&r, "grade", q->grade, sizeof q->grade);
    if (sdm_lines_next_is(&r, "cut")) q->cut = sdm_lines_real(&r, "cut");
    if (sdm_lines_next_is(&r, "between_mm")) q->between_mm = sdm_lines_real(&r, "between_mm");
    if (sdm_lines_next_is(&r, "thickness_mm")) q->thickness_mm = sdm_lines_real(&r, "thickness_mm");
    if (sdm_lines_next_is(&r, "mesh_volume_mm3")) {
        q->mesh_volume_mm3 = sdm_lines_real(&r, "mesh_volume_mm3");
        q->mesh_area_mm2 = sdm_lines_real(&r, "mesh_area_mm2");
    }
    if (sdm_lines_next_is(&r, "volume_error")) q->volume_error = sdm_lines_real(&r, "volume_error");
    if (sdm_lines_next_is(&r, "derivative_error"))
        q->derivative_error = sdm_lines_real(&r, "derivative_error");
    if (sdm_lines_next_is(&r, "volume_derivative_error"))
        q->volume_derivative_error = sdm_lines_real(&r, "volume_derivative_error");
    if (sdm_lines_next_is(&r, "surface_volume_error"))
        q->surface_volume_error = sdm_lines_real(&r, "surface_volume_error");
    if (sdm_lines_next_is(&r, "far_error_mm")) q->far_error_mm = sdm_lines_real(&r, "far_error_mm");
    for (int i = 0; i < SDM_MODEL_PROBES && sdm_lines_next_is(&r, "probe_volume_mm3"); i++) {
        q->probe_volume_mm3[i] = sdm_lines_real(&r, "probe_volume_mm3");
        q->probe_area_mm2[i] = sdm_lines_real(&r, "probe_area_mm2");
    }
    read_unfit(&r, q->unfit);
    if (sdm_lines_next_is(&r, "mesh_moment_mm3"))
        q->mesh_moment_mm3 = sdm_lines_real(&r, "mesh_moment_mm3");
    for (int i = 0; i < SDM_MODEL_PROBES && sdm_lines_next_is(&r, "probe_moment_mm3"); i++)
        q->probe_moment_mm3[i] = sdm_lines_real(&r, "probe_moment_mm3");
    bool known = false;
    for (size_t i = 0; i < sizeof grades / sizeof *grades; i++)
        known = known || !strcmp(q->grade, grades[i]);
    if (!known || q->cut < 0 || q->cut > 1 || q->between_mm < 0 || q->thickness_mm < 0 ||
        q->mesh_area_mm2 < 0 || q->volume_error < 0 || q->derivative_error < 0 ||
        q->volume_derivative_error < 0 || q->surface_volume_error < 0 || q->far_error_mm < 0)
        r.failed = true;
    return sdm_lines_check(&r, err);
}
