"""Whether the loads of absolute readings can be those that acted, by what is left with the geometry fitted.

Loads of one posture are held against one another before (`measure.load_plausibility`). Where every posture
has one load, only the machine's own weight is left to hold them against: a drive turns by its compliance
times ``W + F``, the torque of the weight and that of the load. A load read with the wrong sign, or in kg
for N, asks for other compliances than the weight does, and leaves what no drive can make up for. The right
reading leaves a thirtieth of that on a simulated robot; of right ones, on 22 machines with several effects,
no other reading left less than 0.97.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from beamstiff.diagnosis.decomposition.open_model import OpenModel
from beamstiff.measure.misread_columns import FORCES, KILO, NEARER, SAME, turns
from beamstiff.measure.position_plausibility import axes_in_words
from beamstiff.model.ports import reduce_to_ports
from beamstiff.se3 import Array

GRAVITY = 9.80665  # N on a kg
SHOWS = 3.0  # times the noise, RMS: what is left below that may be anything


def misread_loads(model: OpenModel) -> str:
    """Return, in words, how the loads were meant, where that leaves half of what they leave; or empty."""
    rows, problem = model.baseline.rows, model.problem
    if problem is None or not model.present.size or not rows.wrench[:, :3].any():
        return ""
    basis, forces = model.open_basis, rows.wrench[:, :3]
    residual = model.residual + model.drives @ model.present
    residual = residual - basis @ (basis.T @ residual)
    stiffness = problem.elastic.stiffness(model.present)

    def moved_by(forces: Array) -> Array:
        """Return what drives of unit compliance move under the weight and forces, (N, 6, d)."""
        loads = replace(rows, wrench=np.hstack([forces, rows.wrench[:, 3:]]))
        ports = reduce_to_ports(model.baseline.robot, loads, problem.elastic.names, gravity=True)
        return ports.derivatives(stiffness, by="compliance")[1]

    size = float(np.abs(forces).max())
    by_weight = moved_by(np.zeros_like(forces))
    by_force = [moved_by(np.tile(one, (len(rows), 1))) - by_weight for one in size * np.eye(3)]

    def left(forces: Array) -> float:
        """Return what the best drives leave under these forces (N, 3), RMS, times the noise."""
        shares = (forces / size).T[..., None, None]
        by_load = sum(share * one for share, one in zip(shares, by_force, strict=True))
        return model.left_by_drives(model.beside_geometry(by_weight + by_load), residual)

    stated = left(forces)
    if stated < SHOWS:
        return ""
    others = {how: left(other) for how, other in _readings(forces)}
    least = SAME * min(others.values(), default=np.inf)
    best = next((how for how, value in others.items() if value <= least), "")
    if not best or others[best] > NEARER * stated:
        return ""
    return (
        f"{rows.source}: the positions fit loads with {best}, which leave {stated / others[best]:.2g} times "
        "less than those that the table states: correct the columns (forces on the tool, base axes, N)"
    )


def _readings(forces: Array) -> Iterator[tuple[str, Array]]:
    """Yield other ways to read forces (N, 3), in words, the fewest changes first, and each once."""
    other = [(axes_in_words(turn, FORCES), forces @ turn.T) for turn in turns()]
    other += [("fx fy fz in kg, and read in N", GRAVITY * forces)]
    other += [("fx fy fz in kg and reversed, and read in N", -GRAVITY * forces)]
    other += [("fx fy fz in kN, and read in N", KILO * forces)]
    seen = [forces]
    for how, some in other:
        if not any(np.allclose(some, one) for one in seen):
            seen.append(some)
            yield how, some
