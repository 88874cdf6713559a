/* Level sets from maps in blocks: blocks become leaves, without a dense map between. */
#include <algorithm>
#include <cmath>
#include <memory>

#include "padded.h"
#include "vdb_parts.h"

using namespace vdb_parts;

namespace
{

using Leaf = Grid::TreeType::LeafNodeType;
const int64_t EDGE = SDM_BLOCK_SIZE;

// whether a tile has values
bool has_values(uint32_t number) { return number < SDM_TILE_INSIDE; }

// a tile by its place
struct place {
    int64_t at[3];
    uint32_t number; // as in sdm_blocks.tile
};

uint32_t number_at(const sdm_blocks &b, int64_t i, int64_t j, int64_t k)
{
    return b.tile[(k * b.n[1] + j) * b.n[0] + i];
}

// calls f(place) for every tile in their order, until it returns true; returns whether
// it did
template <typename F> bool any_block(const sdm_blocks &b, F f)
{
    place p;
    for (p.at[2] = 0; p.at[2] < b.n[2]; p.at[2]++)
        for (p.at[1] = 0; p.at[1] < b.n[1]; p.at[1]++)
            for (p.at[0] = 0; p.at[0] < b.n[0]; p.at[0]++) {
                p.number = number_at(b, p.at[0], p.at[1], p.at[2]);
                if (f(p)) return true;
            }
    return false;
}

// number of voxels of a block in the grid, along an axis
int64_t in_grid(const sdm_blocks &b, const place &p, int a)
{
    return std::min(b.grid.n[a] - EDGE * p.at[a], EDGE);
}

const float *values_of(const sdm_blocks &b, uint32_t number) { return b.values[number]; }

// the value of voxel `at` of the grid, cut off at the band
float value_at(const sdm_blocks &b, float width, const int64_t at[3])
{
    const uint32_t n = number_at(b, at[0] / EDGE, at[1] / EDGE, at[2] / EDGE);
    if (!has_values(n)) return n == SDM_TILE_INSIDE ? -width : width;
    return values_of(b, n)[(at[2] % EDGE * EDGE + at[1] % EDGE) * EDGE + at[0] % EDGE];
}

// calls f(voxel of the grid, value) for the voxels of a block with values that lie in the grid,
// until it returns true
template <typename F> bool any_voxel(const sdm_blocks &b, const place &p, F f)
{
    const float *values = values_of(b, p.number);
    int64_t n[3], v[3];
    for (int a = 0; a < 3; a++) n[a] = in_grid(b, p, a);
    for (int64_t k = 0; k < n[2]; k++)
        for (int64_t j = 0; j < n[1]; j++)
            for (int64_t i = 0; i < n[0]; i++) {
                v[0] = EDGE * p.at[0] + i, v[1] = EDGE * p.at[1] + j, v[2] = EDGE * p.at[2] + k;
                if (f(v, values[(k * EDGE + j) * EDGE + i])) return true;
            }
    return false;
}

bool at_border(const sdm_blocks &b, const place &p)
{
    bool border = false;
    for (int a = 0; a < 3; a++) border = border || p.at[a] == 0 || p.at[a] == b.n[a] - 1;
    return border;
}

// sign changes of a band between neighbouring voxels
struct crossings {
    size_t all, jumps; // jumps: not both values lie within the band
};

void count_pair(float one, float other, float width, crossings &c)
{
    if ((one < 0) == (other < 0)) return;
    c.all++;
    c.jumps += !(std::fabs(one) < width && std::fabs(other) < width);
}

// the pairs of voxels of a block with the next voxels along each axis; of a block without values,
// the pairs with the next blocks without values
void count_block(const sdm_blocks &b, const place &p, float width, crossings &c)
{
    if (has_values(p.number)) {
        any_voxel(b, p, [&](const int64_t v[3], float value) {
            for (int a = 0; a < 3; a++) {
                int64_t next[3] = {v[0], v[1], v[2]};
                if (++next[a] < b.grid.n[a]) count_pair(value, value_at(b, width, next), width, c);
                // the block before may have no values: its side is then compared from here
                next[a] -= 2;
                if (v[a] % EDGE == 0 && v[a] > 0 &&
                    number_at(b, next[0] / EDGE, next[1] / EDGE, next[2] / EDGE) >= SDM_TILE_INSIDE)
                    count_pair(value, value_at(b, width, next), width, c);
            }
            return false;
        });
        return;
    }
    for (int a = 0; a < 3; a++) {
        int64_t next[3] = {p.at[0], p.at[1], p.at[2]};
        if (++next[a] == b.n[a]) continue;
        const uint32_t n = number_at(b, next[0], next[1], next[2]);
        if (has_values(n) || n == p.number) continue;
        const size_t pairs = static_cast<size_t>(in_grid(b, p, (a + 1) % 3)) *
                             static_cast<size_t>(in_grid(b, p, (a + 2) % 3));
        c.all += pairs;
        c.jumps += pairs;
    }
}

// a leaf from a block: OpenVDB's z is fastest
void add_leaf(Grid::Accessor &acc, const sdm_blocks &b, const place &p, float background, bool half)
{
    const Coord corner(static_cast<int>(EDGE * p.at[0]), static_cast<int>(EDGE * p.at[1]),
                       static_cast<int>(EDGE * p.at[2]));
    if (!has_values(p.number)) {
        if (p.number == SDM_TILE_INSIDE) acc.addTile(1, corner, -background, false);
        return;
    }
    auto leaf = std::make_unique<Leaf>(corner, background, false);
    bool inside = false;
    any_voxel(b, p, [&](const int64_t v[3], float value) {
        const auto at =
            static_cast<openvdb::Index32>((v[0] % EDGE * EDGE + v[1] % EDGE) * EDGE + v[2] % EDGE);
        const float stored = as_stored(value, half);
        inside = inside || stored < 0;
        if (std::fabs(stored) < background)
            leaf->setValueOn(at, stored);
        else if (stored < 0)
            leaf->setValueOff(at, -background);
        return false;
    });
    if (leaf->onVoxelCount())
        acc.addLeaf(leaf.release());
    else if (inside)
        acc.addTile(1, corner, -background, false);
}

} // namespace

bool vdb_parts::blocks_leave_grid(const sdm_blocks &b, float width)
{
    return any_block(b, [&](const place &p) {
        if (!at_border(b, p)) return false;
        if (!has_values(p.number)) return p.number == SDM_TILE_INSIDE;
        return any_voxel(b, p, [&](const int64_t v[3], float value) {
            bool border = false;
            for (int a = 0; a < 3; a++) border = border || v[a] == 0 || v[a] == b.grid.n[a] - 1;
            return border && value < width;
        });
    });
}

void vdb_parts::map_of_blocks(const sdm_blocks &b, float *values)
{
    const float width = static_cast<float>(b.band_mm);
    int64_t v[3];
    for (v[2] = 0; v[2] < b.grid.n[2]; v[2]++)
        for (v[1] = 0; v[1] < b.grid.n[1]; v[1]++)
            for (v[0] = 0; v[0] < b.grid.n[0]; v[0]++) *values++ = value_at(b, width, v);
}

void vdb_parts::check_blocks(const sdm_blocks &b, float width, sdm_error *err)
{
    crossings c = {0, 0};
    any_block(b, [&](const place &p) {
        count_block(b, p, width, c);
        return false;
    });
    need(sdm_check_crossings(c.all, c.jumps, static_cast<double>(width), err));
}

Grid::Ptr vdb_parts::grid_of_blocks(const openvdb::math::Transform::Ptr &transform,
                                    const sdm_blocks &b, float background, bool as_half)
{
    Grid::Ptr grid = empty_grid(transform, background, false, as_half);
    Grid::Accessor acc = grid->getAccessor();
    any_block(b, [&](const place &p) {
        add_leaf(acc, b, p, background, as_half);
        return false;
    });
    grid->tree().prune();
    return grid;
}
