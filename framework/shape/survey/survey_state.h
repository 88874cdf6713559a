/* What the stages of a survey share: the findings of each shape, and when to stop. */
#pragma once

#include "sdm/exact.h"
#include "sdm/internal/shape_survey.h"
#include "shape_family.h"
#include "survey_fold.h"
#include "survey_meeting.h"

/* What is known about one shape. */
typedef struct finding {
    sdm_status status;
    bool untested; /* for want of time; the status is then SDM_E_CANCELLED */
    bool made;     /* there is a mesh: what follows up to crc_tri, min and max are known */
    size_t n_vert, n_tri;
    uint64_t crc_vert, crc_tri;
    size_t open, unused, inside_out, turned, apart, flat, overlaps, crossed, degenerate, duplicate;
    double volume, area, min[3], max[3];
    double times;        /* of sdm_survey_part_lengths() */
    double winding;      /* the largest of sdm_survey_part_winding() ... */
    size_t winding_part; /* ... and the index of its part */
    bool plain;          /* a single part that nothing meets: it is the union */
    bool no_union;       /* volume and winding were not computed for want of time */
    double tangle;       /* the largest of sdm_part_tangle() */
    double thick;        /* of the thinnest part, mm; NaN: not known */
    double beyond[3][2]; /* mm */
    survey_contacts contacts;
} finding;

/* A line through the ranges, along one parameter. */
typedef struct followed {
    sdm_survey_jump jump;
    bool untested; /* for want of time */
} followed;

typedef struct survey {
    shape_family family;
    const sdm_survey_opts *opts;
    sdm_shape_survey *out;
    finding *found; /* [n] */
    followed *line; /* [n_lines] */
    size_t n_lines;
    bool *fold_late;   /* [1 + n_corners + FOLD_SAMPLES]: left out for want of time */
    survey_fold *fold; /* [1 + n_corners + FOLD_SAMPLES], by shape */
    bool *unlike;      /* [REPEATS] */
    double size;       /* diagonal of the box, mm */
    double start;      /* time of the clock, s */
} survey;

bool survey_is_cancelled(const survey *v);

/* Is `part` of the time over, or is the survey cancelled? */
bool survey_is_late(const survey *v, double part);

/* The end of a call of the engine: when the survey is cancelled, or the clock passes `until`, s.
 * Points at itself. */
typedef struct survey_stop {
    const survey *v;
    double until;
    sdm_exact_opts opts;
} survey_stop;

/* until: when `part` of the time is over, but not within `least` seconds from now. */
void survey_stop_set(survey_stop *stop, const survey *v, double part, double least);

static inline const double *survey_params(const survey *v, size_t i)
{
    return v->out->p + i * v->out->n_params;
}

/* A loop body: works on item i with a mesh of the thread. */
typedef sdm_status survey_body(void *user, size_t i, sdm_mesh *mesh, sdm_error *err);

/* Runs body(v, i) for i < n on several threads. The error of the lowest i that failed counts. what:
 * the stage, for the progress; NULL: none. */
sdm_status survey_run(survey *v, int n_threads, const char *what, size_t n, survey_body *body,
                      sdm_error *err);

/* Counts a shape that has the property, amount > 0. */
void survey_count(sdm_survey_count *c, size_t shape, double amount);

/* The stage SDM_SURVEY_MESHES, without the parameters. */
sdm_status survey_meshes(survey *v, int n_threads, sdm_error *err);

/* The stage SDM_SURVEY_PARTS: audits without the union. */
sdm_status survey_parts(survey *v, int n_threads, sdm_error *err);

/* Volumes of the unions, and how often parts wind around their inside. */
sdm_status survey_unions(survey *v, int n_threads, sdm_error *err);

/* Looks along lines through the ranges: for parts that meet in some shapes only, walls that pass
 * through each other, jumps, and wrong velocities. */
sdm_status survey_follow(survey *v, int n_threads, sdm_error *err);
