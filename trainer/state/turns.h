/* The trainings of a run, one after the other: one, or two with network.kind: auto, of which the
   better one is kept. */
#pragma once

#include "sdm/internal/train.h"

/* The errors of one of the kinds that are compared, root mean squares in mm. */
typedef struct turn_figures {
    sdm_network_kind kind;
    double rmse_mm, rmse_voxel_mm; /* of all voxels; of those within a voxel of the surface */
    double map_ms;                 /* processor time of a map; decides nothing */
} turn_figures;

typedef struct training_turns {
    int n, at;                /* number of kinds to train, 1 or 2; the one in training */
    sdm_network_kind kind[2]; /* in the order of training */
    bool chosen;              /* by network.kind: auto */
    double budget;            /* of the run, in the unit of the key that gives it */
    double tried;             /* s, time of the trials: the first training begins with it */
    double share;             /* part of the budget left by the trials that the first of two may
                                 use, 0 .. 1 */
    sdm_train_report first;   /* result of the first, while the second trains */
    double pod_minutes;   /* train.minutes for a training of pod alone at the pace of the trials; 0:
                             the budget holds its maps */
    double trial_minutes; /* train.minutes whose part for trials holds those of both kinds, if the
                             budget left out the trial of the kind that is not trained; else 0 */
    double template_seconds; /* about the time of a template, s, where the budget left out its
                                trial and it most likely needs no training; else 0 */
    bool untried;            /* pod may be better, but the budget was too short for its trial */
    bool if_good;            /* the first of two is kept without the second if its grade is good */
    bool tried_other;        /* a kind that is not trained, or trained second, had a trial */
    turn_figures other;      /* errors of that kind in its trial */
} training_turns;

/* *out = `asked` with the kind of the present turn, its defaults for all keys that have those of
   `auto`, and its budget: the first of two has its share (in minutes: after the time of the
   trials), the second has what is left. */
void trainer_turn_config(const training_turns *r, const sdm_config *asked, sdm_config *out);

/* The budget of a configuration, in the unit of the key that it gives. */
double trainer_turns_budget(const sdm_config *c);

/* Part of the budget of `asked` that is left for the second of two. */
double trainer_turns_left(const training_turns *r, const sdm_config *asked);

/* "pod" or "template". */
const char *trainer_turn_name(sdm_network_kind kind);

/* The file that keeps the model of this kind in the folder of a run that chose the other one. */
const char *trainer_turn_file(sdm_network_kind kind);

turn_figures trainer_turn_figures(sdm_network_kind kind, const sdm_train_report *r);

/* The figure by which kinds are compared, mm, the smaller the better: the root of the sum of the
   mean square error within a voxel of the surface and a hundredth of that of all voxels. */
double trainer_score(const turn_figures *f);

/* true if the second kind with this result has a better grade than the first, or the same and a
   smaller score. */
bool trainer_second_wins(const training_turns *r, const sdm_train_report *second);

/* Appends a line with phase "auto" to *metrics: `kind` is trained next, or kept; then: the kind to
   be trained after it, NULL: none; reason: why, in words, NULL: as the errors tell; e[n]: the
   errors of the kinds so far. Writes no file. */
sdm_status trainer_turns_record(sdm_text *metrics, sdm_network_kind kind,
                                const sdm_network_kind *then, const char *reason,
                                const turn_figures *e, size_t n, sdm_error *err);
