"""What stands beside the machine and holds the tool: a hose, a cable or a stop.

A spring K from the tool to the floor takes a part of the load, so that with the machine's compliance C the
tool moves by ``(I + C K)^-1 C w`` instead of ``C w``: two springs side by side. To first order in K that is
``-C K C w``, which holds for weak springs only; a strong one is therefore weighed about the spring that the
gap suggests. No effect of the library has a name for them.
"""

from dataclasses import dataclass, replace

import numpy as np

from beamstiff.diagnosis.residual.baseline import (
    ROUNDING,
    Baseline,
    nominal_pose,
    predict,
    tcp_response,
    tool_response,
)
from beamstiff.diagnosis.residual.whitened import Whitened
from beamstiff.se3 import Array

AXES = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))  # of a symmetric 3x3
UNSEEN = 1e-2  # share of the largest singular value below which the gap suggests no spring
STOPS = (0.0, 0.3, 0.6)  # of the largest displacement along a direction, where a stop may begin


@dataclass(frozen=True)
class Held:
    """What holds the tool, for N rows: where it sits, and what it moves.

    `own`: (N, 3, 3) array; displacement of the TCP per force there, C.
    `seen`: (N, 6, 3) array; displacement of the row's point per force at the TCP.
    `moved`: (N, 3) array; displacement of the TCP, ``C w``.
    """

    own: Array
    seen: Array
    moved: Array


def held_tool(baseline: Baseline) -> Held:
    """Return how the tool moves, and what forces there move, whatever points are read."""
    rows, robot = baseline.rows, baseline.robot
    seen = tcp_response(baseline)
    if rows.axes is None and (rows.point == robot.tcp).all():
        return Held(seen[:, :3, :3], seen[:, :, :3], baseline.predicted[:, :3])
    tcp = np.full(len(rows), robot.tcp)
    there = replace(rows, point=tcp, direction=np.full_like(rows.direction, np.nan))
    own = tool_response(robot, replace(there, load_point=tcp))
    return Held(own[:, :3, :3], seen[:, :, :3], predict(robot, there)[:, :3])


def tethered(baseline: Baseline, held: Held, white: Whitened) -> tuple[Array, Array]:
    """Return what a spring between tool and floor does to displacements.

    `white`: its gap, which suggests how strong the spring is.
    Returns `alike`, (N, 6, 7) array; of a spring that is alike everywhere: what the suggested one does and,
    per N/m of each of its six values, what it would do more.
    Returns `placed`, (N, 6, 18) array; what it would do more if it changed with the place, as it does where
    its direction does.
    """
    about = suggested_spring(held, white)
    more = _more(held, about)
    alike = np.concatenate([more, _taken(held, about)[:, :, None]], axis=-1)
    tcp = np.full(len(baseline.rows), baseline.nominal.tcp)
    place, _ = nominal_pose(baseline.nominal, replace(baseline.rows, point=tcp))
    place = place - place.mean(axis=0)
    place /= np.abs(place).max(initial=0.0) or 1.0
    return alike, np.concatenate([more * place[:, axis, None, None] for axis in range(3)], axis=-1)


def weakly_tethered(baseline: Baseline) -> Array:
    """Return what a weak spring between tool and floor does to displacements, (N, 6, 6)."""
    return _more(held_tool(baseline), np.zeros((3, 3)))


def suggested_spring(held: Held, white: Whitened) -> Array:
    """Return the spring (3, 3) in N/m between tool and floor that fits the gap, to first order.

    Springs pull back: what would push is left out.
    """
    columns = white.project_out(white.whiten_moved(_more(held, np.zeros((3, 3)))))
    size = np.linalg.norm(columns, axis=0)
    shown = size > ROUNDING * size.max(initial=0.0)
    factor = np.zeros(len(AXES))
    if shown.any():
        gap = white.project_out(white.gap[:, None])[:, 0]
        factor[shown] = np.linalg.lstsq(columns[:, shown] / size[shown], gap, rcond=UNSEEN)[0] / size[shown]
    values, axes = np.linalg.eigh(np.tensordot(factor, _units(), axes=1))
    result: Array = (axes * np.maximum(values, 0.0)) @ axes.T
    return result


def stopped(held: Held) -> Array:
    """Return what stops beside the tool take from the displacements, (N, 6, c): to each side of each axis."""
    columns = []
    for axis in range(3):
        for side in (1.0, -1.0):
            way = np.maximum(side * held.moved[:, axis], 0.0)
            for at in STOPS:
                force = -side * np.maximum(way - at * way.max(initial=0.0), 0.0)
                columns.append(held.seen[:, :, axis] * force[:, None])
    return np.stack(columns, -1)


def _taken(held: Held, spring: Array) -> Array:
    """Return what a spring (3, 3) takes from the displacements, (N, 6): ``-C K (I + C K)^-1 C w``."""
    force = np.einsum("ij,nj->ni", spring, _beside(held, spring))
    result: Array = -np.einsum("nai,ni->na", held.seen, force)
    return result


def _more(held: Held, spring: Array) -> Array:
    """Return what a spring (3, 3) takes more, (N, 6, 6), per N/m of each of its six values."""
    back = np.linalg.inv(np.eye(3) + spring @ held.own)
    force = np.einsum("kij,nj->nik", _units(), _beside(held, spring))
    result: Array = -held.seen @ (back @ force)
    return result


def _beside(held: Held, spring: Array) -> Array:
    """Return how far the tool moves with a spring (3, 3) beside it, (N, 3): ``(I + C K)^-1 C w``."""
    both = np.eye(3) + held.own @ spring
    return np.asarray(np.linalg.solve(both, held.moved[:, :, None]), dtype=np.float64)[:, :, 0]


def _units() -> Array:
    """Return the six symmetric 3x3 matrices (6, 3, 3) of `AXES`."""
    result = np.zeros((len(AXES), 3, 3))
    for at, (i, j) in enumerate(AXES):
        result[at, i, j] = result[at, j, i] = 1.0
    return result
