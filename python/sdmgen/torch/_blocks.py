"""The blocks of a pod network (framework/include/sdm/internal/pod.h)."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Iterator, Sequence

Triple = tuple[int, int, int]


@dataclass
class Block:
    """A box of voxels: `at` and `size` along x, y, z; its number among all blocks."""

    at: Triple
    size: Triple
    rank: int = 0
    number: int = 0
    children: list[Block] = field(default_factory=list)

    @property
    def outputs(self) -> int:
        """voxels, or coefficients of the children"""
        if self.children:
            return sum(child.rank for child in self.children)
        return self.size[0] * self.size[1] * self.size[2]


def _block(grid: Sequence[int], edge: int, index: Triple) -> Block:
    x, y, z = (i * edge for i in index)
    nx, ny, nz = (min(edge, n - a) for n, a in zip(grid, (x, y, z)))
    return Block((x, y, z), (nx, ny, nz))


def blocks_of(grid: Sequence[int], edge: int, n_levels: int, ranks: Any) -> list[list[Block]]:
    """The blocks of each level, from the lowest; the blocks of the highest level with x fastest, the
    children of a block one after another."""
    top = edge << (n_levels - 1)
    nx, ny, nz = (-(-n // top) for n in grid)
    levels = [[_block(grid, top, (x, y, z)) for z in range(nz) for y in range(ny) for x in range(nx)]]
    for level in range(n_levels - 2, -1, -1):
        width = edge << level
        for parent in levels[0]:
            x, y, z = (a // width for a in parent.at)
            places = [(x + i % 2, y + i // 2 % 2, z + i // 4) for i in range(8)]
            parent.children = [_block(grid, width, p) for p in places if all(i * width < n for i, n in zip(p, grid))]
        levels.insert(0, [child for parent in levels[0] for child in parent.children])
    for number, block in enumerate(block for level in levels for block in level):
        block.number, block.rank = number, int(ranks[number])
    return levels


def _upper(block: Block) -> Iterator[Block]:
    if block.children:
        yield block
        for child in block.children:
            yield from _upper(child)


def _leaves(block: Block) -> list[Block]:
    return [leaf for child in block.children for leaf in _leaves(child)] if block.children else [block]


def leaves_of(levels: list[list[Block]], edge: int) -> Iterator[tuple[Block, bool]]:
    """The blocks in the order of decoding, and whether they are leaves: row by row of the highest level
    along x; first the levels above the lowest, depth first, then the leaves with x fastest."""
    rows: dict[tuple[int, int], list[Block]] = {}
    for block in levels[-1]:
        rows.setdefault((block.at[2], block.at[1]), []).append(block)
    for row in rows.values():
        for block in row:
            for inner in _upper(block):
                yield inner, False
        leaves = [leaf for block in row for leaf in _leaves(block)]
        for leaf in sorted(leaves, key=lambda b: (b.at[2], b.at[1], b.at[0])):
            yield leaf, True
