/* Creases of level sets: values that OpenVDB's check of the gradient refuses, changed by the least
 * that it accepts. */
#include <openvdb/math/Stencils.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <vector>

#include "vdb_parts.h"

using namespace vdb_parts;

namespace
{

// CheckEikonal refuses squared gradients outside [0.5, 1.5]; the margin is for the rounding of the
// check itself
const float SQUARE_LOW = 0.52f, SQUARE_HIGH = 1.48f;
// how far within it a gradient is brought, for what its neighbours ask, and the part of the way at
// a time
const float SQUARE_INSET = 0.05f, RELAXATION = 0.7f;
// a map that is wrong at a larger share of its zero crossings is no distance
const double CREASES_MOST = 0.5;
// every so many rounds go by first differences, and from such a round on all of the stencil may
// change, against cycles
const int ROUNDS_MOST = 300, PLAIN_EVERY = 6, WIDE_FROM = 24;
// in voxels: most that a value changes at a time, and least that is left of one that was not
// smaller
const float STEP_MOST = 0.25f, SIZE_LEAST = 0.1f;
// values of less of the squared slope stay
const float SHARE_LEAST = 1e-3f;

// that of the check: a voxel and three on each side along x, y, z
using Stencil = openvdb::math::WenoStencil<const Grid>;
const int STENCIL_SIZE = Stencil::SIZE;

// place of value n of the stencil
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

// squared gradient by first differences, in voxels: at a zero crossing it never vanishes
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
    if (static_cast<double>(found.size()) > CREASES_MOST * static_cast<double>(crossings))
        found.clear();
    return found;
}

// the same where the stencil reaches what was changed: stencils of creases of before
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

// the first value seen of each voxel that is changed
using originals = std::map<Coord, float>;

struct sweep_limits {
    float voxel, most; // mm
    bool half;
};

float square_at(Stencil &stencil, const Coord &at, bool plain, float voxel)
{
    stencil.moveTo(at);
    return plain ? plain_square(stencil, voxel) : stencil.normSqGrad();
}

// derivative of the squared gradient at a voxel by the value of another, times the size of a voxel;
// away from 0, where signs stay
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

/* The least change of a voxel and its neighbours, or of the whole stencil, that brings the squared
   gradient back to where it is allowed, to first order (Kaczmarz 1937). Signs stay, and with them
   the voxels that are inside. */
void project(Grid::Accessor &acc, Stencil &stencil, const Coord &at, int round,
             const sweep_limits &l, originals &original)
{
    stencil.moveTo(at);
    if (!on_crease(stencil)) return; // by what was done beside it
    const float square = stencil.normSqGrad();
    const float missing =
        (square < SQUARE_LOW ? SQUARE_LOW + SQUARE_INSET : SQUARE_HIGH - SQUARE_INSET) - square;
    float slope[STENCIL_SIZE], sum = 0;
    for (int n = 0; n < STENCIL_SIZE; n++) {
        const Coord c = stencil_place(at, n);
        const bool next = n == 0 || (n - 1) % 6 / 2 == 1,
                   free = acc.isValueOn(c) && (next || round >= WIDE_FROM);
        slope[n] = free ? derivative(acc, stencil, at, c, round % PLAIN_EVERY == 0, l.voxel) : 0;
        sum += slope[n] * slope[n];
    }
    for (int n = 0; n < STENCIL_SIZE; n++) {
        if (!(slope[n] * slope[n] > SHARE_LEAST * sum)) continue;
        const Coord c = stencil_place(at, n);
        const float v = acc.getValue(c), first = original.emplace(c, v).first->second;
        const float step =
            std::min(std::max(RELAXATION * missing * slope[n] / sum, -STEP_MOST), STEP_MOST) *
            l.voxel;
        const float least = std::min(std::fabs(first), SIZE_LEAST * l.voxel);
        const float size = std::min(std::max(first < 0 ? -v - step : v + step, least), l.most);
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
    for (int round = 1; round <= ROUNDS_MOST && !found.empty(); round++) {
        check_cancelled(o, err);
        for (const Coord &c : found) project(acc, stencil, c, round, limits, original);
        found = find_creases_near(grid, found);
    }
    for (const auto &[c, v] : original) {
        const double change =
            std::fabs(static_cast<double>(acc.getValue(c)) - static_cast<double>(v));
        if (change > 0) report.adjusted_voxels++;
        report.adjusted_mm = std::max(report.adjusted_mm, change);
    }
}
