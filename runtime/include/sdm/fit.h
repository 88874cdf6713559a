/* Fitting a shape to an image: shape parameters and rigid pose, with their uncertainty.

   Unknown are the parameters theta[n] of the shape and its pose (sdm/pose.h), n + 6 numbers. The
   signed distance map of the shape, by the network or the exact engine, is generated once an
   iteration in the shape's frame and interpolated at the voxel centres of the image. Two models of
   an image, both with tissues whose laws are estimated along with the shape:
   - partial volume (Santago and Gage 1993): a voxel holds the share a of inside tissue, a = the
   shape seen through a Gaussian point spread, and its value has the mean a m_in + (1 - a) m_out.
   Unbiased where the image is blurred; the default;
   - labels (Demarcy 2017; Wang et al. 2021): a voxel is inside with probability mu = 1 / (1 +
   exp(distance / l_ref)), its value has the inside or the outside law. Expectation-maximisation;
   tolerant, but its edge lies where the two laws cross, which in a blurred image is not where the
   surface is. The posterior is maximised by damped Gauss-Newton steps; ranges of parameters are
   bounds. Exact distances have creases where the nearest face changes, so a fit with exact maps
   ends by derivatives that are averages over a motion of the surface of 3 % of a voxel of the map
   (Ermoliev, Norkin and Wets 1995): one place, wherever it comes from. The covariance is the
   sandwich H^-1 J H^-1 (Huber 1967), H the information of the observed values (labels: Louis 1982),
   J the covariance of the score with the spatial correlation of the residuals (Conley 1999), freed
   of what the fit has taken from it, so that correlated noise and a model that is a little wrong
   widen it. */
#ifndef SDM_FIT_H
#define SDM_FIT_H

#include "sdm/grid.h"
#include "sdm/model.h"
#include "sdm/pose.h"
#include "sdm/registry.h"
#include "sdm/runtime.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Where maps come from: a network, a shape, or both. */
typedef struct sdm_fit_source {
    const sdm_model *model; /* maps by the network; NULL: by the exact engine */
    const sdm_instance *
        shape; /* for the exact engine; may be NULL with a model (no polish, policy not exact). With
                  a model its parameters must be those of the model (sdm_runtime_instance()) */
    /* of exact maps, in the shape's frame, where the shape lies with a margin; unused with a model.
       Voxels larger than 1.5 of the point spread of the image make deviations along what is weakly
       determined too small. */
    sdm_grid grid;
    sdm_range_policy policy; /* parameters outside the network's range. Refuse: bounds are that
                                range and a start outside of it is SDM_E_RANGE; clamp: such a start
                                is moved to the range and said so; exact: bounds are the shape's own
                                range, outside of the network's the exact engine is asked */
} sdm_fit_source;

typedef enum sdm_fit_kind {
    SDM_FIT_IMAGE = 0, /* values[nz][ny][nx], any unit */
    SDM_FIT_LABEL =
        1, /* values[nz][ny][nx] are probabilities of inside, 0 .. 1 (a label map: 0 and 1): taken
              as shares of voxels (partial volume), or as labels with the logistic prior */
    SDM_FIT_POINTS = 2 /* points[n_points][3] on the surface, world mm, with outliers */
} sdm_fit_kind;

/* What is fitted to. Voxels that are NaN are left out and counted; infinite ones are SDM_E_FORMAT.
 */
typedef struct sdm_fit_target {
    sdm_fit_kind kind;
    sdm_grid grid; /* image and label map: in the world */
    const float *values;
    const double *points;
    size_t n_points;
} sdm_fit_target;

#define SDM_FIT_LAWS 4

/* Values of one tissue: a Gaussian law, or Student's t with `dof` > 0 degrees of freedom (then sd
 * is its scale). */
typedef struct sdm_fit_law {
    double weight, mean, sd, dof;
} sdm_fit_law;

/* Mixtures of laws inside and outside; weights are relative. */
typedef struct sdm_fit_appearance {
    size_t n_inside, n_outside; /* 1 .. SDM_FIT_LAWS */
    sdm_fit_law inside[SDM_FIT_LAWS], outside[SDM_FIT_LAWS];
} sdm_fit_appearance;

typedef enum sdm_fit_model { SDM_FIT_PARTIAL_VOLUME = 0, SDM_FIT_LABELS = 1 } sdm_fit_model;

typedef enum sdm_fit_turns {
    SDM_FIT_TURNS_NONE = 0,
    SDM_FIT_TURNS_AXIS = 1, /* about z of the shape's frame (the modiolus of the cochlea), evenly */
    SDM_FIT_TURNS_SPHERE = 2 /* all rotations, evenly (super-Fibonacci spirals, Alexa 2022) */
} sdm_fit_turns;

typedef enum sdm_fit_phase {
    SDM_FIT_SEARCH = 0,
    SDM_FIT_MAIN = 1,
    SDM_FIT_POLISH = 2
} sdm_fit_phase;

/* State after an iteration; the arrays are valid during the call. */
typedef struct sdm_fit_progress {
    sdm_fit_phase phase;
    size_t iteration; /* from 1, over all phases */
    double objective; /* log posterior density, without constants */
    double step;      /* largest change, see sdm_fit_opts.eps */
    const double *params;
    sdm_pose pose;
} sdm_fit_progress;

/* sdm_fit_defaults() fills it; change what differs. */
typedef struct sdm_fit_opts {
    sdm_fit_model image_model;
    double l_ref;                  /* mm, > 0: labels: scale of the logistic prior */
    double blur;                   /* mm, > 0: sd of the point spread over the voxel, start value */
    bool keep_blur;                /* true: not estimated */
    sdm_fit_appearance appearance; /* start values */
    bool keep_appearance;          /* true: not estimated */
    /* mm, >= 0: tissues lie in places. Where the image holds two or more outside, partial volume:
       their weights vary in space (Sanjay-Gopal and Hebert 1998), each the tissue's part of what is
       about a place, seen through a Gaussian of this sd. 0: the same everywhere */
    double tissue_mm;
    double
        point_sd; /* mm, > 0: sd of points about the surface; start value unless keep_appearance */
    double point_dof; /* > 0: degrees of freedom of Student's t of points; small: tolerant of
                         outliers */

    const double *start_params; /* [n]; NULL: the defaults of the shape */
    sdm_pose start_pose;
    sdm_fit_turns
        turns; /* rotations tried before start_pose's own, about `pivot`, each with all unknowns */
    size_t n_turns;   /* 1 .. 4096 of them; read with turns */
    double pivot[3];  /* shape's frame, mm: the point the turns keep */
    bool keep_params; /* true: pose alone */
    bool keep_pose;   /* true: parameters alone */

    double
        prior_sd; /* of each parameter, in units of half of its range about the middle; 0: none. 0.5
                     takes ranges as means and two standard deviations. Priors weigh what they say
                     beside values that are correlated: the likelihood counts these as independent,
                     and each prior is multiplied by how much that makes too little of a variance */
    double prior_rotation_sd; /* rad, about the start pose; 0: none. With turns: about the start as
                                 turned, the turn chosen */
    double prior_translation_sd; /* mm, about the same; 0: none */

    double margin; /* mm, > 0: voxels farther outside of the shape at the start than this are not
                      looked at; the region follows the shape and is fixed in the end */
    bool use_box;  /* also no voxels outside of the box, in the world */
    double box_min[3], box_max[3];
    /* mm, >= 0: voxels of an image in spaces that look like the inside (by `appearance` and `blur`
       as given) and hold a ball of this radius are left out: they are too wide to be the shape. 0:
       none. It must be larger than the widest ball within the shape, by a quarter of it or so. */
    double cavity;
    double least_inside; /* 0 .. 1: share of the volume of the fitted shape that must lie in the
                            image */

    size_t max_iterations;        /* of the main phase, >= 1; as many again for its end by averaged
                                     derivatives */
    size_t max_polish_iterations; /* with the exact engine, after a network's fit, counted as those;
                                     0: none, 40 are enough */
    double eps; /* > 0: the main phase ends when the largest step is below: share of a parameter's
                   range, rad, share of the shape's size; with a network where steps promise no
                   gain, too, and then goes on by averaged derivatives */
    double polish_eps; /* > 0: the same for the end with exact maps */
    int n_threads;     /* 0: the OpenMP default; the same bits for every value */
    void (*progress)(void *user,
                     const sdm_fit_progress *p); /* after every iteration; may be NULL */
    bool (*cancelled)(
        void *user); /* asked now and then; true stops with SDM_E_CANCELLED; may be NULL */
    void *user;
} sdm_fit_opts;

/* Fluid in bone, in Hounsfield units: inside 40 +- 170; outside 1300 +- 270 and air -880 +- 150. */
SDM_API sdm_fit_opts sdm_fit_defaults(void);

/* Zero-initialise; sdm_fit_dispose() frees. N = n_params + 6. Rows and columns of matrices: the
   parameters in their order, rotation (rad; a small turn, after the pose, about the axes of the
   world through the origin of the shape), translation (mm). */
typedef struct sdm_fit_result {
    size_t n_params;
    double *params;     /* [n_params] */
    sdm_pose pose;      /* world = R shape + t */
    double *covariance; /* [N][N] of the posterior; rows of what was kept are 0; all NaN where a fit
                           ended before */
    double *sd;         /* [N]; NaN as there */
    double *correlation; /* [N][N]; 0 where sd is 0, NaN as there */
    bool *at_bound;      /* [n_params] estimate is at an end of its range: its sd says little */
    bool *by_prior; /* [n_params] sd is no less than that of the prior or the range: the target says
                       nothing of it */
    bool start_clamped;     /* the start was moved to the network's range */
    size_t n_exact_outside; /* maps the exact engine made because parameters lay outside of the
                               network's range */

    bool converged;
    char reason[256];    /* why it stopped */
    size_t n_iterations; /* of the main phase and the polish */
    double *objective; /* [n_iterations] log posterior density after each, without constants; those
                          of other voxels (the region follows the shape), other weights of priors,
                          other sd or places of tissues do not compare */
    double log_likelihood; /* of the target at the estimate */
    /* image: of the same voxels by a mixture that knows no shape, tissues outside in the same
     * places; else NaN */
    double log_likelihood_without;
    double evidence; /* image: how much better the shape explains it: gain in log-likelihood over
                        correlated voxels, less what its unknowns cost (Schwarz 1978); below 0 the
                        image holds no such shape. Else NaN */
    double inside_share; /* share of the volume of the shape in the image; 1 for points; NaN where a
                            fit ended before */

    size_t n_used, n_nan; /* voxels or points used; voxels near the shape left out because they are
                             NaN or n_cavity's */
    size_t n_cavity;      /* voxels of the image left out by sdm_fit_opts.cavity */
    double noise_factor;  /* sum of the correlations of a residual with the others (1: independent);
                             NaN as inside_share */
    /* near the surface, of the maps of the last phase: held-out figure of the network, 0 for exact
       ones; its share is in the covariance; NaN as inside_share */
    double model_error_mm;
    double blur;                   /* partial volume: sd of the point spread, mm; else 0 */
    sdm_fit_appearance appearance; /* at the end */
    double point_sd;               /* points: sd about the surface, mm; else 0 */
    size_t turn;                   /* the rotation that was chosen, from 0 */

    size_t n_network, n_exact; /* maps with derivatives, by source */
    double seconds, seconds_network, seconds_exact,
        seconds_search; /* wall clock; all, of the maps, of the search over turns */
} sdm_fit_result;

/* Fits. SDM_E_ARG, SDM_E_RANGE: options or start; SDM_E_FORMAT: infinite or only NaN values, labels
   outside 0 .. 1; SDM_E_CANCELLED; SDM_E_QUALITY: not converged, the image is constant, shows no
   such shape or the opposite contrast, or less than least_inside of the shape lies in it. After
   SDM_E_QUALITY *out is filled as far as it is known, after other errors empty. [any thread] */
SDM_API sdm_status sdm_fit(const sdm_fit_source *source, const sdm_fit_target *target,
                           const sdm_fit_opts *opts, sdm_fit_result *out, sdm_error *err);
SDM_API void sdm_fit_dispose(sdm_fit_result *r);

/* Morphological closing of a label map by a ball of this radius (mm, > 0; Matheron 1975), in place:
   voxels of values[nz][ny][nx] above 1/2 are labelled, and those that no ball reaches which touches
   no labelled voxel become 1. For compartments labelled apart that are one shape: walls between
   them thinner than about twice the radius are filled, the outside stays but for bays as narrow.
   Beyond the grid nothing is labelled. SDM_E_ARG: grid or radius. The same for any number of
   threads (0: the OpenMP default). [any thread, on values of its own] */
SDM_API sdm_status sdm_fit_close_labels(const sdm_grid *grid, double radius, int n_threads,
                                        float *values, sdm_error *err);

/* values[nz][ny][nx] = signed distance (mm, negative inside) of the shape at params and pose, at
   the voxel centres of a grid in the world: the map of the source, interpolated. Beyond the
   source's grid: distance to its border added. [any thread] */
SDM_API sdm_status sdm_fit_map(const sdm_fit_source *source, const double *params,
                               const sdm_pose *pose, const sdm_grid *grid, int n_threads,
                               float *values, sdm_error *err);

/* The pose that brings shape[n][3] to world[n][3], n >= 2, with the least squared distance (Horn
   1987). With two points, or all on one line, the turn about it is the smallest from the identity.
   SDM_E_ARG: points that coincide or are not finite. [any thread] */
SDM_API sdm_status sdm_fit_pose_from_points(const double *shape, const double *world, size_t n,
                                            sdm_pose *out, sdm_error *err);

/* The pose that brings `point` of the shape's frame to `centre` and its axis z to `axis` (any
   length but 0), turning as little as possible: with SDM_FIT_TURNS_AXIS a start from centre and
   axis alone. [any thread] */
SDM_API sdm_status sdm_fit_pose_from_axis(const double point[3], const double centre[3],
                                          const double axis[3], sdm_pose *out, sdm_error *err);

/* Middle of the inside of the shape at params (NULL: the defaults), in its frame, mm: a pivot, or a
   point for a centre. [any thread] */
SDM_API sdm_status sdm_fit_centre(const sdm_fit_source *source, const double *params,
                                  double centre[3], sdm_error *err);

#ifdef __cplusplus
}
#endif
#endif
