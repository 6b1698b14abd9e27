"""How much the load itself changes the stiffness: influence of K_C on displacements (seed 000, sec. 3.2).

With dp and dr the translation and rotation of the tool under a wrench, with and without K_C::

    nu_p = | |dp_with| - |dp_without| | / max(|dp_with|, |dp_without|)          (eq. 14)
    nu_r = max over x, y, z of |dr_with - dr_without|                           (eq. 15)

Where both are small, joint stiffness may be identified without K_C.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from beamstiff.errors import BeamstiffError
from beamstiff.fem.condensation import tcp_compliance
from beamstiff.fem.geometric_stiffness import loaded_compliance
from beamstiff.fem.static_response import nodal_loads
from beamstiff.fem.structure import Structure
from beamstiff.planning.dexterity import inverse_condition, normalised_jacobian
from beamstiff.planning.poses import Grid, closed_posture, joint_grid, spread
from beamstiff.robot.kinematics import Posture, actuated_values, posture
from beamstiff.se3 import Array


@dataclass(frozen=True, eq=False)
class Influence:
    """What K_C does to the displacement of the TCP under a wrench, at poses of any shape (...)."""

    nu_p: Array  # (...): relative change of the translation; NaN where loops do not close
    nu_r: Array  # (...), rad: largest change of a rotation component
    displacement: Array  # (..., 6), m and rad: with K_C

    def within(self, nu_p: float, nu_r: float) -> np.ndarray:
        """Return where both are at most the given ones: Znu_p and Znu_r of seed 000, (...) bool."""
        with np.errstate(invalid="ignore"):  # NaN is nowhere within
            inside: np.ndarray = (self.nu_p <= nu_p) & (self.nu_r <= nu_r)
        return inside


def load_influence(structure: Structure, posture: Posture, wrench: ArrayLike) -> Influence:
    """Return the influence of K_C at every pose, for any robot.

    `posture`: P poses. `wrench` (6,), N and N m: ``[f, m]`` at the TCP, base frame: the load that stiffens or
    softens, and that displaces.
    """
    poses = posture.node_positions.shape[0]
    load = np.broadcast_to(_wrench(wrench, poses), (poses, 6))
    loads = nodal_loads(structure, poses, {structure.robot.tcp: load})
    with_k_c = (loaded_compliance(structure, posture, loads) @ load[..., None])[..., 0]
    without = (tcp_compliance(structure, posture) @ load[..., None])[..., 0]
    lengths = np.linalg.norm([with_k_c[:, :3], without[:, :3]], axis=-1)
    larger = lengths.max(axis=0)
    nu_p = np.abs(lengths[0] - lengths[1]) / np.where(larger > 0, larger, 1.0)
    nu_r = np.abs(with_k_c[:, 3:] - without[:, 3:]).max(axis=1)
    return Influence(nu_p, nu_r, with_k_c)


def influence_map(structure: Structure, grid: Grid, wrench: ArrayLike) -> Influence:
    """Return the influence of K_C over a grid, arrays (n, m) (seed 000, Figure 4)."""
    closed_poses, closed = closed_posture(structure.kinematics, grid.q)
    if not closed.any():
        raise BeamstiffError(f"robot {structure.robot.name!r}: no pose of the grid closes its loops")
    load = _wrench(wrench, closed.size)
    found = load_influence(structure, closed_poses, load if load.ndim == 1 else load[closed])
    return Influence(
        spread(closed, found.nu_p).reshape(grid.shape),
        spread(closed, found.nu_r).reshape(grid.shape),
        spread(closed, found.displacement).reshape(*grid.shape, 6),
    )


@dataclass(frozen=True, eq=False)
class WristChoice:
    """Values of two more variables, chosen for the smallest influence of K_C over poses already chosen."""

    grid: Grid  # over the two variables
    # nu_p, nu_r: (n, m): the worst over the poses; NaN where a loop does not close
    nu_p: Array
    nu_r: Array
    inverse_condition: Array  # (n, m): the worst 1/kappa_F over the poses
    best: dict[str, float]  # rad or m


def choose_wrist(
    structure: Structure,
    poses: ArrayLike,
    wrench: ArrayLike,
    over: Mapping[str, ArrayLike],
    length: float,
    least: float,
) -> WristChoice:
    """Return values of two variables (theta4 and theta5 in seed 000) for which K_C matters least.

    Least is the smallest ``max(nu_p / P, nu_r / R)``, P and R the medians over the values tried; values at
    which a pose falls below the least dexterity are left out.

    `poses` (P, A), rad or m: chosen for their dexterity; the two variables' values in them do not count.
    `wrench` (6,), N and N m. `over`: values of two variables, rad or m. `length`, m: characteristic length.
    `least`: 1/kappa_F that every pose has to keep.
    """
    kinematics, robot = structure.kinematics, structure.robot
    chosen = actuated_values(robot, np.asarray(poses))
    grid = joint_grid(robot, over)
    columns = [[variable.name for variable in robot.actuated].index(name) for name in grid.names]
    q = np.repeat(chosen, len(grid.q), axis=0)
    q[:, columns] = np.tile(grid.q[:, columns], (len(chosen), 1))
    at = posture(kinematics, q)
    worst = (len(chosen), *grid.shape)
    dexterity = inverse_condition(normalised_jacobian(kinematics, at, length)).reshape(worst).min(axis=0)
    found = load_influence(structure, at, _wrench(wrench, 1))
    nu_p, nu_r = found.nu_p.reshape(worst).max(axis=0), found.nu_r.reshape(worst).max(axis=0)
    if not (dexterity >= least).any():
        raise BeamstiffError(
            f"robot {robot.name!r}: no values of {' and '.join(grid.names)} keep 1/kappa_F at {least:g} in "
            f"all {len(chosen)} poses; the best keep {dexterity.max():.3g}"
        )
    medians = [max(float(np.median(nu)), np.finfo(float).tiny) for nu in (nu_p, nu_r)]
    merit = np.where(dexterity >= least, np.maximum(nu_p / medians[0], nu_r / medians[1]), np.inf)
    i, j = np.unravel_index(np.argmin(merit), grid.shape)
    best = {grid.names[0]: float(grid.first[i]), grid.names[1]: float(grid.second[j])}
    return WristChoice(grid, nu_p, nu_r, dexterity, best)


def _wrench(wrench: ArrayLike, poses: int) -> Array:
    load = np.asarray(wrench, dtype=np.float64)
    if load.shape not in ((6,), (poses, 6)) or not np.isfinite(load).all():
        raise BeamstiffError(
            f"wrench: found {np.asarray(wrench).tolist()!s:.60}, expected six numbers fx fy fz mx my mz"
        )
    if not load.any():
        raise BeamstiffError("wrench: found zeros only, expected a load")
    return load
