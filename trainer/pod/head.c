/* Computes latent variables, and solves for the head by least squares. */
#include "head.h"

#include <stdatomic.h>
#include <string.h>

#include "coefficients.h"
#include "mlp.h"
#include "numerics/linalg.h"
#include "sdm/internal/kernels.h"
#include "sdm/internal/team.h"
#include "sdm/memory.h"
#include "state/progress.h"

void trainer_head_latent(const pod_state *pod, const float *w, size_t rows, const float *const *phi,
                         float *x, float *z, float *workspace)
{
    const sdm_pod_arch *a = &pod->arch;
    for (size_t i = 0; i < rows; i++) {
        memcpy(z + i * a->n_latent, phi[i], a->n_terms * sizeof *z);
        memcpy(x + i * a->n_inputs, phi[i] + 1, a->n_inputs * sizeof *x);
    }
    if (!a->depth) return;
    const float *h = trainer_mlp_forward(a, w, rows, x, workspace, trainer_threads(pod->t));
    for (size_t i = 0; i < rows; i++)
        memcpy(z + i * a->n_latent + a->n_terms, h + i * a->width, a->width * sizeof *h);
}

/* z[n][L] = latent variables of the maps in slots 0 .. n - 1. */
static sdm_status all_latent(const pod_state *pod, const float *w, size_t n, float *z,
                             sdm_error *err)
{
    enum { CHUNK = 512 };
    const sdm_pod_arch *a = &pod->arch;
    sdm_comm *comm = pod->t->hooks.comm;
    const sdm_comm_part own = sdm_comm_own(comm, n);
    float *x = NULL, *workspace = NULL;
    sdm_status s = SDM_ALLOC(&x, CHUNK * a->n_inputs, "head", err);
    if (!s) s = SDM_ALLOC(&workspace, trainer_mlp_workspace(a, CHUNK), "head", err);
    for (size_t at = own.first; at < own.end && !s; at += CHUNK) {
        const size_t rows = own.end - at < CHUNK ? own.end - at : CHUNK;
        const float *phi[CHUNK];
        for (size_t i = 0; i < rows; i++) phi[i] = pod->phi + (at + i) * pod->n_poly;
        trainer_head_latent(pod, w, rows, phi, x, z + at * a->n_latent, workspace);
    }
    sdm_free(workspace);
    sdm_free(x);
    return s ? s : sdm_comm_gather_shares(comm, z, n, a->n_latent * sizeof *z, err);
}

/* e->gram, of whose rows each rank computes some, from the latent variables z[n][L]. */
static sdm_status find_gram(const pod_state *pod, size_t n, const float *z, head_equations *e,
                            sdm_error *err)
{
    const size_t latents = pod->arch.n_latent;
    const sdm_comm_part own = sdm_comm_own(pod->t->hooks.comm, latents);
    sdm_gemm(own.end - own.first, latents, n, (sdm_view){z + own.first, 1, latents},
             (sdm_view){z, latents, 1}, false, e->gram + own.first * latents, latents,
             trainer_threads(pod->t));
    return sdm_comm_gather_shares(pod->t->hooks.comm, e->gram, latents, latents * sizeof *e->gram,
                                  err);
}

sdm_status trainer_head_equations(const pod_state *pod, const float *w, head_equations *e,
                                  sdm_error *err)
{
    enum { CHUNK = 1024 };
    const size_t n = pod->t->data.n_static + trainer_dataset_random_slots(&pod->t->data);
    const size_t latents = pod->arch.n_latent, k = pod->arch.n_coefficients;
    const sdm_comm_part own = sdm_comm_own(pod->t->hooks.comm, k);
    float *z = NULL, *y = NULL;
    size_t *slots = NULL;
    e->maps = n;
    sdm_status s = SDM_ALLOC(&z, n * latents, "head", err);
    if (!s) s = SDM_ALLOC(&y, CHUNK * k, "head", err);
    if (!s) s = SDM_ALLOC(&e->gram, latents * latents, "head", err);
    if (!s) s = SDM_ALLOC(&e->right, latents * k, "head", err);
    if (!s) s = trainer_dataset_first_slots(n, &slots, err);
    if (!s) s = all_latent(pod, w, n, z, err);
    // right-hand sides, CHUNK maps at a time
    for (size_t at = 0; at < n && !s; at += CHUNK) {
        const size_t rows = n - at < CHUNK ? n - at : CHUNK;
        if ((s = trainer_coefficients_project(pod, false, slots + at, rows, y, err))) break;
        sdm_gemm(latents, own.end - own.first, rows, (sdm_view){z + at * latents, 1, latents},
                 (sdm_view){y + own.first, k, 1}, at > 0, e->right + own.first, k,
                 trainer_threads(pod->t));
    }
    if (!s) s = find_gram(pod, n, z, e, err);
    sdm_free(slots);
    sdm_free(y);
    sdm_free(z);
    return s;
}

void trainer_head_equations_dispose(head_equations *e)
{
    sdm_free(e->gram);
    sdm_free(e->right);
    *e = (head_equations){0};
}

sdm_status trainer_head_of_modes(const pod_state *pod, float *head, sdm_error *err)
{
    const sdm_pod_arch *a = &pod->arch;
    const size_t r = pod->n_modes, latents = a->n_latent, k = a->n_coefficients;
    float *of_modes = NULL; // [R][L]
    const sdm_status s = SDM_ALLOC(&of_modes, r * latents, "head", err);
    if (s) return s;
    for (size_t j = 0; j < r; j++) {
        float *row = of_modes + j * latents;
        memcpy(row, pod->poly + j * a->n_terms, a->n_terms * sizeof *row);
        if (!a->depth) continue;
        const float *readout = pod->mode_fit.average + trainer_mlp_count(a) + j * a->width;
        for (size_t i = 0; i < a->width; i++) row[a->n_terms + i] = pod->target_scale * readout[i];
    }
    sdm_gemm(k, latents, r, (sdm_view){pod->modes, 1, k}, (sdm_view){of_modes, latents, 1}, false,
             head, latents, trainer_threads(pod->t));
    sdm_free(of_modes);
    return SDM_OK;
}

/* factor[L][L] = Cholesky factor of the matrix of the equations with *ridge, which is raised until
   the matrix is positive definite: hidden units can be linearly dependent. */
static sdm_status head_factorise(size_t latents, const head_equations *e, double *ridge,
                                 double *factor, sdm_error *err)
{
    const float *gram = e->gram;
    for (;; *ridge *= 10) {
        for (size_t i = 0; i < latents * latents; i++)
            factor[i] = 0.5 * ((double)gram[i] + gram[i % latents * latents + i / latents]);
        for (size_t i = 0; i < latents; i++) factor[i * latents + i] += *ridge * (double)e->maps;
        if (!trainer_cholesky(latents, factor)) return SDM_OK;
        if (*ridge > 1)
            return sdm_fail(err, SDM_E_INTERNAL, "the head's least squares has no solution");
    }
}

/* A substitution: the arguments of substitute_columns(). */
typedef struct substitution {
    size_t latents, k;
    sdm_comm_part own; // columns of this rank
    const double *factor;
    const float *right;
    const float *prior; // NULL: zeros
    double pull;        // weight of the prior
    float *head;
    atomic_bool short_of_memory;
} substitution;

/* Columns of the right-hand sides that a thread solves at a time. */
enum { COLUMNS = 64 };

static void substitute_columns(void *user, size_t index, int member)
{
    substitution *q = user;
    const size_t latents = q->latents, k = q->k, at = q->own.first + index * COLUMNS,
                 n = q->own.end - at < COLUMNS ? q->own.end - at : COLUMNS;
    double *x = NULL;
    (void)member;
    if (SDM_ALLOC(&x, latents * n, "head", NULL)) {
        atomic_store(&q->short_of_memory, true);
        return;
    }
    for (size_t i = 0; i < latents; i++)
        for (size_t j = 0; j < n; j++) {
            x[i * n + j] = q->right[i * k + at + j];
            if (q->prior) x[i * n + j] += q->pull * (double)q->prior[(at + j) * latents + i];
        }
    trainer_cholesky_solve(latents, q->factor, n, x);
    for (size_t j = 0; j < n; j++)
        for (size_t i = 0; i < latents; i++) q->head[(at + j) * latents + i] = (float)x[i * n + j];
    sdm_free(x);
}

sdm_status trainer_head_solve(const pod_state *pod, const head_equations *e, double ridge,
                              const float *prior, float *head, sdm_error *err)
{
    const size_t latents = pod->arch.n_latent;
    sdm_comm *comm = pod->t->hooks.comm;
    double *factor = NULL;
    sdm_status s = SDM_ALLOC(&factor, latents * latents, "head", err);
    if (!s) s = head_factorise(latents, e, &ridge, factor, err);
    if (!s) {
        substitution q = {.latents = latents,
                          .k = pod->arch.n_coefficients,
                          .own = sdm_comm_own(comm, pod->arch.n_coefficients),
                          .factor = factor,
                          .right = e->right,
                          .prior = prior,
                          .pull = ridge * (double)e->maps,
                          .head = head};
        sdm_team_run(trainer_threads(pod->t), (q.own.end - q.own.first + COLUMNS - 1) / COLUMNS,
                     substitute_columns, &q);
        if (atomic_load(&q.short_of_memory))
            s = sdm_fail(err, SDM_E_NOMEM, "no memory for the head");
    }
    sdm_free(factor);
    s = sdm_comm_agree(comm, s, err);
    return s ? s
             : sdm_comm_gather_shares(comm, head, pod->arch.n_coefficients, latents * sizeof *head,
                                      err);
}
