/* Fits a shape to an image, labels or points: estimates shape parameters and rigid pose, with their
   uncertainty.

   Unknowns are the n parameters theta of the shape and the 6 numbers of its pose (sdm/pose.h). In
   each iteration the network or the exact engine generates the map of the shape, its signed
   distance on a grid in the shape's frame. The map is interpolated at the voxel centres of the
   image. A tissue is a material inside or outside the shape; the distribution of its values is
   estimated along with the shape. Two models explain the value of a voxel:
   - partial volume (Santago and Gage 1993), the default: the shape fills the share a of the voxel,
     0 .. 1, seen through a Gaussian point spread, and the mean of the value is
     a m_in + (1 - a) m_out, with the means m of the tissues. Unbiased where the image is blurred;
   - labels (Demarcy 2017; Wang et al. 2021): the voxel is inside with probability
     mu = 1 / (1 + exp(distance / l_ref)), and its value comes from the inside or the outside
     tissues. Estimated by expectation-maximisation. Tolerant, but biased in blurred images: the
   edge lies where the inside and the outside density are equal, not where the surface is.

   The posterior density is maximised by damped Newton steps that use the information (negative
   second derivative of the log-likelihood), within the ranges of the parameters. Exact distances
   have creases where the nearest face changes; these make the likelihood non-smooth. A fit with
   exact maps therefore ends with gradients averaged over a motion of the surface of 3 % of a map
   voxel (Ermoliev, Norkin and Wets 1995), and reaches the same maximum from every nearby start.

   The covariance is the sandwich H^-1 J H^-1 (Huber 1967). H is the observed information (labels:
   Louis 1982). J is the covariance of the score, the gradient of the log-likelihood, with the
   spatial correlation of the residuals (Conley 1999), corrected for the part of the residuals that
   the fit has explained. Correlated noise and small errors of the model therefore widen the
   covariance. In this header sd means standard deviation. */
#ifndef SDM_FIT_H
#define SDM_FIT_H

#include "sdm/grid.h"
#include "sdm/mesh.h"
#include "sdm/model.h"
#include "sdm/pose.h"
#include "sdm/registry.h"
#include "sdm/runtime.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Where maps come from: a network, a shape, or both. The caller keeps ownership. */
typedef struct sdm_fit_source {
    /* the network that makes the maps; NULL: the exact engine makes them */
    const sdm_model *model;
    /* the shape for the exact engine; beside a model one with the same parameters, as by
       sdm_runtime_instance(). With a model it may be NULL: then there is no polish, SDM_RANGE_EXACT
       is not allowed, and the error of the network is not measured
       (sdm_fit_result.network_error_sd) */
    const sdm_instance *shape;
    /* without a model: grid of the exact maps in the shape's frame; it must hold the shape with a
       margin. If its voxels are larger than 1.5 times the point spread of the image, the standard
       deviations of weakly determined unknowns are too small */
    sdm_grid grid;
    /* with a model: what happens to parameters outside of the range of its training.
       SDM_RANGE_REFUSE: the fit stays in this range, and a start outside of it gives SDM_E_RANGE.
       SDM_RANGE_CLAMP: the same, but such a start is moved into the range, and start_clamped is
       set. SDM_RANGE_EXACT: the fit stays in the range of the shape itself, and the exact engine
       makes the maps outside of the range of the training */
    sdm_range_policy policy;
} sdm_fit_source;

typedef enum sdm_fit_kind {
    /* values[nz][ny][nx] are an image in any unit */
    SDM_FIT_IMAGE = 0,
    /* values[nz][ny][nx] are probabilities of inside, 0 .. 1 (a label map: 0 and 1): with
       SDM_FIT_PARTIAL_VOLUME shares of voxels, with SDM_FIT_LABELS labels with the logistic prior
     */
    SDM_FIT_LABEL = 1,
    /* points[n_points][3] lie on the surface, in the world, mm; outliers are tolerated. With the
       exact engine their distances are those from the surface of the shape, with a network those
       on its map. The fit is made from the given start, then from the shape on whose surface the
       points lie most evenly; the better one is kept */
    SDM_FIT_POINTS = 2
} sdm_fit_kind;

/* Data to fit to; the caller keeps ownership. Voxels that are NaN are skipped and counted; an
   infinite voxel gives SDM_E_FORMAT. */
typedef struct sdm_fit_target {
    sdm_fit_kind kind;
    /* image and label map: their grid in the world */
    sdm_grid grid;
    const float *values;
    const double *points;
    size_t n_points;
} sdm_fit_target;

/* largest number of tissues inside, and of tissues outside */
#define SDM_FIT_LAWS 4

/* Distribution of the values of one tissue. dof = 0: a Gaussian; dof > 0: Student's t with so many
 * degrees of freedom, and sd is its scale. weight: relative frequency of the tissue on its side. */
typedef struct sdm_fit_law {
    double weight, mean, sd, dof;
} sdm_fit_law;

/* All tissues: mixtures of distributions inside and outside. Weights are relative within a side. */
typedef struct sdm_fit_appearance {
    /* 1 .. SDM_FIT_LAWS */
    size_t n_inside, n_outside;
    sdm_fit_law inside[SDM_FIT_LAWS], outside[SDM_FIT_LAWS];
} sdm_fit_appearance;

typedef enum sdm_fit_model { SDM_FIT_PARTIAL_VOLUME = 0, SDM_FIT_LABELS = 1 } sdm_fit_model;

/* Rotations to try at the start. */
typedef enum sdm_fit_turns {
    SDM_FIT_TURNS_NONE = 0,
    /* evenly about z of the shape's frame (the modiolus of the cochlea) */
    SDM_FIT_TURNS_AXIS = 1,
    /* evenly over all rotations (super-Fibonacci spirals, Alexa 2022) */
    SDM_FIT_TURNS_SPHERE = 2
} sdm_fit_turns;

typedef enum sdm_fit_phase {
    /* search for the start */
    SDM_FIT_SEARCH = 0,
    SDM_FIT_MAIN = 1,
    /* steps with exact maps after the fit with a network */
    SDM_FIT_POLISH = 2,
    /* checks, and comparisons with rivals, after the last step: one call at the beginning */
    SDM_FIT_JUDGE = 3
} sdm_fit_phase;

/* State after an iteration; params is valid during the call of progress(). */
typedef struct sdm_fit_progress {
    sdm_fit_phase phase;
    /* number of the iteration, counted from 1 over all phases */
    size_t iteration;
    /* log-posterior density, up to a constant */
    double objective;
    /* size of the step, in the units of sdm_fit_opts.eps */
    double step;
    /* [n_params] */
    const double *params;
    sdm_pose pose;
    /* search with several starts, else 0: the round (1: every start, with a wide point spread; 2:
       the best of them), the number of the present start in this round, from 1, and the number of
       starts in this round */
    size_t round, start, n_starts;
    /* search: the best start that has ended in this round; NULL: none. [n_params] its parameters */
    const double *best_params;
} sdm_fit_progress;

/* sdm_fit_defaults() fills it; change what differs. */
typedef struct sdm_fit_opts {
    sdm_fit_model image_model;
    /* labels: scale of the logistic prior, mm, > 0 */
    double l_ref;
    /* partial volume: start value of the sd of the point spread, mm, > 0; the point spread includes
       the voxel's own box */
    double blur;
    /* true: the blur is not estimated */
    bool keep_blur;
    /* start values of the tissues. Images with partial volume: the mean of each tissue inside also
       has a normal prior about its start value, with the sd of the tissue. It counts only where
       blur is as wide as the shape is thick: there no voxel shows the mean */
    sdm_fit_appearance appearance;
    /* true: the appearance is not estimated */
    bool keep_appearance;
    /* partial volume, images with two or more outside tissues: the weights of the outside tissues
       vary in space (Sanjay-Gopal and Hebert 1998). At a point they are the parts of the tissues in
       its surroundings, averaged with a Gaussian window of this sd, mm, >= 0. 0: the weights are
       the same everywhere */
    double tissue_mm;
    /* points: start value of the sd of the points' distances from the surface, mm, > 0; the sd is
       estimated unless keep_appearance is set */
    double point_sd;
    /* points: degrees of freedom of Student's t for the distances, > 0; small values tolerate
       outliers. Besides, a share of the points may lie anywhere, their distances spread evenly over
       the size of the shape. The share is estimated; with keep_appearance it is 0 */
    double point_dof;

    /* [n_params] start values of the parameters; NULL: the defaults of the shape */
    const double *start_params;
    sdm_pose start_pose;
    /* rotations about `pivot` that are tried. Turn i starts at R = R_start Q_i, with the pivot
       where start_pose has it; all unknowns that are not kept are fitted from there */
    sdm_fit_turns turns;
    /* number of turns, 1 .. 4096; not read with SDM_FIT_TURNS_NONE */
    size_t n_turns;
    /* the point that the turns leave in place, in the shape's frame, mm */
    double pivot[3];
    /* true: the parameters are not estimated */
    bool keep_params;
    /* true: the pose is not estimated */
    bool keep_pose;

    /* sd of the prior of each parameter, in units that depend on its distribution (of the model or,
       without a model, of the shape); 0: no prior.
       Normal: in deviations of the distribution, about its mean; with 1 it is the prior.
       Uniform: in halves of the range, about its middle; with 0.5 the range is the mean +- two sd.
       The likelihood counts correlated voxels as independent and is too sharp beside a prior: so
       each log prior is multiplied by the variance with correlation over the variance without */
    double prior_sd;
    /* sd of the prior of the rotation, rad; 0: no prior. The prior is centred at the start pose,
       with turns at the start pose rotated by the chosen turn */
    double prior_rotation_sd;
    /* sd of the prior of the translation, mm, centred at the same pose; 0: no prior */
    double prior_translation_sd;

    /* voxels up to this distance outside the shape are used, besides all voxels inside; mm, > 0.
       This region follows the shape and is constant at the end */
    double margin;
    /* true: only voxels in this box of the world, mm, are used */
    bool use_box;
    double box_min[3], box_max[3];
    /* images: spaces that look like the inside (by `appearance` and `blur` as given) and hold a
       ball of this radius, mm, >= 0, are left out, since they are too wide to be the shape. The
       radius should be about a quarter larger than that of the largest ball in the shape. 0: no
       space is left out */
    double cavity;
    /* 0 .. 1: share of the volume of the fitted shape that must lie in the image */
    double least_inside;

    /* largest number of iterations of the main phase, >= 1; the steps with the averaged gradient at
       its end have as many again */
    size_t max_iterations;
    /* largest number of iterations of the polish, with the exact engine after a network's fit,
       counted in the same way; 0: no polish; 40 are enough */
    size_t max_polish_iterations;
    /* > 0: the steps end when the largest component of a step is at most eps. Components are the
       change of a parameter over its range, of the rotation in rad, and of the translation over the
       size of the shape. Unless the parameters are kept, the steps also end when they promise no
       gain: with a network several in a row, with exact maps the first one. Steps with averaged
       gradients follow such an end, and every converged fit with exact maps */
    double eps;
    /* > 0: replaces eps in steps with exact maps and the averaged gradient, of the main phase and
       of the polish; if the parameters are kept, in all steps with exact maps */
    double polish_eps;
    /* > 0: with any eps and polish_eps the steps also end when an undamped step would move no
       unknown by more than this share of its standard deviation; 0: they do not */
    double eps_sd;
    /* number of threads, >= 0; 0: the OpenMP default. The result has the same bits for every
       value */
    int n_threads;
    /* called after every iteration; may be NULL */
    void (*progress)(void *user, const sdm_fit_progress *p);
    /* called now and then, at least before every map; the value true stops the fit with
     * SDM_E_CANCELLED; may be NULL */
    bool (*cancelled)(void *user);
    /* passed to progress() and cancelled() */
    void *user;

    /* 0 .. 1: by how much a real organ may differ from the model of its shape: the share of the
       volume of the shape that need not be of the inside's material, see SDM_FIT_CHECK_EMPTY. 0:
       the shape is exact, and residuals inside it must be noise. Labels and points never show a
       surface exactly: for them it is at least 0.05, and holds outside, too */
    double tolerance;
    /* images, >= 0: volume of the inside's material that may lie beside the shape, over the volume
       of the shape, see SDM_FIT_CHECK_MISSING: other spaces of the same material */
    double beside;

    /* how often a fit that its checks refuse may go on from another value of one parameter or,
       points, from another pose, if that explains the data better: a long shape may have stopped
       with one end on the data and the other one beyond them, or the start may have been turned.
       0: never; nor where parameters or pose are kept */
    size_t max_restarts;
    /* [n_params] true: this parameter is not estimated and keeps its start value; NULL: all or none
       are estimated, see keep_params */
    const bool *kept;
} sdm_fit_opts;

/* What is checked before a fit is trusted. New checks are added at the end. */
typedef enum sdm_fit_check_kind {
    /* image: evidence of the shape against the same voxels without a shape */
    SDM_FIT_CHECK_NO_SHAPE = 0,
    /* image: the side that is brighter is that of the start; figure: inside mean less outside mean
     */
    SDM_FIT_CHECK_CONTRAST,
    /* radius of the largest ball in the shape, mm, below sdm_fit_opts.cavity */
    SDM_FIT_CHECK_CAVITY,
    /* share of the volume of the shape that lies in the image */
    SDM_FIT_CHECK_IN_IMAGE,
    /* the iterations converged; figure: their number */
    SDM_FIT_CHECK_CONVERGED,
    /* Residuals of whole neighbourhoods inside the surface, half as large as the shape is thick,
       against the noise: mean of (mean residual)^2 / variance. 1 where the residuals are noise.
       Size and correlation of the noise are robust statistics far from the surface (Hampel 1974;
       Genton 1998); noise exceeds the limit once in a thousand fits. Images: failed above the limit
       if the data contradict more than 2 % of the volume. Labels and points, which are no more
       exact than their voxels and scatter: failed above three times the limit with the same 2 %,
       and above six times the limit. Points too far apart to tell scatter from errors: doubtful,
       without a figure; where keep_appearance is set, the mean square of their distances over that
       of point_sd, which n points and k unknowns exceed by chance once in a thousand fits,
       1 + 3.1 sqrt(2 / (n - k)); doubtful above it */
    SDM_FIT_CHECK_RESIDUALS,
    /* the same outside of the surface, where other spaces of the same material may lie */
    SDM_FIT_CHECK_BESIDE,
    /* Share of the volume of the shape that is not of the inside's material: where the residuals of
       a neighbourhood exceed three standard deviations of the noise. Points: the volume between
       their surface and that of the shape, inside the latter */
    SDM_FIT_CHECK_EMPTY,
    /* Volume outside of the surface, up to the margin, that is of the inside's material, over the
       volume of the shape; measured in the same way */
    SDM_FIT_CHECK_MISSING,
    /* image: sd of the inside tissue in the fit over the robust sd of the voxels deep inside; a
       second material inside the shape makes it large */
    SDM_FIT_CHECK_INSIDE,
    /* the same for the main tissue outside */
    SDM_FIT_CHECK_OUTSIDE,
    /* image: difference of the mean inside, or of the main tissue outside, from the nearest one of
       the start, in sd of the start: the larger of the two */
    SDM_FIT_CHECK_GIVEN,
    /* number of parameters at an end of their range */
    SDM_FIT_CHECK_BOUNDS,
    /* Gain over a blob, the ellipsoid of the same volume and moments in the same place. Images:
       gain in log-likelihood, as of independent voxels; labels and points: as sdm_fit_compare();
       few points: by the likelihood of the single ones. Left out where the shape is nearly an
       ellipsoid (Dice coefficient above 0.9) */
    SDM_FIT_CHECK_BLOB,
    /* with keep_pose: gain of a free pose in log-likelihood, as of independent samples */
    SDM_FIT_CHECK_KEPT_POSE,
    /* the shape against its mirror image, see sdm_fit_compare() */
    SDM_FIT_CHECK_MIRROR,
    /* The grid of the maps holds the shape. Figure: how deep inside the shape the border of the
       grid is, mm; limit: a tenth of a voxel. Where the grid cuts the shape, the maps end open, and
       the fit sees another shape */
    SDM_FIT_CHECK_GRID,
    /* network: fraction of the held-out shapes of its training that the grid cut; not passed also
       where the training graded the network poor, see sdm_model_quality */
    SDM_FIT_CHECK_NETWORK,
    /* Points: number of those on the surface. Unknowns are the pose and the parameters without a
       normal distribution: failed below their number, doubtful below three times as many. Doubtful,
       too, if the points count as fewer independent ones than unknowns; the figure is then the
       number over sdm_fit_result.noise_factor.
       Labels: the longest edge of their voxels, mm; doubtful above the thickness of the thinnest
       part of the shape.
       All data: failed if they determine none of the parameters (sdm_fit_result.by_prior), doubtful
       if not more than half of those without a normal distribution */
    SDM_FIT_CHECK_DATA,
    /* points: median distance from their coordinate-wise median, mm; limit: a tenth of the reach of
       the shape. Points within less show too little of it, or are not in mm */
    SDM_FIT_CHECK_SIZE,
    /* Longest edge of the voxels of the maps, mm. The limit is the edge that would show the
       thickness of the shape (2/5 of the radius of its largest ball), its edges and corners (the
       distance bends within a voxel on at most a tenth of the surface), the voxels of the labels or
       the point spread of the image */
    SDM_FIT_CHECK_VOXELS,
    /* Gain over the nearest rival in log-likelihood, as of independent samples (sdm_fit_compare()).
       Rivals: the runner-up of the search for the start; the best of 96 rotations of the fitted
       shape; the shape with another value of one parameter, such as a joint of an arm; each
       improved to the nearest maximum. Poses with nearly the same surface (Dice coefficient above
       0.9) do not count. Without a figure if every such start leads back to the fit; left out where
       the pose is kept or a check failed. Points: doubtful above -30; of few points the likelihood
       of the single ones decides */
    SDM_FIT_CHECK_NEXT_POSE,
    /* points: share of those that lie on no surface of the shape but form one: neighbours as near
       as those on the shape, or in a thin layer. Doubtful above 0.003 and above a twentieth of the
       points that lie on no surface; failed above 0.05 or sdm_fit_opts.tolerance, and above 0.01 if
       SDM_FIT_CHECK_COVERED does not pass */
    SDM_FIT_CHECK_PATCH,
    /* points: share of the fitted surface without points near it. Doubtful above 0.02, because the
       data may show a part of the shape only, and for a parameter whose moved surface has no
       points. Failed if then more than 0.1 or sdm_fit_opts.tolerance of the points are strays, or
       if the share is above 0.5 and half of the parameters end at their bounds */
    SDM_FIT_CHECK_COVERED,
    /* network: sdm_fit_result.network_error_sd, at most 1; doubtful above */
    SDM_FIT_CHECK_NETWORK_ERROR,
    /* with `kept`, not beside keep_pose: gain of free parameters in log-likelihood, as of
       independent samples; doubtful above 8; failed above 20 where the surface moves by more than
       half a voxel of the maps */
    SDM_FIT_CHECK_KEPT_PARAMS,
    /* labels, points: by how far the surface of the data lies outside of the shape's, or inside,
       on average, mm: another thickness than the shape says. Left out where the parameters can
       explain it, and where a check failed */
    SDM_FIT_CHECK_OFFSET,
    SDM_FIT_N_CHECKS
} sdm_fit_check_kind;

/* Name of a check, one or two words ("residuals"); NULL: no such check. [any thread] */
SDM_API const char *sdm_fit_check_name(sdm_fit_check_kind kind);

typedef enum sdm_fit_grade {
    SDM_FIT_PASSED = 0,
    /* nothing refutes the fit, but its sd may be too small, or the data may show another shape */
    SDM_FIT_DOUBTFUL = 1,
    SDM_FIT_FAILED = 2
} sdm_fit_grade;

/* The result of one check. */
typedef struct sdm_fit_finding {
    sdm_fit_check_kind kind;
    sdm_fit_grade grade;
    /* the figure, and the limit that separates passed from the rest; NaN: none */
    double figure, limit;
    /* why the check did not pass, or why it has no figure; empty: it passed with a figure */
    char text[512];
} sdm_fit_finding;

/* All checks of a fit in the order of their kinds, those that do not apply left out. */
typedef struct sdm_fit_verdict {
    /* the worst of the findings; failed also where the fit ended before they were made */
    sdm_fit_grade grade;
    size_t n_findings;
    sdm_fit_finding findings[SDM_FIT_N_CHECKS];
    /* number of neighbourhoods, and their mean (mean residual)^2 / variance of the noise, on both
       sides of the surface together; 0: the fit ended before they were measured */
    size_t n_units;
    double chi_square;
} sdm_fit_verdict;

/* Default options. The tissues are fluid in bone, in Hounsfield units (mean +- sd): inside 40 +-
   170; outside bone 1300 +- 270 and air -880 +- 150. */
SDM_API sdm_fit_opts sdm_fit_defaults(void);

/* The same for data and maps with voxels of this edge (mm; the longest edge of a voxel of the image
   or of the maps): blur and l_ref 0.2 mm, but between 0.25 and 2 voxels; margin 1.5 mm, but between
   1.5 and 15 voxels; tissue_mm 1 mm, but between 1 and 10 voxels; point_sd 0.1 mm, but between
   0.125 and 1 voxel. sdm_fit_defaults() has these lengths for voxels of 0.1 to 0.8 mm. */
SDM_API sdm_fit_opts sdm_fit_defaults_for(double voxel);

/* Result of a fit; zero-initialise, sdm_fit_dispose() frees it. N = n_params + 6. Rows and columns
   of matrices stand for the parameters in their order; then the rotation (rad: a small rotation
   vector about the axes of the world through the origin of the shape, applied after the pose); then
   the translation (mm). */
typedef struct sdm_fit_result {
    size_t n_params;
    /* [n_params] estimate */
    double *params;
    /* world = R shape + t */
    sdm_pose pose;
    /* [N][N] covariance of the posterior; 0 for unknowns that were kept; all NaN if the fit failed
       before computing it */
    double *covariance;
    /* [N] square roots of the diagonal of the covariance; NaN in the same case, or where the
       variance is negative */
    double *sd;
    /* [N][N] correlations of the unknowns; 0 where a sd is 0, NaN where a sd is NaN */
    double *correlation;
    /* [n_params] true: the estimate is at an end of its range, and its sd is not reliable */
    bool *at_bound;
    /* [n_params] true: the target does not determine the parameter: its sd is above 0.9 of
       prior_sd */
    bool *by_prior;
    /* true: the start was moved into the network's range */
    bool start_clamped;
    /* number of maps that the exact engine made because parameters lay outside the network's
       range */
    size_t n_exact_outside;

    bool converged;
    /* why the fit stopped */
    char reason[256];
    /* number of iterations of the main phase and the polish */
    size_t n_iterations;
    /* [n_iterations] log-posterior density after each iteration, up to a constant. It may jump
       from one iteration to the next where the fit has chosen other voxels (they follow the shape),
       other weights of the priors or other standard deviations of the tissues: values on both sides
       of a jump cannot be compared */
    double *objective;
    /* log-likelihood of the target at the estimate */
    double log_likelihood;
    /* image: log-likelihood of the same voxels without a shape, under a mixture of all tissues in
       which the outside tissues keep the relative weights in space of the fit; other targets:
       NaN */
    double log_likelihood_without;
    /* image: evidence of the shape; at most 0: the image shows no such shape; other targets: NaN.
       It is the gain in log-likelihood, as of independent voxels, less the cost of the unknowns:
       log(N) / 2 for each of the pose, N being the number of independent voxels (Schwarz 1978); for
       a parameter as much or less, by Laplace's method with its prior (Kass and Raftery 1995): one
       that the data do not determine costs nothing. How many voxels count as one follows from the
       robust correlations of SDM_FIT_CHECK_RESIDUALS or, if these cannot be measured, is
       noise_factor */
    double evidence;
    /* share of the volume of the shape that lies in the image; 1 for points; NaN if the fit failed
       before computing it; the same holds for the figures marked "NaN as inside_share" */
    double inside_share;

    /* n_used: voxels or points used; n_nan: voxels near the shape that were skipped because they
       are NaN or are counted in n_cavity */
    size_t n_used, n_nan;
    /* number of voxels of the whole image left out by sdm_fit_opts.cavity */
    size_t n_cavity;
    /* sum of the correlations of a residual with all residuals, itself included (1: independent);
     * NaN as inside_share */
    double noise_factor;
    /* error near the surface of the maps of the last phase, mm, which the covariance includes: of a
       network that on held-out data, of exact maps 0. Added to it: with a label map and partial
       volume 0.12 voxels of the labels and 0.03 of the maps; with points and a network 0.01 voxels
       of the maps. NaN as inside_share */
    double model_error_mm;
    /* partial volume: sd of the point spread, mm; other fits: 0 */
    double blur;
    /* tissues at the end of the fit */
    sdm_fit_appearance appearance;
    /* points: sd of their distances from the surface, without the outliers, mm; also with
       keep_appearance as measured; other targets: 0 */
    double point_sd;
    /* number of the rotation that was chosen, from 0 */
    size_t turn;

    /* number of maps, with or without derivatives, that the network and the exact engine made */
    size_t n_network, n_exact;
    /* wall-clock time in total, in maps of the network, in maps of the exact engine, and in the
       search for the start */
    double seconds, seconds_network, seconds_exact, seconds_search;

    /* points: share of outliers, points that lie anywhere; other targets: 0 */
    double outliers;
    /* rigid motions that the target does not determine, such as "rotation about the axis (0, 0, 1)
       through (1, 2, 3) mm" (LPS) of a shape that is symmetric about this axis; empty: none. The
       pose then has any such angle, with the variance of any angle, pi^2 / 3, in the covariance; a
       prior of the rotation (translation) decides where there is one */
    char open_motions[512];
    /* keep_pose: what a fit from here with a free pose does: rms motion of the surface along its
       normal, mm, and gain in log posterior density, as of independent samples (about 3 for the
       true pose); NaN: this fit failed. 0 where the pose is estimated */
    double kept_pose_motion, kept_pose_gain;
    /* with sdm_fit_opts.cavity: radius (mm) of the widest ball in a space of the image that looks
       like the inside; else 0. A smaller cavity leaves out such spaces */
    double widest_space;

    /* whether and why the fit is to be trusted; sdm_fit() gives SDM_E_QUALITY where it failed */
    sdm_fit_verdict verdict;

    /* [n_params] standard deviation of each parameter before the fit: that of its prior or, without
       a prior, of a uniform distribution over its range */
    double *prior_sd;
    /* how often a refused fit went on from another pose or value of a parameter, see
       sdm_fit_opts.max_restarts; the result is that of the last of these fits */
    size_t n_restarts;
    /* true: the fit began with a network and ended with exact maps, see
       sdm_fit_opts.max_polish_iterations */
    bool polished;
    /* standard deviations of the pose as in sd[n_params ...], without those along open_motions:
       rad, mm; the same as in sd where there are none. NaN as sd */
    double pose_sd_determined[6];
    /* network, with the shape in the source: the largest change of a parameter if exact maps on the
       same grid replaced those of the network, to first order, over its sd without this change; and
       the index of this parameter. Only parameters that the data determine count. The squared
       changes are part of the covariance. NaN: not measured */
    double network_error_sd;
    size_t network_error_param;
    /* the change itself, in the unit of this parameter */
    double network_error;
    /* wall-clock time of the verdict: standard deviations, checks and rivals */
    double seconds_verdict;
    /* edge of the voxels of exact maps (mm) that would be fine enough, where the check
       SDM_FIT_CHECK_VOXELS has not passed, or SDM_FIT_CHECK_NETWORK_ERROR and a polish on the grid
       of the network may end too coarse: 0.8 times the limit of SDM_FIT_CHECK_VOXELS. Else NaN, and
       where such maps had more than 2^27 voxels, which the text of the check explains */
    double advised_voxel_mm;
} sdm_fit_result;

/* Fits the shape of source to target. Errors: SDM_E_ARG: source, options or start, or no voxel near
   the start; SDM_E_RANGE: start parameters out of range; SDM_E_UNSUPPORTED: more than 64
   parameters; SDM_E_FORMAT: infinite or only NaN values, points that are not finite, labels outside
   0 .. 1; SDM_E_NOMEM; SDM_E_CANCELLED; SDM_E_QUALITY: not converged; a constant image; an image
   that does not determine the shape; or a check that failed, see sdm_fit_verdict. After
   SDM_E_QUALITY *out holds what is known so far, after other errors it is empty. [any thread] */
SDM_API sdm_status sdm_fit(const sdm_fit_source *source, const sdm_fit_target *target,
                           const sdm_fit_opts *opts, sdm_fit_result *out, sdm_error *err);
SDM_API void sdm_fit_dispose(sdm_fit_result *r);

/* sdm_shape_measure() at the estimate of a fit, with the standard deviations that follow from its
   covariance to first order: sqrt(g^T C g), with the covariance C of the parameters and the
   gradient g of the measure by differences over one standard deviation of each parameter to either
   side. The pose changes no measure. `shape`: the shape
   of the fit's source or, for a fit with a model alone, one by sdm_runtime_instance(). SDM_E_ARG:
   another number of parameters; errors of sdm_shape_measure(). [any thread] */
SDM_API sdm_status sdm_fit_measure(const sdm_instance *shape, const sdm_fit_result *fit,
                                   const double *depths, size_t n_depths, sdm_measures *out,
                                   sdm_error *err);

/* points[n][3] = points (mm) spread evenly over the surface of a mesh, for a fit to the mesh. (Its
   vertices are dense where it bends and absent from flat faces, and would weigh these places
   accordingly.) The surface is the boundary of the union of the mesh's volumes
   (sdm_exact_surface()): that of a part inside another has no points. Each triangle has its share
   of the area to within one point. The points come in the order of the triangles: a part of the
   array shows a part of the shape, and every k-th point of repeating sectors may show the same
   place of each. Take random points for a smaller set. The same bits for any number of threads.
   Errors of sdm_exact_create(); SDM_E_MESH: no area. [any thread] */
SDM_API sdm_status sdm_fit_surface_points(const sdm_mesh *mesh, size_t n, int n_threads,
                                          double *points, sdm_error *err);

/* Fits the mirror image of the shape: the shape of source to the target reflected in the world's x,
   from the start pose reflected in the shape's y about the centroid of the shape. It is a rival for
   shapes with a left and a right form, fitted only as far as sdm_fit_compare() needs: with a
   polish_eps of at least 1e-3 and without SDM_FIT_CHECK_NEXT_POSE. Parameters, evidence and verdict
   are those of the mirrored shape; the pose belongs to the reflected world.
   Errors as sdm_fit(). [any thread] */
SDM_API sdm_status sdm_fit_mirrored(const sdm_fit_source *source, const sdm_fit_target *target,
                                    const sdm_fit_opts *opts, sdm_fit_result *out, sdm_error *err);

/* Compares a fit with a rival fit of the same target, for example of the mirror image of the shape.
   Returns by how much the fit is better, in log-likelihood, as of independent samples; below 0: the
   rival is better; infinite: only one of the two holds an estimate; NaN: neither does.
   Images: the difference of the evidences over max(1, the smaller chi-square of the two): if
   neither shape explains the image, the difference is less certain by this factor (Wedderburn
   1974). Other targets: n / 2 log(chi-square of the rival / chi-square of the fit), the
   log-likelihood ratio of the mean residuals of n neighbourhoods, whose common variance is
   estimated. [any thread] */
SDM_API double sdm_fit_compare(const sdm_fit_result *fit, const sdm_fit_result *rival);

/* Least difference of two fits by which one is preferred, 3: "strong evidence" (Kass and Raftery
   1995). */
#define SDM_FIT_PREFERRED 3.0

/* Adds a finding to a verdict in the order of the kinds, or replaces the one of its kind; the grade
   follows. [any thread, on a verdict of its own] */
SDM_API void sdm_fit_verdict_add(sdm_fit_verdict *v, const sdm_fit_finding *finding);

/* Morphological closing of a label map by a ball of this radius (mm, > 0; Matheron 1975), in place:
   joins compartments of one shape that are labelled apart. Voxels of values[nz][ny][nx] above 1/2
   are labelled. A voxel becomes 1 if every ball of this radius that covers it touches a labelled
   voxel. Walls between compartments that are thinner than about twice the radius are filled; so are
   bays of the outside that are as narrow; all other voxels keep their state. Beyond the grid
   nothing is labelled. SDM_E_ARG: grid or radius. The same bits for any number of threads (0: the
   OpenMP default). [any thread, on values of its own] */
SDM_API sdm_status sdm_fit_close_labels(const sdm_grid *grid, double radius, int n_threads,
                                        float *values, sdm_error *err);

/* values[nz][ny][nx] = signed distance (mm, negative inside) of the shape at params[n] and pose, at
   the voxel centres of a grid in the world, interpolated from the map of the source. Beyond the
   source's grid the distance to its border is added. n_threads 0: the OpenMP default. [any
   thread] */
SDM_API sdm_status sdm_fit_map(const sdm_fit_source *source, const double *params,
                               const sdm_pose *pose, const sdm_grid *grid, int n_threads,
                               float *values, sdm_error *err);

/* The pose that moves shape[n][3] to world[n][3] (mm), n >= 2, with the least sum of squared
   distances (Horn 1987). Where all points lie on one line, as two points do, the rotation about the
   line is undetermined: the smallest rotation is taken. SDM_E_ARG: points that coincide or are not
   finite. [any thread] */
SDM_API sdm_status sdm_fit_pose_from_points(const double *shape, const double *world, size_t n,
                                            sdm_pose *out, sdm_error *err);

/* The pose that moves `point` of the shape's frame to `centre` of the world (mm) and the shape's z
   axis to the direction `axis` (any length but 0), with the smallest rotation. Together with
   SDM_FIT_TURNS_AXIS it makes a start from a centre and an axis alone. SDM_E_ARG: an axis of length
   0, or numbers that are not finite. [any thread] */
SDM_API sdm_status sdm_fit_pose_from_axis(const double point[3], const double centre[3],
                                          const double axis[3], sdm_pose *out, sdm_error *err);

/* *centre = centroid of the inside of the shape at params[n] (NULL: the defaults), in the shape's
   frame, mm. Use it as a pivot, or as the `point` of sdm_fit_pose_from_axis(). SDM_E_QUALITY: no
   voxel of the map is inside. [any thread] */
SDM_API sdm_status sdm_fit_centre(const sdm_fit_source *source, const double *params,
                                  double centre[3], sdm_error *err);

/* A place where an image may show a shape. */
typedef struct sdm_fit_candidate {
    /* index of the source whose shape it is */
    size_t source;
    /* pose of this shape at its start parameters, from which a fit finds it */
    sdm_pose pose;
    /* share of the voxels within the shape that look like the inside, less the share of those
       around it; -1 .. 1. 1: all within and none around */
    double score;
} sdm_fit_candidate;

/* Searches a whole image or label map for shapes, without any start: out[*n] = the places that look
   most like one of the shapes, the best first, at most `most` (1 .. 1000), at least half the reach
   of the shape apart. The sources, of the same parameters, are alternatives: the left and the right
   form of an organ. The parameters are those of opts->start_params (NULL: the defaults of the first
   source), the values of the inside and the outside those of opts->appearance; opts->use_box limits
   the places.

   The score is a matched filter (North 1943) on the probability that a voxel is of the inside's
   material: within the shape against a layer around it. Every rotation is tried at every place
   with voxels of a third of the reach of the shape; all rotations of a finer set then at the best
   places, with finer voxels; the best ones climb to the nearest maximum of the score. A candidate
   is a start for sdm_fit() and no more than that: noise and other organs give candidates, too.
   *n = 0: no place looks like the shape. Errors: SDM_E_ARG: arguments, points as a target, voxels
   larger than the shape; errors of making the map. The same bits for any number of threads. [any
   thread] */
SDM_API sdm_status sdm_fit_find(const sdm_fit_source *sources, size_t n_sources,
                                const sdm_fit_target *target, const sdm_fit_opts *opts, size_t most,
                                sdm_fit_candidate *out, size_t *n, sdm_error *err);

#ifdef __cplusplus
}
#endif
#endif
