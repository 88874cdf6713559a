/* Mends creases of level sets. A crease is a voxel at a zero crossing whose gradient
   openvdb::tools::checkLevelSet refuses; the values of the stencil of that voxel are changed by the
   smallest amounts that make checkLevelSet accept it. */
#include <openvdb/math/Stencils.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <vector>

#include "vdb_parts.h"

using namespace vdb_parts;

namespace
{

/* checkLevelSet accepts squared gradients in [0.5, 1.5]; the margin covers its rounding errors. */
const float SQUARE_LOW = 0.52f, SQUARE_HIGH = 1.48f;
/* A squared gradient is moved into the interval by SQUARE_INSET, since changes for its neighbours
   move it again; each step goes the part RELAXATION of the way. */
const float SQUARE_INSET = 0.05f, RELAXATION = 0.7f;
/* A map with creases at a larger share of its zero crossings is not a distance: nothing
   is changed. */
const double CREASES_MAX = 0.5;
/* Every PLAIN_EVERY-th round uses first differences instead of the WENO gradient, and from round
   WIDE_FROM on the whole stencil may change instead of the nearest neighbours: both break cycles.
 */
const int ROUNDS_MAX = 300, PLAIN_EVERY = 6, WIDE_FROM = 24;
/* Largest change of a value per step, and lower bound of abs(value) (unless abs(value) was smaller
   at first), in voxels. */
const float STEP_MAX = 0.25f, SIZE_MIN = 0.1f;
/* Values that contribute less than this part of the sum of squared derivatives are not changed. */
const float SHARE_MIN = 1e-3f;

/* The stencil of checkLevelSet: a voxel and three neighbours on each side along x, y, z. */
using Stencil = openvdb::math::WenoStencil<const Grid>;
const int STENCIL_SIZE = Stencil::SIZE;

/* The voxel that holds value n of the stencil around `at`. */
Coord stencil_place(const Coord &at, int n)
{
    static const int along[] = {-3, -2, -1, 1, 2, 3};
    Coord c = at;
    if (n) c[(n - 1) / 6] += along[(n - 1) % 6];
    return c;
}

bool on_crease(const Stencil &stencil)
{
    if (!stencil.zeroCrossing()) return false;
    const float square = stencil.normSqGrad();
    return !(square >= SQUARE_LOW && square <= SQUARE_HIGH);
}

/* Squared gradient by upwind first differences; unlike the WENO gradient it is never 0 at a zero
   crossing. */
float plain_square(const Stencil &stencil, float voxel)
{
    const float here = stencil.getValue(0), side = here > 0 ? 1.0f : -1.0f;
    float sum = 0;
    for (const unsigned below : {3u, 9u, 15u}) {
        const float low =
            std::min(side * stencil.getValue(below), side * stencil.getValue(below + 1));
        const float slope = std::max(side * here - low, 0.0f) / voxel;
        sum += slope * slope;
    }
    return sum;
}

// all creases of the grid; an empty list if there are too many
std::vector<Coord> find_creases(const Grid &grid)
{
    std::vector<Coord> found;
    size_t crossings = 0;
    Stencil stencil(grid);
    for (auto v = grid.cbeginValueOn(); v; ++v) {
        stencil.moveTo(v.getCoord());
        crossings += stencil.zeroCrossing();
        if (on_crease(stencil)) found.push_back(v.getCoord());
    }
    if (static_cast<double>(found.size()) > CREASES_MAX * static_cast<double>(crossings))
        found.clear();
    return found;
}

/* Creases among the voxels whose stencil contains a voxel of the stencils of the creases `before`:
   no other creases can have changed in the last round. */
std::vector<Coord> find_creases_near(const Grid &grid, const std::vector<Coord> &before)
{
    std::vector<Coord> near, found;
    near.reserve(before.size() * STENCIL_SIZE * STENCIL_SIZE);
    for (const Coord &c : before)
        for (int n = 0; n < STENCIL_SIZE * STENCIL_SIZE; n++)
            near.push_back(stencil_place(stencil_place(c, n / STENCIL_SIZE), n % STENCIL_SIZE));
    std::sort(near.begin(), near.end());
    near.erase(std::unique(near.begin(), near.end()), near.end());
    Stencil stencil(grid);
    Grid::ConstAccessor acc = grid.getConstAccessor();
    for (const Coord &c : near) {
        if (!acc.isValueOn(c)) continue;
        stencil.moveTo(c);
        if (on_crease(stencil)) found.push_back(c);
    }
    return found;
}

/* The original value of each changed voxel. */
using originals = std::map<Coord, float>;

struct sweep_limits {
    float voxel, max; // edge of a voxel, largest abs(value), mm
    bool half;
};

float square_at(Stencil &stencil, const Coord &at, bool plain, float voxel)
{
    stencil.moveTo(at);
    return plain ? plain_square(stencil, voxel) : stencil.normSqGrad();
}

/* Derivative of the squared gradient at voxel `at` by the value at voxel `by`, times the voxel
   size; the finite difference goes away from 0, so that signs stay. */
float derivative(Grid::Accessor &acc, Stencil &stencil, const Coord &at, const Coord &by,
                 bool plain, float voxel)
{
    const float v = acc.getValue(by), part = std::copysign(1.0f / 1024, v),
                before = square_at(stencil, at, plain, voxel);
    acc.setValueOnly(by, v + part * voxel);
    const float after = square_at(stencil, at, plain, voxel);
    acc.setValueOnly(by, v);
    return (after - before) / part;
}

/* One step of the Kaczmarz method (1937): the smallest change of the voxel and its neighbours, or
   of the whole stencil, that to first order moves the squared gradient into the accepted interval.
   Signs stay, so no voxel changes between inside and outside. */
void mend_crease(Grid::Accessor &acc, Stencil &stencil, const Coord &at, int round,
                 const sweep_limits &l, originals &original)
{
    stencil.moveTo(at);
    if (!on_crease(stencil)) return; // an earlier step of this round has mended it
    const float square = stencil.normSqGrad();
    const float missing =
        (square < SQUARE_LOW ? SQUARE_LOW + SQUARE_INSET : SQUARE_HIGH - SQUARE_INSET) - square;
    // derivatives by the values that may change
    float slope[STENCIL_SIZE], sum = 0;
    for (int n = 0; n < STENCIL_SIZE; n++) {
        const Coord c = stencil_place(at, n);
        const bool next = n == 0 || (n - 1) % 6 / 2 == 1,
                   free = acc.isValueOn(c) && (next || round >= WIDE_FROM);
        slope[n] = free ? derivative(acc, stencil, at, c, round % PLAIN_EVERY == 0, l.voxel) : 0;
        sum += slope[n] * slope[n];
    }
    for (int n = 0; n < STENCIL_SIZE; n++) {
        if (!(slope[n] * slope[n] > SHARE_MIN * sum)) continue;
        const Coord c = stencil_place(at, n);
        // change along the derivatives, within the limits
        const float v = acc.getValue(c), first = original.emplace(c, v).first->second;
        const float step =
            std::min(std::max(RELAXATION * missing * slope[n] / sum, -STEP_MAX), STEP_MAX) *
            l.voxel;
        const float min = std::min(std::fabs(first), SIZE_MIN * l.voxel);
        const float size = std::min(std::max(first < 0 ? -v - step : v + step, min), l.max);
        acc.setValueOnly(c, as_stored(first < 0 ? -size : size, l.half));
    }
}

} // namespace

void vdb_parts::mend_creases(Grid &grid, const sdm_vdb_opts &o, sdm_vdb_report &report,
                             sdm_error *err)
{
    originals original;
    Grid::Accessor acc = grid.getAccessor();
    Stencil stencil(grid);
    const sweep_limits limits = {
        static_cast<float>(grid.voxelSize()[0]),
        std::nextafter(as_stored(grid.background() * 0.999f, o.half), 0.0f), o.half};
    std::vector<Coord> found = find_creases(grid);
    for (int round = 1; round <= ROUNDS_MAX && !found.empty(); round++) {
        check_cancelled(o, err);
        for (const Coord &c : found) mend_crease(acc, stencil, c, round, limits, original);
        found = find_creases_near(grid, found);
    }
    for (const auto &[c, v] : original) {
        const double change =
            std::fabs(static_cast<double>(acc.getValue(c)) - static_cast<double>(v));
        if (change > 0) report.adjusted_voxels++;
        report.adjusted_mm = std::max(report.adjusted_mm, change);
    }
}
