"""Where cells stand in batches, batches in parts, and the copies of nodes that parts add to.

Pure index work: the number of parts depends on the mesh alone, so that the order of all sums, and
with it every bit, does too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.int32]

LANES = 8
"""Cells of a batch on the CPU: LLVM fills its vectors, and 16 gain nothing.  Taichi 1.7 takes the
processor's name from LLVM 15: one newer than that (AMD's Zen 5) it knows nothing of, and vectors
then hold 4 numbers; 8 lanes are best there, too.
"""
BATCHES_A_PART = 64
MOST_PARTS = 64
"""Parts of a body at the most; each thread has several, and a node seldom more than two copies."""


def lanes_of(on_cpu: bool) -> int:
    """Cells of a batch."""
    return LANES if on_cpu else 1


def parts_in(batches: int, lanes: int) -> int:
    """Parts that a body's batches are cut into: an even number, so that two threads share well."""
    if lanes == 1:
        return batches
    parts = min(MOST_PARTS, round(batches / BATCHES_A_PART))
    return parts + parts % 2 if parts > 1 else 1


@dataclass
class Batches:
    """The cells of one block, in batches."""

    cells: Ints
    """Nodes of the corners, shape (batches, corners, lanes)."""
    owner: Ints
    """Number of the material of each batch, shape (batches,)."""
    part_start: Ints
    """First batch of each part, and where the last ends, shape (parts + 1,)."""
    place: list[NDArray[np.int64]]
    """Batch · lanes + lane of each cell, by body."""
    lanes: int

    @property
    def parts(self) -> int:
        """How many there are."""
        return len(self.part_start) - 1

    @property
    def part(self) -> NDArray[np.int64]:
        """Part of each batch."""
        return np.repeat(np.arange(self.parts), np.diff(self.part_start))

    def filled(self, values: Sequence[NDArray[np.floating]]) -> NDArray[np.float64]:
        """Numbers of each body's cells, shape (cells, k), in the places of their cells:
        (batches, k, lanes), 0 where no cell stands.
        """
        width = values[0].shape[1]
        out = np.zeros((len(self.owner) * self.lanes, width))
        for place, rows in zip(self.place, values, strict=True):
            out[place] = rows
        return np.ascontiguousarray(out.reshape(-1, self.lanes, width).transpose(0, 2, 1))


def in_batches(bodies: list[NDArray[np.integer]], lanes: int) -> Batches:
    """Cells of some bodies, shape (cells, corners) each, in batches that bodies do not share."""
    cells, owner, starts, place = [], [], [0], []
    begun = 0
    for number, own in enumerate(bodies):
        count = -(-len(own) // lanes)
        filled = np.zeros((count * lanes, own.shape[1]), np.int32)
        if len(own):
            filled[:] = own[-1]
        filled[: len(own)] = own
        cells.append(filled)
        owner.append(np.full(count, number, np.int32))
        parts = parts_in(count, lanes)
        starts += [begun + count * (k + 1) // parts for k in range(parts)]
        place.append(np.arange(len(own)) + begun * lanes)
        begun += count
    corners = bodies[0].shape[1]
    shaped = np.concatenate(cells).reshape(begun, lanes, corners).transpose(0, 2, 1)
    return Batches(
        np.ascontiguousarray(shaped, np.int32),
        np.concatenate(owner),
        np.array(starts, np.int32),
        place,
        lanes,
    )


def copies_of(blocks: list[Batches], nodes: int) -> tuple[list[Ints], Ints]:
    """A copy for each node and part that holds it, sorted by node, then by part.

    Returns the copy of each corner, in the shape of each block's `cells`, and where each node's
    copies begin, shape (nodes + 1,).
    """
    total = max(1, sum(block.parts for block in blocks))
    keys, first = [np.empty(0, np.int64)], 0
    for block in blocks:
        part = (block.part + first)[:, None, None]
        keys.append((block.cells.astype(np.int64) * total + part).ravel())
        first += block.parts
    known, index = np.unique(np.concatenate(keys), return_inverse=True)
    starts = np.searchsorted(known // total, np.arange(nodes + 1)).astype(np.int32)
    places, begun = [], 0
    for block in blocks:
        size = block.cells.size
        places.append(index[begun : begun + size].reshape(block.cells.shape).astype(np.int32))
        begun += size
    return places, starts
