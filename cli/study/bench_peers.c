/* Measures peers that make the same map. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "bench.h"
#include "bench_programs.h"
#include "report/terminal.h"
#include "sdm/image.h"
#include "sdm/memory.h"

/* Reads the values of the peer that ran last, stores their errors in *row and the values in out
   (may be NULL). After a failure row->done is false and row->note is the reason. */
static void read_values(const cli_bench_case *c, const char *path, float *out, cli_bench_row *row)
{
    double *values = NULL;
    size_t shape[4] = {0};
    int n_dim = 0;
    sdm_error err = {0};
    float *single = NULL;
    sdm_status s = sdm_npy_read(path, &values, shape, &n_dim, &err);
    const size_t wanted[3] = {(size_t)c->grid.n[2], (size_t)c->grid.n[1], (size_t)c->grid.n[0]};
    if (!s && (n_dim != 3 || memcmp(shape, wanted, sizeof wanted) != 0))
        s = sdm_fail(&err, SDM_E_FORMAT, "its values have another size than the grid");
    if (!s) s = SDM_ALLOC(&single, c->voxels, "values of another program", &err);
    for (size_t i = 0; i < c->voxels && !s; i++) single[i] = (float)values[i];
    row->done = !s;
    if (s)
        snprintf(row->note, sizeof row->note, "%.200s", err.text);
    else
        cli_bench_compare(c, single, row);
    if (!s && out) memcpy(out, single, c->voxels * sizeof *out);
    sdm_free(single);
    sdm_free(values);
}

static sdm_status measure_peer(const cli_bench_case *c, const cli_peers *p, const char *name,
                               float *values, cli_bench_row *row, sdm_error *err)
{
    char number[12][32], *arguments[12];
    cli_peer_answer answer;
    for (int i = 0; i < 3; i++) {
        snprintf(number[i], sizeof number[i], "%lld", (long long)c->grid.n[i]);
        sdm_format_real(c->grid.origin[i], number[3 + i]);
        sdm_format_real(c->grid.spacing[i], number[6 + i]);
    }
    sdm_format_real(c->share, number[9]);
    sdm_format_real(isfinite(c->band_mm) ? c->band_mm : 0, number[10]);
    snprintf(number[11], sizeof number[11], "%zu", c->repeat);
    for (int i = 0; i < 12; i++) arguments[i] = number[i];
    const sdm_status s = cli_peers_run(p, name, arguments, 12, &answer, err);
    if (s) return s;
    const bool whole = isfinite(c->band_mm) && answer.done && !answer.band;
    snprintf(row->note, sizeof row->note, "%.240s%s", answer.note, whole ? "; whole map" : "");
    if (answer.done) {
        row->ms_prepare = answer.ms_prepare;
        row->ms_map = answer.ms_map / answer.share;
        row->share = answer.share;
        row->peak_mb = answer.peak_mb;
        read_values(c, p->values_path, values, row);
    }
    return cli_check_interrupt(err);
}

sdm_status cli_bench_peers(const cli_bench_case *c, const cli_args *args, cli_bench_rows *rows,
                           sdm_error *err)
{
    cli_peers p = {.n = 0};
    if (args->peers && !strcmp(args->peers, "none")) return SDM_OK;
    sdm_status s = cli_peers_open(args->peers, &c->mesh, &p, err);
    for (size_t i = 0; i < p.n && !s; i++) {
        cli_bench_row *row = NULL;
        s = cli_bench_add(rows, p.names[i], &row, err);
        if (!s) s = measure_peer(c, &p, p.names[i], NULL, row, err);
    }
    cli_peers_close(&p);
    return s;
}

sdm_status cli_bench_peer(const cli_bench_case *c, const cli_args *args, const char *name,
                          float *values, cli_bench_row *row, sdm_error *err)
{
    cli_peers p = {.n = 0};
    if (args->peers && !strcmp(args->peers, "none")) {
        snprintf(row->note, sizeof row->note, "not run: --peers none");
        return SDM_OK;
    }
    sdm_status s = cli_peers_open(args->peers, &c->mesh, &p, err);
    if (!s) s = measure_peer(c, &p, name, values, row, err);
    cli_peers_close(&p);
    return s;
}
