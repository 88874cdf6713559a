/* Survey of a family of shapes: makes meshes all over the ranges of the parameters and looks for
 * what spoils maps, derivatives and trainings. */
#pragma once

#include "sdm/grid.h"
#include "sdm/internal/part_audit.h"
#include "sdm/internal/shape_box.h"
#include "sdm/internal/shape_repeat.h"
#include "sdm/internal/text.h"
#include "sdm/registry.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The stages of a survey, from what takes little time to what takes longest. */
typedef enum sdm_survey_stage {
    SDM_SURVEY_MESHES = 1, /* meshes, made again; parameters; units */
    SDM_SURVEY_PARTS = 2,  /* edges, orientation and walls of the parts */
    SDM_SURVEY_REST = 4
} sdm_survey_stage;

/* Zero-initialised: the shape's own ranges and distributions, no samples, no grid, the OpenMP
 * default of threads, the whole survey. */
typedef struct sdm_survey_opts {
    /* [n_params] lowest and highest value of each parameter; NULL: the ranges of the shape */
    const double (*range)[2];
    /* [n_params] distribution of each parameter within its range; NULL: the shape's own */
    const sdm_distribution *distribution;
    size_t samples; /* random shapes: Sobol' points of the distributions */
    uint64_t seed;
    const sdm_grid *grid; /* NULL: nothing is compared with a grid */
    bool grid_fitted;     /* it is as fine as grid: auto makes it: thin parts are no fault */
    bool brief;           /* meshes, their audits, a few repetitions: no lines, no velocities */
    int n_threads;
    double seconds; /* what is not done after this time is left out; 0: no limit */
    /* called by any thread; true: what is not done by then is left out. May be NULL. */
    bool (*cancelled)(void *user);
    /* some meshes are made in this process, too; its `plugin` NULL: they are not */
    sdm_repeat_process process;
    bool mend_first; /* it ends after a stage with a finding of sdm_survey_mend_first() */
    /* called after each stage but the last one: the members of the result up to that stage are
     * set. May be NULL. */
    void (*known)(void *user, sdm_survey_stage stage);
    /* called by one thread at a time after each shape or line of a stage of the survey, of which
     * `share` (0 .. 1) is done; `what`: "meshes", "shapes", "volumes", "folds" or "lines". May be
     * NULL. */
    void (*progress)(void *user, const char *what, double share);
    void *user;
} sdm_survey_opts;

/* A property that some of the shapes have. */
typedef struct sdm_survey_count {
    size_t shapes; /* number of shapes with the property */
    size_t worst;  /* index of the shape that has most of it; of several the first */
    double amount; /* how much that one has: edges, parts, triangles, pairs of triangles, mm */
} sdm_survey_count;

typedef enum sdm_survey_break {
    SDM_BREAK_NONE = 0,
    SDM_BREAK_JUMP,      /* vertices jump */
    SDM_BREAK_SIZES,     /* the number of vertices or triangles changes */
    SDM_BREAK_TRIANGLES, /* the triangles get other vertices */
    SDM_BREAK_STATE,     /* it looks like one of these, but depends on the calls before */
} sdm_survey_break;

/* A value of a parameter at which the mesh does not change continuously, or beside which it depends
 * on the calls before. */
typedef struct sdm_survey_jump {
    sdm_survey_break kind;
    size_t shape;  /* the other parameters are those of this shape */
    double value;  /* of the parameter */
    size_t vertex; /* JUMP: the vertex that jumps farthest */
    double mm;     /* JUMP: how far */
} sdm_survey_jump;

/* Two parts that meet on the surface of the union in some of the shapes and not in others: it joins
 * or splits in between. A meeting that a further part covers does not count, nor one that grows out
 * of a further part: in some shapes that part covers all of it, in others a piece. */
typedef struct sdm_survey_meeting {
    size_t pairs;       /* pairs of parts of which this is so; 0: none, and no more is known */
    size_t part[2];     /* the pair that changes most often */
    size_t meet, apart; /* in so many shapes they meet on the surface, and do not */
    size_t shape[2]; /* index of the first shape in which they do not meet, and in which they do */
    /* The parameter that decides: in all but `odd` of these shapes they meet if it is below `value`
     * (below: true), or above. */
    size_t param, odd;
    double value;
    bool below;
} sdm_survey_meeting;

/* How large the shapes are, and whether they look like shapes in another unit than mm. */
typedef struct sdm_survey_scale {
    double size; /* longest edge of the box of all shapes, mm */
    /* it is below SDM_SURVEY_SIZE_MIN or above SDM_SURVEY_SIZE_MAX, and no parameter in mm moves
       the vertices by about as many mm */
    bool odd_size;
    /* how far vertices of the first shape move per mm of the parameter `param`, at most, mm: of the
     * parameters with the unit mm the one that moves them farthest. NaN: there is none */
    double speed;
    size_t param;
    bool odd_speed;    /* it is below SDM_SURVEY_SPEED_MIN or above SDM_SURVEY_SPEED_MAX */
    bool odd_angle;    /* of a parameter: sdm_survey_is_odd_angle() or sdm_survey_is_radian() */
    bool degrees;      /* of a parameter: sdm_survey_is_degree() */
    bool other_length; /* of a parameter: sdm_survey_is_other_length() */
    /* how often vertices of the first shape turn back along the parameter `angle`, which mesh() is
     * likely to give to cos() or sin() in degrees; 0: there is none such */
    size_t swings, angle;
    /* they do not turn back, but move beyond all bounds, as for tan(), the first two times where
     * the parameter is pole[] */
    bool poles;
    double pole[2];
    /* nor do they swing so few times: `angle` is in rad and mesh() is likely to multiply it
     * by 57.3, so that this vertex goes round `swings` times, a part of the last time included */
    bool spins;
    size_t spin_vertex;
    /* nor does it spin: `angle` is in degrees, and each turns the surface about spin_vertex by so
     * many degrees, which are 57.3 times too many (mesh() takes them for rad), or too few (it
     * converts them twice), to a factor of two; 0: neither. `swings` then counts the turns, a part
     * of the last included */
    double turns;
    /* the unit that would explain both, and its length in mm; NULL: none would */
    const char *unit;
    double unit_mm;
} sdm_survey_scale;

/* Parts that a message names at most. */
enum { SDM_SURVEY_NAMED = 4 };

/* Why a length in mm moves vertices by too little or too much, and whether it does so in one part
 * alone. */
typedef struct sdm_survey_unit {
    /* the parts that the parameter moves, of the n_parts of the first shape; n_parts 0: not known
     */
    size_t moved, n_parts;
    size_t part[SDM_SURVEY_NAMED]; /* indices of the first of them */
    /* the unit (m, inches, cm, um) that explains the speed, and its length in mm; NULL: none does
     */
    const char *name;
    double mm;
    /* all coordinates of these parts are in this unit: in it they are about as large as the other
     * parts and as the lengths that move them. false: mesh() is likely to convert the parameter */
    bool whole;
    /* mm per mm in the part mixed_part, which a length in m would explain, while the parameter
     * moves the part fair_part as a length in mm does; 0: there is no such part */
    double mixed, fair;
    size_t mixed_part, fair_part;
} sdm_survey_unit;

/* Does a parameter in rad reach beyond 30, almost five turns? It is likely to be in degrees. */
bool sdm_survey_is_odd_angle(const sdm_param *p);

/* Degrees of a rad. */
#define SDM_SURVEY_DEGREES 57.29577951308232

/* True for a parameter with the unit deg or degrees whose range looks like one in rad: within a
 * turn, and ending at a multiple of 15 degrees in rad, such as 1.57, that is no number of halves.
 */
bool sdm_survey_is_radian(const sdm_param *p);

/* Does a parameter with the unit deg or degrees reach beyond a turn in rad? cos() and sin() give
 * what was not meant if mesh() does not convert it. */
bool sdm_survey_is_degree(const sdm_param *p);

/* Is the unit a length other than mm, such as m or cm? */
bool sdm_survey_is_other_length(const sdm_param *p);

/* Zero-initialise; sdm_shape_survey_dispose() frees. */
typedef struct sdm_shape_survey {
    size_t n_params;
    /* shapes: 0 has the default values (moved into the ranges); then come the corners of the ranges
     * (all for at most 6 parameters, else 64 random ones in which normally distributed parameters
     * have random values; in a brief survey no more than samples), then the samples */
    size_t n, n_corners, n_samples;
    double *p;       /* [n][n_params] */
    size_t untested; /* shapes left out for want of time, the first one only if it takes long */
    bool cancelled;  /* before all was done */
    size_t lines, lines_untested; /* lines through the ranges, and those left out */

    /* the meshes: those that could not be made, and properties of the others */
    sdm_survey_count failed;
    sdm_survey_count open;       /* edges on which not as many triangles run each way: not closed */
    sdm_survey_count unused;     /* vertices of no triangle */
    sdm_survey_count inside_out; /* parts of state SDM_PART_INSIDE_OUT (part_audit.h) */
    sdm_survey_count turned;     /* parts that are inside out and that the exact engine turns */
    /* parts that pass through themselves; amount: sdm_part_tangle() */
    sdm_survey_count crossing;
    /* solid parts that wind around their inside more than once; amount: sdm_survey_part_winding(),
     * at first without the union; wound_part: the index of the part that has most of it */
    sdm_survey_count wound;
    size_t wound_part;
    sdm_survey_count overlaps;              /* pairs of triangles that meet: the union counts */
    bool overlaps_begin;                    /* some shapes overlap themselves, but not shape 0 */
    sdm_survey_count degenerate, duplicate; /* triangles */
    size_t n_vert, n_tri;                   /* of the first mesh */
    sdm_survey_count resized;  /* other numbers of vertices or triangles; amount: of vertices */
    sdm_survey_count rewired;  /* the same numbers, but other triangles than the first mesh */
    double volume[2], area[2]; /* smallest and largest of the unions, mm^3 and mm^2; closed meshes
                                  alone, at first those of which no triangles meet; NaN in a brief
                                  survey */
    double low[3], high[3];    /* box of all meshes, mm; a search widens it unless `brief` */
    sdm_survey_scale scale;
    /* [n_params] how far a vertex moves per unit of the parameter, at most, mm; NaN: not known. Of
     * the first shape; of a few samples, too, if it is slow there. 0: it moves no vertex by 1e-9 of
     * the size over the range. */
    double *speed;
    size_t slow;           /* parameters that are odd by themselves: sdm_survey_is_slow() */
    sdm_survey_unit *unit; /* [n_params] of the parameters with the unit mm; zero of the others */
    /* groups of parts that meet each other, but no part of another group; amount: their number */
    sdm_survey_count apart;
    /* parts that enclose nothing, also in a piece of them (sdm_part.doubled), or are thinner than
     * SDM_SURVEY_FLAT times the longest edge of the box of the shape: two walls of a part lie on
     * each other */
    sdm_survey_count flat;
    /* parts whose box is SDM_SURVEY_TINY times shorter than that of the longest part, or more: one
     * of both is likely to be in another unit; amount: how many times, of the shortest part */
    sdm_survey_count tiny;
    size_t narrow; /* parameters whose range does nothing: sdm_survey_is_narrow() */

    /* the samples whose vertices lie beyond the centres of the outer voxels; amount: mm beyond */
    sdm_survey_count cut;
    /* shapes that are not `flat` with a part too thin for the grid (part_audit.h); amount: the
     * largest spacing of the grid, in thicknesses of the part */
    sdm_survey_count thin;
    bool grid_fitted;    /* the option: `thin` does not count for the verdict */
    double beyond[3][2]; /* mm, of all shapes: below the first and above the last voxel of each axis
                            of the grid; 0: not beyond */
    /* sdm_grid_surplus() of the grid and the box of all meshes, and its factors along the axes;
       above SDM_SURVEY_SURPLUS_MAX the grid is far too large. 0: there is no grid; NaN: no mesh */
    double surplus, surplus_along[3];

    /* some of the meshes made again, in a brief survey fewer of them; then in opts->process */
    sdm_repeat repeat;
    sdm_error process_untested; /* why they were not made there; its status is 0 if they were */

    /* what takes longer, and what a brief survey leaves out */
    size_t unions_untested; /* shapes of which volume and winding are not known for want of time */
    sdm_survey_meeting meeting;
    /* corners and the first samples in which triangles have turned over within a sixteenth of the
     * straight way from shape 0: walls pass through each other; amount: the share of these
     * triangles of the area, which is above SDM_SURVEY_FOLD_MIN, or, where a part of the shape
     * meets itself and none of shape 0 does, above SDM_SURVEY_FOLD_CROSSED */
    sdm_survey_count folded;
    /* [n_params] the parameter moves vertices, but no part of the surface: they lie inside of other
     * parts; not looked at where meshes are broken */
    bool *still;
    size_t fold_tested;   /* number of shapes that were compared with shape 0 */
    size_t fold_untested; /* shapes that were not followed, for want of time */
    /* not tested, for want of time: the largest extent of the shapes, velocity() at some shapes,
     * parameters that move no surface */
    bool box_untested, velocity_untested, still_untested;
    double folded_at;      /* where on the way to the worst of them: 0 at shape 0, 1 at the worst */
    sdm_survey_jump *jump; /* [n_params] the worst break along each parameter */
    bool has_velocity;     /* the shape has a callback of this name */
    /* largest difference between the callback and differences of meshes, relative to the largest
     * velocity by the same parameter, and where it is */
    double velocity_error;
    size_t velocity_param, velocity_shape, velocity_vertex;
    double ms_mesh;     /* median time of a mesh, ms */
    sdm_face_hits hits; /* of the grid, sdm_grid_family_hits(); zero without a grid */
} sdm_shape_survey;

/* Surveys the shape. A mesh that cannot be made is a finding (`failed`), no error. Without a limit
 * of time the findings depend neither on the number of threads nor on the time. SDM_E_RANGE: a
 * range does not lie within the shape's; SDM_E_NOMEM. */
sdm_status sdm_shape_survey_make(const sdm_instance *shape, const sdm_survey_opts *opts,
                                 sdm_shape_survey *out, sdm_error *err);
void sdm_shape_survey_dispose(sdm_shape_survey *s);

/* Number of shapes for a survey of about a second: `samples` for small meshes, fewer for large
 * ones, at least 8. */
size_t sdm_survey_samples(const sdm_instance *shape, size_t samples);

/* Are so many triangles given twice, over a tenth of the first mesh, that whole parts are likely to
 * lie in the same place? */
bool sdm_survey_has_twins(const sdm_shape_survey *s);

/* Does part i of an audited mesh count for sdm_shape_survey.flat? */
bool sdm_survey_part_is_flat(const sdm_part_audit *a, size_t i);

/* The parts whose boxes have the shortest and the longest edge of all that enclose something.
 * Returns how many times longer the longest edge of the second is; 0: there are not two such
 * parts. */
double sdm_survey_part_lengths(const sdm_part_audit *a, size_t *shortest, size_t *longest);

/* How often part i of the mesh m, which was audited, winds around its inside, at least and on
 * average: its volume by the divergence theorem, divided by that of its box or, if the audit has
 * the union, by the volume that the part fills, unless `stop` ends this. 0: the part is not solid,
 * or its triangles do not meet. It counts above SDM_SURVEY_WOUND; the turns of a spiral may
 * overlap, but above SDM_SURVEY_WOUND_MAX, or if a parameter is sdm_survey_is_degree(), it is a
 * mistake. */
double sdm_survey_part_winding(const sdm_mesh *m, const sdm_part_audit *a, size_t i,
                               const sdm_exact_opts *stop);
#define SDM_SURVEY_WOUND 1.1
#define SDM_SURVEY_WOUND_MAX 2.0

/* Is the part that winds most a mistake? */
bool sdm_survey_winds_wrongly(const sdm_shape_survey *s);

/* Is there a finding from which others are likely to follow: meshes that are not the same when they
 * are made again, vertices of no triangle, an angle in degrees that is taken for rad? */
bool sdm_survey_mend_first(const sdm_shape_survey *s);

/* SDM_E_MESH: meshes are broken: they cannot be made or are not closed. SDM_E_QUALITY: the meshes
 * are usable, but a training or derivatives would suffer: vertices of no triangle, parts that are
 * inside out (also those that the engine turns), parts without thickness or SDM_SURVEY_TINY times
 * smaller than others, walls that pass through each other, outlines that cross themselves or wind
 * more than once, sizes, triangles or vertices that jump, a grid that cuts, is too coarse for a
 * part or far too large, wrong velocities, results that differ from call to call, or an odd size or
 * speed (another unit than mm, or a parameter that does nothing). Else SDM_OK. */
sdm_status sdm_shape_survey_verdict(const sdm_shape_survey *s);

/* A smaller share of the area may turn over: slivers at a tip, rings of a tube that bends sharply
 * (at most 0.018 in the shape `duct`; an inner wall has 0.1 and more). */
#define SDM_SURVEY_FOLD_MIN 0.04
/* The same where the surface also meets itself: the inner wall of a thin neck has little area. */
#define SDM_SURVEY_FOLD_CROSSED 0.002

/* More times as many voxels as the grid around the shapes are wasted: twice along each axis. */
#define SDM_SURVEY_SURPLUS_MAX 8.0

/* A part that is thinner than this share of the longest edge of the box shows on no grid. */
#define SDM_SURVEY_FLAT 1e-3

/* So many voxels along the longest part would show the shortest one as a single voxel. Parts of one
 * length, one in m and one in mm, differ 1000 times. */
#define SDM_SURVEY_TINY 300.0

/* velocity_error above this is wrong. */
#define SDM_SURVEY_VELOCITY_LIMIT 1e-3

/* Sizes (mm) and speeds beyond these are odd: the diameter of a tube moves its vertices by 0.5 mm
 * per mm, by 0.05 if they are in cm. A screw of many turns moves fast with its pitch. */
#define SDM_SURVEY_SIZE_MIN 1.0
#define SDM_SURVEY_SIZE_MAX 1000.0
#define SDM_SURVEY_SPEED_MIN 0.25
#define SDM_SURVEY_SPEED_MAX 100.0

/* mm per mm: a parameter with the unit mm is suspicious if 1 mm of it moves no vertex farther than
 * this, even where other parameters move them far. */
#define SDM_SURVEY_SPEED_SLOW 0.02

/* Is parameter k of the survey odd by itself: it moves no vertex, or its unit is mm and it is slow,
 * or sdm_survey_is_faint()? false if its speed is not known. */
bool sdm_survey_is_slow(const sdm_shape_survey *s, const sdm_instance *shape, size_t k);

/* Appends the finding about parameter k, which is slow and in mm, with its likely cause: "1 mm of
 * the parameter 'reach' moves no vertex ... by more than 0.001 mm: does mesh() multiply 'reach' by
 * 0.001?" */
void sdm_survey_add_slow(const sdm_shape_survey *s, const sdm_instance *shape, size_t k,
                         sdm_text *out);

/* Appends the question about the cause alone: ": are the vertices in m? Multiply them by 1000" or
 * ": does mesh() multiply 'reach' by 0.001?"; nothing if no unit explains the speed. */
void sdm_survey_ask_unit(const sdm_shape_survey *s, const sdm_instance *shape, size_t k,
                         sdm_text *out);

/* Does mesh() seem to convert a length in mm to another unit? */
bool sdm_survey_converts(const sdm_shape_survey *s);

/* Does mesh() seem to convert the fastest length so that it makes the shapes far too large? Other
 * lengths and other parts then seem too small. */
bool sdm_survey_stretches(const sdm_shape_survey *s);

/* Is parameter k an angle in rad that moves no vertex by SDM_SURVEY_FAINT times the size of the
 * shapes, per rad and over the range in the table of the shape? mesh() is likely to convert it from
 * degrees. */
bool sdm_survey_is_faint(const sdm_shape_survey *s, const sdm_instance *shape, size_t k);
#define SDM_SURVEY_FAINT 6e-3

/* Does parameter k, whose unit is mm, do nothing that a grid shows over the range in the table of
 * the shape? It moves no vertex by SDM_SURVEY_NARROW times the size of the shapes, and its values
 * are smaller than SDM_SURVEY_VALUE times that size: they are likely to be in m. */
bool sdm_survey_is_narrow(const sdm_shape_survey *s, const sdm_instance *shape, size_t k);
#define SDM_SURVEY_NARROW 1e-3
#define SDM_SURVEY_VALUE 5e-3

#ifdef __cplusplus
}
#endif
