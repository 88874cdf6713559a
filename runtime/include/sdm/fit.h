/* Fits a shape to an image, labels or points: estimates the parameters and the rigid pose of the
   shape, with their standard deviations, and judges the result.

   A fit in C (docs/fitting.md is the guide; complete programs in examples/consume: fit_points.c
   with a network, fit_labels.c with exact maps):
   - Fill an sdm_fit_source (what makes the maps) and an sdm_fit_target (the data). Without a model
     choose the grid of the maps: the box of the mesh and a margin, about 64 voxels along the
     longest edge, at least three across the thinnest part.
   - Take the options of sdm_fit_defaults_for(). Set the start: start_params, and start_pose or
     turns; for an image also the values of its tissues, appearance.
   - Call sdm_fit(). SDM_OK: nothing refutes the fit; sdm_fit_result.verdict may still be doubtful,
     with a reason. SDM_E_QUALITY: the fit is not to be trusted; the verdict says why.

   Words: the world is the space of the data (LPS, mm), the shape's frame that of its mesh
   (sdm/pose.h). sd: standard deviation. A tissue: a material inside or outside the shape.

   Method. Unknowns are the n parameters of the shape and the 6 numbers of its pose. In each
   iteration the network or the exact engine makes the map of the shape on a grid in the shape's
   frame. The map is interpolated at the voxel centres of the image. The distributions of the values
   of the tissues are estimated along with the shape. Two models explain the value of a voxel:
   - partial volume (Santago and Gage 1993), the default: the shape fills the share a of the voxel,
     0 .. 1, seen through a Gaussian point spread, and the mean of the value is
     a m_in + (1 - a) m_out, with the means m of the tissues. Unbiased where the image is blurred;
   - labels (Demarcy 2017; Wang et al. 2021): the voxel is inside with probability
     1 / (1 + exp(distance / l_ref)), and its value comes from the inside or the outside tissues.
     Estimated by expectation-maximisation. Tolerant, but biased in blurred images: the edge lies
     where the inside and the outside density are equal, not where the surface is.

   The posterior density is maximised within the ranges of the parameters, by damped Newton steps
   with the information (negative second derivative of the log-likelihood). Exact distances have
   creases where the nearest face changes. Fits with exact maps therefore end with gradients
   averaged over a motion of the surface of 3 % of a map voxel (Ermoliev, Norkin and Wets 1995), so
   that every nearby start leads to the same maximum.

   The covariance is the sandwich H^-1 J H^-1 (Huber 1967): H is the observed information (labels:
   Louis 1982), J the covariance of the gradient of the log-likelihood with the spatial correlation
   of the residuals (Conley 1999), corrected for the part of the residuals that the fit has
   explained. So correlated noise and small errors of the model widen it. */
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

/* What makes the maps: a network, the exact engine, or both. The caller keeps ownership. */
typedef struct sdm_fit_source {
    /* the network that makes the maps; NULL: the exact engine makes them */
    const sdm_model *model;
    /* the shape of the exact engine; with a model: that of sdm_runtime_instance(), or NULL. Without
       it there is no polish, SDM_RANGE_EXACT is not allowed, and the error of the network is not
       measured (sdm_fit_result.network_error_sd) */
    const sdm_instance *shape;
    /* without a model: grid of the exact maps in the shape's frame. It must hold the shape with a
       margin. SDM_FIT_CHECK_VOXELS tells whether its voxels are fine enough; with coarser ones the
       sd of weakly determined unknowns are too small */
    sdm_grid grid;
    /* with a model: the range of the parameters.
       SDM_RANGE_REFUSE: that of the training; a start outside of it gives SDM_E_RANGE.
       SDM_RANGE_CLAMP: the same, but a start outside of it is moved to its nearest end
       (sdm_fit_result.start_clamped).
       SDM_RANGE_EXACT: that of the shape; the exact engine makes the maps outside of the range of
       the training */
    sdm_range_policy policy;
} sdm_fit_source;

typedef enum sdm_fit_kind {
    /* values[nz][ny][nx] are an image in any unit */
    SDM_FIT_IMAGE = 0,
    /* values[nz][ny][nx] are probabilities of inside, 0 .. 1 (a label map: 0 and 1): with
       SDM_FIT_PARTIAL_VOLUME shares of voxels, with SDM_FIT_LABELS labels with the logistic prior
     */
    SDM_FIT_LABEL = 1,
    /* points[n_points][3] lie on the surface, in the world, mm; outliers are tolerated. Their
       distances come from the surface of the shape (exact engine) or from the map (network). The
       fit is made twice: from the given start, and from the shape on whose surface the points lie
       most evenly. The better one is kept */
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

/* How a fit explains the values of voxels: as a blurred mixture of the tissues (partial volume), or
   with one tissue label for each voxel. The head of this file describes both models. */
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
    /* after the last step: one call before the checks, and one before each rival, with the fields
       `start` and `n_starts` of sdm_fit_progress */
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
    /* in a search with several starts: the round (1: every start, with a wide point spread; 2: the
       best of them), the number of the present start in this round, from 1, and the number of
       starts in this round. SDM_FIT_JUDGE: the number of the present rival, from 1, and the largest
       number of rivals. Else 0 */
    size_t round, start, n_starts;
    /* search: the best start that has ended in this round; NULL: none. [n_params] its parameters */
    const double *best_params;
    /* name of the check that has refused the fit, which now goes on from another start; NULL: none
       has. A static string */
    const char *refused_by;
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
       has a normal prior about its start value, with the sd of the tissue. The prior counts only
       where blur is as wide as the shape is thick: there no voxel shows the mean */
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
       outliers. Besides, a share of the points may lie anywhere (their distances are then uniform
       over the size of the shape). The share is estimated; with keep_appearance it is 0 */
    double point_dof;

    /* [n_params] start values of the parameters; NULL: the defaults of the shape */
    const double *start_params;
    sdm_pose start_pose;
    /* rotations about `pivot` that are tried: turn i starts at R = R_start Q_i, with the pivot
       where start_pose has it */
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
       Normal: in deviations of the distribution, about its mean; 1: the prior is the distribution.
       Uniform: in halves of the range, about its middle; 0.5: the range is the mean +- two sd.
       The likelihood counts correlated voxels as independent, which makes it too sharp beside a
       prior. So each log prior is multiplied by the variance with correlation over that without */
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
       ball of this radius, mm, >= 0, are too wide to be the shape and are left out. Take about 1.25
       times the radius of the largest ball in the shape. 0: no space is left out */
    double cavity;
    /* 0 .. 1: share of the volume of the fitted shape that must lie in the image */
    double least_inside;

    /* largest number of iterations of the main phase, >= 1; the steps with the averaged gradient at
       its end have as many again */
    size_t max_iterations;
    /* largest number of iterations of the polish, with the exact engine after a network's fit,
       counted in the same way; 40 are enough. 0: no polish, unless a fit to points has not
       converged in the main phase: it goes on with at most max_iterations of exact distances */
    size_t max_polish_iterations;
    /* > 0: the steps end when the largest component of a step is at most eps. Components are the
       change of a parameter over its range, of the rotation in rad, and of the translation over the
       size of the shape. Unless the parameters are kept, the steps also end when they promise no
       gain: with a network several in a row, with exact maps the first one. Steps with averaged
       gradients follow this second end, and every converged fit with exact maps */
    double eps;
    /* > 0: replaces eps in steps with exact maps and the averaged gradient, of the main phase and
       of the polish; if the parameters are kept, in all steps with exact maps */
    double polish_eps;
    /* > 0: the steps also end, whatever eps and polish_eps are, when an undamped step would move no
       unknown by more than this share of its sd; 0: they do not */
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

    /* 0 .. 1: by how much a real organ may differ from its shape: the limit of SDM_FIT_CHECK_EMPTY,
       for labels and points of SDM_FIT_CHECK_MISSING, too (each at least 0.05; images with
       SDM_FIT_LABELS 0.2). > 0: residuals and an offset alone do not fail the fit */
    double tolerance;
    /* images, >= 0: a fit fails (SDM_FIT_CHECK_MISSING) if voxels beside the shape, such as those
       of neighbouring spaces, have the values of the inside and a volume above this multiple of
       the volume of the shape */
    double beside;

    /* how often a fit that its checks refuse may go on from another value of one parameter (points:
       also from another pose, and where SDM_FIT_CHECK_NEXT_POSE is doubtful because of it) that
       explains the data better. A long shape, for example, may have stopped with one end on the
       data and the other one beyond them. 0: never; never either where parameters or pose are kept
     */
    size_t max_restarts;
    /* [n_params] true: this parameter is not estimated and keeps its start value; NULL: all or none
       are estimated, see keep_params */
    const bool *kept;

    /* images and labels. true: the shape is open at the end that it states (sdm_shape.open_end).
       Beyond the plane of this end, up to `margin` from it, a voxel may be inside or outside,
       wherever the surface lies: a wider space there does not attract the shape. The plane moves
       with the shape. The verdict and the sd take no voxels from beyond it. Needs
       sdm_fit_source.shape. Without such a space the end is less well determined than with false */
    bool open_end;
} sdm_fit_opts;

/* The checks of a fit. Each has a figure, described here; docs/fitting-reference.md#the-checks has
   the limits and the grades. "Gain" is a difference in log-likelihood, as of independent samples.
   New checks are added at the end. */
typedef enum sdm_fit_check_kind {
    /* image: sdm_fit_result.evidence, of the shape against the same voxels without a shape */
    SDM_FIT_CHECK_NO_SHAPE = 0,
    /* image: inside mean less outside mean; its sign must be that of the start */
    SDM_FIT_CHECK_CONTRAST,
    /* radius of the largest ball in the shape, mm; it must be below sdm_fit_opts.cavity */
    SDM_FIT_CHECK_CAVITY,
    /* share of the volume of the shape that lies in the image */
    SDM_FIT_CHECK_IN_IMAGE,
    /* number of iterations; they must have converged */
    SDM_FIT_CHECK_CONVERGED,
    /* mean of (mean residual)^2 / variance over neighbourhoods inside the surface, half as large as
       the shape is thick; 1: noise alone. Points whose sd is kept (keep_appearance): it may be the
       mean square of their distances over point_sd^2. Points too far apart to tell scatter from
       errors, whose sd is not kept: no figure, doubtful */
    SDM_FIT_CHECK_RESIDUALS,
    /* the same outside of the surface, where other spaces of the same material may lie */
    SDM_FIT_CHECK_BESIDE,
    /* Share of the volume of the shape that is not of the inside's material: where the residuals of
       a neighbourhood exceed three sd of the noise. Points: the volume inside the shape between
       their surface and that of the shape */
    SDM_FIT_CHECK_EMPTY,
    /* volume of the inside's material beside the shape, up to the margin, over the volume of the
       shape; measured in the same way */
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
    /* gain over a blob, the ellipsoid of the same volume and moments in the same place. Left out
       where the shape is nearly an ellipsoid (Dice coefficient above 0.9) */
    SDM_FIT_CHECK_BLOB,
    /* with keep_pose: gain of a free pose */
    SDM_FIT_CHECK_KEPT_POSE,
    /* gain over the mirror image of the shape, see sdm_fit_compare() */
    SDM_FIT_CHECK_MIRROR,
    /* how deep inside the shape the border of the maps is, mm. Where the grid cuts the shape, the
       maps end open, and the fit sees another shape */
    SDM_FIT_CHECK_GRID,
    /* network: share of the held-out shapes of its training that its grid cuts; not passed also
       where the training graded the network poor, see sdm_model_quality */
    SDM_FIT_CHECK_NETWORK,
    /* The data are enough. Points: their number on the surface, or as how many independent ones
       they count. Labels: longest edge of their voxels, mm. All: number of parameters that the data
       determine, see sdm_fit_result.by_prior */
    SDM_FIT_CHECK_DATA,
    /* points: median distance from their coordinate-wise median, mm. Too small: they show too
       little of the shape, or are not in mm */
    SDM_FIT_CHECK_SIZE,
    /* longest edge of the voxels of the maps, mm; sdm_fit_result.advised_voxel_mm has a finer one
     */
    SDM_FIT_CHECK_VOXELS,
    /* Gain over the nearest rival. Rivals: the runner-up of the search for the start; the best of
       96 rotations of the fitted shape; the shape with another value of one parameter, such as a
       joint of an arm; each improved to the nearest maximum. Poses with nearly the same surface
       (Dice coefficient above 0.9) do not count. No figure if every such start leads back to the
       fit; left out where the pose is kept or a check failed */
    SDM_FIT_CHECK_NEXT_POSE,
    /* points: share of those that lie on no surface of the shape but form one: neighbours as near
       as those on the shape, or in a thin layer; or share of the points that lie together on one
       side of the surface, 5 sd or more from it */
    SDM_FIT_CHECK_PATCH,
    /* points: share of the fitted surface, or of the part that a parameter moves, without points
       near it */
    SDM_FIT_CHECK_COVERED,
    /* network: sdm_fit_result.network_error_sd */
    SDM_FIT_CHECK_NETWORK_ERROR,
    /* with `kept`, not beside keep_pose: gain if the kept parameters are free */
    SDM_FIT_CHECK_KEPT_PARAMS,
    /* labels, points: by how far the surface of the data lies outside of the shape's, or inside, on
       average, mm: another thickness than the shape says. Left out where the parameters can explain
       it, and where a check failed */
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

/* Default options for voxels of 0.1 to 0.8 mm. The tissues are fluid in bone, in Hounsfield units
   (mean +- sd): inside 40 +- 170; outside bone 1300 +- 270 and air -880 +- 150. */
SDM_API sdm_fit_opts sdm_fit_defaults(void);

/* The same for any voxels. `voxel`: the longest edge of a voxel of the image or of the maps
   (points: of the maps), mm. blur and l_ref are 0.2 mm, but 0.25 to 2 voxels; margin 1.5 mm,
   but 1.5 to 15 voxels; tissue_mm 1 mm, but 1 to 10 voxels; point_sd 0.1 mm, but 0.125 to 1 voxel.
 */
SDM_API sdm_fit_opts sdm_fit_defaults_for(double voxel);

/* Result of a fit; zero-initialise, sdm_fit_dispose() frees it. The N = n_params + 6 unknowns of
   sd, covariance and correlation are the parameters in their order; then the rotation (rad: a small
   rotation vector about the axes of the world through the origin of the shape, applied after the
   pose); then the translation (mm). The most important members: params, pose, sd, by_prior,
   at_bound, verdict. */
typedef struct sdm_fit_result {
    size_t n_params;
    /* [n_params] estimate */
    double *params;
    /* world = R shape + t */
    sdm_pose pose;
    /* [N][N] covariance of the posterior; 0 for unknowns that were kept; all NaN if the fit failed
       before computing it */
    double *covariance;
    /* [N] square roots of the diagonal of the covariance; NaN if the covariance is, or where the
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
    /* [n_iterations] log-posterior density after each iteration, up to a constant. It jumps where
       the fit has chosen other voxels (they follow the shape), other weights of the priors or other
       sd of the tissues: values on both sides of a jump cannot be compared */
    double *objective;
    /* log-likelihood of the target at the estimate */
    double log_likelihood;
    /* image: log-likelihood of the same voxels without a shape, under a mixture of all tissues (the
       outside tissues keep their relative weights in space); other targets: NaN */
    double log_likelihood_without;
    /* image: evidence of the shape; at most 0: the image shows no such shape; other targets: NaN.
       It is the gain in log-likelihood, as of independent voxels, less the cost of the unknowns:
       log(n) / 2 for each of the pose, with n independent voxels (Schwarz 1978); for a parameter as
       much or less, by Laplace's method with its prior (Kass and Raftery 1995). A parameter that
       the data do not determine costs nothing */
    double evidence;
    /* share of the volume of the shape that lies in the image; 1 for points; NaN if the fit failed
       before it was computed, as other members with the words "NaN as inside_share" */
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
       network that on held-out shapes, of exact maps 0. To it are added: with a label map and
       partial volume 0.12 voxels of the labels and 0.03 of the maps; with points and a network 0.01
       voxels of the maps. NaN as inside_share */
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
       angle of the pose about it is then arbitrary, unless there is a prior of the rotation, and
       the covariance contains the variance of an arbitrary angle, pi^2 / 3. The same of
       translations */
    char open_motions[512];
    /* keep_pose: result of a fit from here with a free pose: rms motion of the surface along its
       normal, mm, and gain in log-posterior density, as of independent samples (about 3 if the kept
       pose is true); NaN: this fit failed. 0 where the pose is estimated */
    double kept_pose_motion, kept_pose_gain;
    /* with sdm_fit_opts.cavity: radius (mm) of the widest ball in a space of the image that looks
       like the inside; else 0. A smaller cavity leaves out such spaces */
    double widest_space;

    /* whether the fit is to be trusted, and why; failed: sdm_fit() returns SDM_E_QUALITY */
    sdm_fit_verdict verdict;

    /* [n_params] standard deviation of each parameter before the fit: that of its prior or, without
       a prior, of a uniform distribution over its range */
    double *prior_sd;
    /* how often a fit went on from another pose or value of a parameter, see
       sdm_fit_opts.max_restarts; the result is that of the last of these fits */
    size_t n_restarts;
    /* true: the fit began with a network and ended with exact maps, see
       sdm_fit_opts.max_polish_iterations */
    bool polished;
    /* standard deviations of the pose as in sd[n_params ...], without those along open_motions:
       rad, mm; the same as in sd where there are none. NaN as sd */
    double pose_sd_determined[6];
    /* network, with the shape in the source: the largest change of a parameter, over its sd without
       this change, if exact maps on the same grid replaced those of the network (to first order);
       and the index of this parameter. Parameters that the data do not determine do not count. The
       squared changes are part of the covariance. NaN: not measured */
    double network_error_sd;
    size_t network_error_param;
    /* the change itself, in the unit of this parameter */
    double network_error;
    /* wall-clock time of the verdict: standard deviations, checks and rivals */
    double seconds_verdict;
    /* edge of the voxels of exact maps (mm) that would be fine enough: 0.8 times the limit of
       SDM_FIT_CHECK_VOXELS. Set if this check has not passed; or if SDM_FIT_CHECK_NETWORK_ERROR has
       not, and a polish on the grid of the network may end too coarse. Else NaN; also NaN where
       such maps had more than 2^27 voxels: the text of the check then names the cause */
    double advised_voxel_mm;
    /* number of voxels near the shape that lie beyond its open end (sdm_fit_opts.open_end); n_used
       does not count them */
    size_t n_beyond;
} sdm_fit_result;

/* Fits the shape of source to target. SDM_E_QUALITY: the fit is not to be trusted: it did not
   converge, the image is constant or does not determine the shape, or a check failed
   (sdm_fit_verdict). *out then holds the results that are known; after other errors it is empty:
   SDM_E_ARG: source, options or start, or no voxel near the start; SDM_E_RANGE: start parameters
   out of range; SDM_E_UNSUPPORTED: more than 64 parameters; SDM_E_FORMAT: infinite or only NaN
   values, points that are not finite, labels outside 0 .. 1; SDM_E_NOMEM; SDM_E_CANCELLED. [any
   thread] */
SDM_API sdm_status sdm_fit(const sdm_fit_source *source, const sdm_fit_target *target,
                           const sdm_fit_opts *opts, sdm_fit_result *out, sdm_error *err);
SDM_API void sdm_fit_dispose(sdm_fit_result *r);

/* sdm_shape_measure() at the estimate of a fit, with standard deviations to first order:
   sqrt(g^T C g), where C is the covariance of the parameters and g the gradient of the measure, by
   differences over one sd of each parameter to either side. `shape`: that of the fit's source or,
   for a fit with a model alone, one by sdm_runtime_instance(). SDM_E_ARG: another number of
   parameters; errors of sdm_shape_measure(). [any thread] */
SDM_API sdm_status sdm_fit_measure(const sdm_instance *shape, const sdm_fit_result *fit,
                                   const double *depths, size_t n_depths, sdm_measures *out,
                                   sdm_error *err);

/* points[n][3] = points (mm) spread evenly over the surface of a mesh, for a fit to the mesh. (Its
   vertices are dense where it bends and absent from flat faces, which would weigh less.) The
   surface is the boundary of the union of the mesh's volumes (sdm_exact_surface()), without parts
   inside others. Each triangle has its share of the area to within one point. The points come in
   the order of the triangles: for a smaller set take random ones, since a part of the array shows a
   part of the shape. The same bits for any number of threads. Errors of sdm_exact_create();
   SDM_E_MESH: no area. [any thread] */
SDM_API sdm_status sdm_fit_surface_points(const sdm_mesh *mesh, size_t n, int n_threads,
                                          double *points, sdm_error *err);

/* Fits the mirror image of the shape, for sdm_fit_compare() of shapes with a left and a right form.
   It fits the shape of source to the target reflected in the world's x, from the start pose
   reflected in the shape's y about the centroid of the shape; as far as the comparison needs, with
   a polish_eps of at least 1e-3 and without SDM_FIT_CHECK_NEXT_POSE. Parameters, evidence and
   verdict are those of the mirrored shape; the pose belongs to the reflected world. Errors as
   sdm_fit(). [any thread] */
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
   voxel: walls and bays that are narrower than about twice the radius are filled, all other voxels
   keep their state. Beyond the grid nothing is labelled. SDM_E_ARG: grid or radius. The same bits
   for any number of threads (0: the OpenMP default). [any thread, on values of its own] */
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
   of the shape apart. The sources have the same parameters and are alternatives, such as the left
   and the right form of an organ. It reads opts->start_params (NULL: the defaults of the first
   source), opts->appearance, and opts->use_box, which limits the places.

   A candidate is only a start for sdm_fit(): noise and other organs give candidates, too.
   *n = 0: no place looks like the shape. The score is a matched filter (North 1943) on the
   probability that a voxel is of the inside's material: within the shape against a layer around it.
   Rotations are tried at every place with voxels of a third of the reach of the shape; a finer set
   of rotations at the best places, with finer voxels; the best ones climb to the nearest maximum of
   the score. Errors: SDM_E_ARG: arguments, points as a target, voxels larger than the shape; errors
   of making the map. The same bits for any number of threads. [any thread] */
SDM_API sdm_status sdm_fit_find(const sdm_fit_source *sources, size_t n_sources,
                                const sdm_fit_target *target, const sdm_fit_opts *opts, size_t most,
                                sdm_fit_candidate *out, size_t *n, sdm_error *err);

#ifdef __cplusplus
}
#endif
#endif
