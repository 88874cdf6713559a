/* The state of a training run, shared by its phases. Letters as in sdm/pod.h; R global modes, N
   slots of the pool. What a kind of network does is in kind.h; the fields of the pod network lie
   here, others have theirs behind `state`. */
#ifndef SDM_TRAINER_H
#define SDM_TRAINER_H

#include <time.h>

#include "data/dataset.h"
#include "optimiser.h"
#include "sdm/internal/pod.h"
#include "sdm/internal/train.h"

typedef struct train_kind train_kind;

typedef struct trainer {
    const sdm_config *config;
    const sdm_instance *shape;
    const char *folder;
    sdm_train_hooks hooks;
    int n_threads;
    const train_kind *kind;
    void *state;           /* of the kind; NULL: pod */
    sdm_pod_levels levels; /* of the blocks */
    sdm_pod_block *blocks; /* those of the lowest level give the order in which maps are stored; one
                              block: map order */
    dataset data;
    producer *producer; /* NULL when no online sample is left to make */

    uint64_t file_sums[SDM_MAX_OPTIONS]; /* CRC-64 of the data files of the shape, by option; 0: it
                                            names none */

    /* pod network */
    sdm_pod_arch arch;
    uint8_t *exponents; /* [max(F, 1 + I)][P] */
    size_t n_poly;      /* max(F, 1 + I) */

    /* spectral start (bases.c, modes.c) */
    float *mean;           /* [n_voxels], block order */
    float *basis;          /* for each block of all levels [k_b][V_b] */
    size_t *matrix_at;     /* [blocks + 1] where that of a block begins */
    float *deviation;      /* [K] root mean square of each coefficient */
    size_t n_modes;        /* R */
    float *modes;          /* [R][K] orthonormal rows */
    float *poly;           /* [R][F] least squares on the polynomials */
    float *phi;            /* [N][n_poly] products at every slot */
    float *target;         /* [N][R] what the polynomials leave, divided by target_scale */
    float target_scale;    /* mm sqrt(voxel) */
    float *holdout_phi;    /* [H][n_poly] */
    float *holdout_target; /* [H][R] */
    double holdout_floor;  /* mean square error that the bases and modes leave on the held-out maps,
                              mm^2 */

    parameters fit;                    /* MLP, then readout[R][W] */
    parameters refine;                 /* MLP, head[K][L], mean[n_voxels], basis */
    size_t head_at, mean_at, basis_at; /* within refine */

    /* progress */
    sdm_phase phase;
    int64_t step, phase_step; /* of all; of this phase */
    double started;           /* monotonic seconds, moved back by the time before a resume */
    double phase_started;     /* seconds since `started` when the phase began */
    double last_report, last_checkpoint, last_evaluation;
    double loss, heldout_mse;
    double fit_end; /* seconds since `started` at which the fit ends, in time mode */
    sdm_accuracy accuracy;
    struct sdm_text *metrics; /* lines since the run began, written to metrics.jsonl */
} trainer;

/* seconds since the run began */
double trainer_seconds(const trainer *t);

/* True in time mode; otherwise steps in all are trainer_steps(). */
bool trainer_by_time(const trainer *t);
int64_t trainer_steps(const trainer *t);
int64_t trainer_fit_steps(const trainer *t);

/* Share of the whole budget that is over. */
double trainer_fraction(const trainer *t);

/* Begins a phase. */
void trainer_enter(trainer *t, sdm_phase phase);

/* Progress callback (not more than 10 times a second unless `now`). */
void trainer_report(trainer *t, double fraction, double samples_per_second, bool now);
void trainer_message(trainer *t, const char *fmt, ...) SDM_PRINTF(2, 3);
bool trainer_cancelled(const trainer *t);
/* Writes a checkpoint and returns SDM_E_CANCELLED (or why the checkpoint failed). */
sdm_status trainer_stop(trainer *t, sdm_error *err);

/* Threads for the optimiser: those that the producer leaves. */
int trainer_threads(const trainer *t);

/* One line into metrics.jsonl. */
sdm_status trainer_metric(trainer *t, double rate, sdm_error *err);

/* Products of polynomials at parameters p -> phi[n_poly]. */
void trainer_phi(const trainer *t, const double *p, float *phi);

/* bases.c: mean and local bases, then modes_make(). */
sdm_status bases_make(trainer *t, sdm_error *err);
/* 0 .. n - 1; freed with sdm_free(). */
sdm_status bases_slots(size_t n, size_t **slots, sdm_error *err);
void bases_dispose(trainer *t);

/* modes.c: global modes and polynomials from the first n slots; targets of everything in the pool.
 */
sdm_status modes_make(trainer *t, size_t n, sdm_error *err);
/* phi and target of n slots. */
sdm_status modes_project(trainer *t, const size_t *slots, size_t n, sdm_error *err);

/* fit.c: the MLP on the global modes. */
sdm_status fit_run(trainer *t, sdm_error *err);
/* error[n]: root mean square error of the modes (mm) of the maps in slots[n], with the averaged
 * weights. */
sdm_status fit_errors(const trainer *t, const size_t *slots, size_t n, double *error,
                      sdm_error *err);

/* head.c: latent variables z[rows][L] from products phi (one pointer a row) with MLP weights w;
   x[rows][I] and workspace (mlp_workspace()) are working memory. */
void head_latent(const trainer *t, const float *w, size_t rows, const float *const *phi, float *x,
                 float *z, float *workspace);
/* head[K][L]: least squares of the coefficients of all maps in the pool on their latent variables.
 */
sdm_status head_solve(const trainer *t, const float *w, float *head, sdm_error *err);

/* refine.c: everything end to end on maps. */
/* Weights of the phase: what was fitted, and the head by least squares; resumed: without values,
 * which the checkpoint has. */
sdm_status refine_start(trainer *t, bool resumed, sdm_error *err);
sdm_status refine_run(trainer *t, sdm_error *err);
/* Mean square error (mm^2) of weights w on the held-out maps. */
sdm_status refine_evaluate(trainer *t, const float *w, double *mse, sdm_error *err);

/* Takes new samples of the producer into the pool: `wanted` in step mode (waits), what is there in
   time mode. It returns early when the run is cancelled: ask trainer_cancelled() before the next
   step. */
sdm_status trainer_take_samples(trainer *t, size_t wanted, sdm_error *err);

/* checkpoint.c */
/* Removes checkpoint and model of an older run in the same folder. */
sdm_status checkpoint_start_anew(const trainer *t, sdm_error *err);
/* Removes the checkpoint of a run that is finished. */
sdm_status checkpoint_remove(const trainer *t, sdm_error *err);
sdm_status checkpoint_write(trainer *t, sdm_error *err);
sdm_status checkpoint_read(trainer *t, bool *found,
                           sdm_error *err); /* before the data: config, sample count, phase, time */
sdm_status checkpoint_weights(trainer *t, sdm_error *err); /* after the bases */

#endif
