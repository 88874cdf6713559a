/* What the tellers of findings share: each tells the findings that answer one question. */
#pragma once

#include "findings.h"

/* Where the lines go. Zero-initialise but for the first members; teller_dispose() frees. */
typedef struct teller {
    const cli_survey *s;
    cli_tell *tell;
    void *user;
    double end;  /* time of the clock, s, at which audits stop */
    bool failed; /* memory is short */
    /* of teller_audit(): the last shape, its mesh and audit */
    bool known;
    size_t shape;
    sdm_mesh mesh;
    sdm_part_audit audit;
} teller;

void teller_dispose(teller *t);

/* Tells the text and frees it; says nothing where it may follow from a cause
 * (sdm_survey_mend_first()). */
void teller_tell(teller *t, sdm_status weight, sdm_text *text);

/* The same, for a finding that follows from no other. */
void teller_tell_cause(teller *t, sdm_status weight, sdm_text *text);

/* Tells a finding by its count alone, "WHAT in 3 of 145 shapes, up to 12 at a=1 b=2", where the
 * audit of the worst shape was not made. */
void teller_tell_count(teller *t, sdm_status weight, const sdm_survey_count *c, const char *what);

/* The last words of a finding from which other findings may follow. */
#define TELLER_MEND_FIRST "; mend this first: findings that may follow from it are left out"

/* Parameters that a line names at most. */
enum { PARAMS_TOLD = 6 };

/* Appends "a=4.4 alpha=0.5" of shape `index`: some of its parameters, without number `skip`. */
void teller_add_params(const cli_survey *s, size_t index, size_t skip, sdm_text *out);

/* Appends "exact --shape NAME -p a=4.4 -p alpha=0.5 WHAT", with all parameters of shape `index`. */
void teller_add_command(const cli_survey *s, size_t index, const char *what, sdm_text *out);

/* Appends "; does mesh() give 'bend' (60 .. 270 deg) to cos() or sin()? ...", for the parameters in
 * degrees that need a conversion. */
void teller_add_degrees(const cli_survey *s, sdm_text *text);

/* Makes the mesh of shape `index`; false: it cannot be made, for the reason in *err. */
bool teller_make(const cli_survey *s, size_t index, sdm_mesh *mesh, sdm_error *err);

/* The audit of shape `index`, without the union, and its mesh in t->mesh, until the next call.
 * NULL: there is none, or it takes too long. */
const sdm_part_audit *teller_audit(teller *t, size_t index);

size_t teller_count_tested(const cli_survey *s);

/* Appends "in 3 of 145 shapes". */
void teller_add_share(const cli_survey *s, const sdm_survey_count *c, sdm_text *text);

/* Appends "WHAT in 3 of 145 shapes, up to 12 at a=1 b=2". */
void teller_add_count(const cli_survey *s, const sdm_survey_count *c, const char *what,
                      sdm_text *text);

/* Each of these functions tells some findings of one stage of the survey: of SDM_SURVEY_MESHES, */
void tell_causes(teller *t);
void tell_sizes(teller *t);
void tell_params(teller *t);
/* of SDM_SURVEY_PARTS, */
void tell_parts(teller *t);
void tell_walls(teller *t);
void tell_unit(teller *t);
/* and of SDM_SURVEY_REST. */
void tell_walls_closer(teller *t);
void tell_motion(teller *t);
void tell_grid(teller *t);
void tell_overlaps(teller *t);
void tell_groups(teller *t);
