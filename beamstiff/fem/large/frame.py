"""Large frames as plain arrays, and their sparse stiffness, assembled without a loop over elements."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from beamstiff.errors import BeamstiffError
from beamstiff.fem.beam_element import beam_axes, beam_stiffness
from beamstiff.fem.placed_structure import SHORTEST
from beamstiff.se3 import Array

Index = NDArray[np.int64]
BEAMS = 20_000  # at a time in extended precision


@dataclass(frozen=True, eq=False)
class Frame:
    """A frame of beams, rigidly connected at its nodes."""

    points: Array  # (N, 3), m: positions of the nodes
    beams: Index  # (B, 2): nodes of each beam
    properties: dict[str, Array]  # (B,): ``E G A Iy Iz J Ay Az``, SI, as `beam_stiffness` takes them
    up: Array  # (B, 3): local y lies in the plane of the beam and `up`; NaN for any perpendicular
    fixed: NDArray[np.bool_]  # (N,)

    @property
    def unknowns(self) -> Index:
        """Unknown of each direction of each node, (N, 6); -1 where it is fixed."""
        free = np.repeat(~self.fixed, 6)
        return np.where(free, np.cumsum(free) - 1, -1).reshape(-1, 6)


def frame_stiffness(frame: Frame) -> sparse.csc_array:
    """Return the stiffness of the free nodes, (n, n), six unknowns a node."""
    axis = frame.points[frame.beams[:, 1]] - frame.points[frame.beams[:, 0]]
    length = np.sqrt((axis * axis).sum(axis=1))
    if not (np.isfinite(length) & (length > SHORTEST)).all():
        odd = int(np.argmin(np.isfinite(length) & (length > SHORTEST)))
        raise BeamstiffError(
            f"beam {odd}: found a length of {length[odd]:.3g} m between nodes {frame.beams[odd].tolist()}, "
            "expected one greater than zero"
        )
    numbers = frame.unknowns
    count = int(numbers.max(initial=-1)) + 1
    if count == 0:
        raise BeamstiffError("all nodes of the frame are fixed, expected some that are free")
    local = beam_stiffness(length, **frame.properties).reshape(-1, 4, 3, 4, 3)
    turn = beam_axes(axis, frame.up)
    turned = np.einsum("bij,bpjqk,blk->bpiql", turn, local, turn, optimize=True).reshape(-1, 12, 12)
    if not np.isfinite(turned).all():
        odd = int(np.argmin(np.isfinite(turned).all(axis=(1, 2))))
        raise BeamstiffError(f"beam {odd}: its stiffness is not finite, expected finite positive properties")
    at = numbers[frame.beams].reshape(-1, 12)
    rows = np.broadcast_to(at[:, :, None], turned.shape)
    columns = np.broadcast_to(at[:, None, :], turned.shape)
    kept = (rows >= 0) & (columns >= 0) & (turned != 0.0)
    entries = (turned[kept], (rows[kept].astype(np.int32), columns[kept].astype(np.int32)))
    return sparse.coo_array(entries, shape=(count, count)).tocsc()


def nodal_forces(frame: Frame, displacement: NDArray[Any]) -> NDArray[Any]:
    """Return the wrenches (N, 6, c) that hold the nodes of a frame in given displacements (N, 6, c).

    From the deformation of each beam, second end against the first carried along. Differences and sums are in
    extended precision, so that a motion of the whole strains nothing and each beam is in equilibrium; what is
    rounded is as a stiffness that differs in its last digit. The sums of an assembled matrix lose what the
    condition of the frame takes.
    """
    exact = np.longdouble
    result = np.zeros(displacement.shape, dtype=exact)
    for start in range(0, len(frame.beams), BEAMS):
        some = slice(start, start + BEAMS)
        a, b = frame.beams[some].T
        arm = frame.points[b].astype(exact) - frame.points[a].astype(exact)
        axis = arm.astype(np.float64)
        properties = {name: value[some] for name, value in frame.properties.items()}
        local = beam_stiffness(np.sqrt((axis * axis).sum(axis=1)), **properties)[:, 6:, 6:]
        turn = beam_axes(axis, frame.up[some])[:, None]
        near = displacement[a].astype(exact)
        moved = displacement[b].astype(exact) - near
        moved[:, :3] -= _cross(near[:, 3:], arm)
        strain = turn.swapaxes(-1, -2) @ moved.astype(np.float64).reshape(len(a), 2, 3, -1)
        force = (turn @ (local @ strain.reshape(moved.shape)).reshape(strain.shape)).reshape(moved.shape)
        ends = np.concatenate([-force, force]).astype(exact)
        ends[: len(a), 3:] += _cross(force[:, :3].astype(exact), arm)
        nodes = np.concatenate([a, b])
        order = np.argsort(nodes, kind="stable")
        met, starts = np.unique(nodes[order], return_index=True)
        result[met] += np.add.reduceat(ends[order], starts, axis=0)
    return result


def _cross(vectors: NDArray[Any], arm: NDArray[Any]) -> NDArray[Any]:
    """Return the cross product of vectors (B, 3, c) and arms (B, 3)."""
    (x, y, z), (u, v, w) = vectors.swapaxes(0, 1), arm.T[:, :, None]
    return np.stack([y * w - z * v, z * u - x * w, x * v - y * u], axis=1)
