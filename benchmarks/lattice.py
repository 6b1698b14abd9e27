"""Space lattices to measure solvers of large frames with: slender ones, as machines are, and cubes."""

from __future__ import annotations

import numpy as np

from beamstiff.fem.large.frame import Frame

STEEL = {"E": 210e9, "G": 80e9}
ROD = {"A": 1.5e-4, "Iy": 2.1e-9, "Iz": 1.6e-9, "J": 3.1e-9, "Ay": np.inf, "Az": np.inf}


def lattice(cells: tuple[int, int, int], pitch: float = 0.2) -> Frame:
    """Return a grid of beams, rigidly connected, with so many cells along x, y, z; its side x = 0 is fixed.

    Examples
    --------
    >>> frame = lattice((2, 1, 1))
    >>> frame.points.shape, frame.beams.shape, int(frame.fixed.sum())
    ((12, 3), (20, 2), 4)
    """
    counts = np.array(cells) + 1
    grid = np.indices(counts).reshape(3, -1).T
    number = np.arange(len(grid)).reshape(counts)
    pairs = []
    for axis in range(3):
        first = np.take(number, range(counts[axis] - 1), axis=axis).ravel()
        second = np.take(number, range(1, counts[axis]), axis=axis).ravel()
        pairs.append(np.stack([first, second], axis=1))
    beams = np.concatenate(pairs)
    up = np.repeat([[0.0, 0.0, 1.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]], [len(pair) for pair in pairs], axis=0)
    # as nodes come from a drawing: in no order that a solver could make use of
    return Frame(
        points=pitch * grid.astype(np.float64),
        beams=beams,
        properties={name: np.full(len(beams), value) for name, value in (STEEL | ROD).items()},
        up=up,
        fixed=grid[:, 0] == 0,
    )


def slender(dofs: float) -> Frame:
    """Return a lattice of 4 x 4 cells across, as long as it takes for so many unknowns."""
    return lattice((max(2, round(dofs / (6 * 25))), 4, 4))


def cube(dofs: float) -> Frame:
    """Return a lattice as long as it is wide and high."""
    side = max(2, round((dofs / 6) ** (1 / 3)))
    return lattice((side, side - 1, side - 1))


def tip(frame: Frame) -> int:
    """Return the node in the middle of the far side."""
    far = frame.points[:, 0].max()
    centre = np.append(far, frame.points[:, 1:].mean(axis=0))
    return int(np.argmin(((frame.points - centre) ** 2).sum(axis=1)))
