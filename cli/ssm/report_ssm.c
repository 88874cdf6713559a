/* Describes a statistical shape model, as text and as JSON. */
#include "report_ssm.h"

#include <math.h>
#include <stdio.h>

#include "report/terminal.h"

void cli_print_ssm(const char *path, const sdm_ssm *m)
{
    double sum = 0;
    printf("%s: shape model of %zu points, %zu triangles, %zu modes\n\n", path, m->n_vert, m->n_tri,
           m->n_modes);
    if (m->about[0]) printf("%s\n", m->about);
    printf("mode   sd of a point (mm)   variance   together\n");
    for (size_t i = 0; i < m->n_modes; i++) {
        sum += m->variance[i];
        printf("m%-4zu  %18.4f  %7.2f %%  %7.2f %%\n", i + 1,
               sqrt(m->variance[i] / (double)m->n_vert), 100 * m->variance[i] / m->total,
               100 * sum / m->total);
    }
    if (m->noise > 0) printf("noise  %18.4f\n", sqrt(3 * m->noise));
    printf("\nuse it: shape: {name: statistical, options: {model: %s}}\n", path);
}

sdm_status cli_json_ssm(const char *path, const sdm_ssm *m, sdm_error *err)
{
    sdm_json j = {0};
    sdm_json_open(&j, NULL, '{');
    sdm_json_text(&j, "file", path);
    sdm_json_text(&j, "type", "ssm");
    sdm_json_uint(&j, "points", m->n_vert);
    sdm_json_uint(&j, "triangles", m->n_tri);
    sdm_json_uint(&j, "modes", m->n_modes);
    sdm_json_open(&j, "variances_mm2", '[');
    for (size_t i = 0; i < m->n_modes; i++) sdm_json_real(&j, NULL, m->variance[i]);
    sdm_json_close(&j, ']');
    sdm_json_real(&j, "total_variance_mm2", m->total);
    sdm_json_real(&j, "noise_variance_mm2", m->noise);
    sdm_json_close(&j, '}');
    return cli_print_json(&j, err);
}
