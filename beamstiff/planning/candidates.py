"""Tests that could be made: poses within reach, loads on the tool, and what each would tell."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from beamstiff.errors import BeamstiffError, listed
from beamstiff.fem.condensation import tcp_compliance
from beamstiff.fem.structure import compile_structure
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.model.ports import reduce_to_ports
from beamstiff.planning.obstacles import clear
from beamstiff.planning.poses import closed_posture, random_poses
from beamstiff.robot.description import Robot
from beamstiff.robot.fields import FREE, RIGID
from beamstiff.robot.kinematics import Kinematics, actuated_values, posture
from beamstiff.robot.stiffness_parameters import stiffness_parameters
from beamstiff.se3 import Array

AXES = ("x", "y", "z")
ANYWHERE = 3 * ((-np.inf, np.inf),)  # a region: within the joint limits alone
# a direction of the parameters that all candidates together show less than this, against the others, is none
SINGULAR = 1e-12


@dataclass(frozen=True)
class Noise:
    """Standard deviations of what a test reads; all independent."""

    position: float  # m: of each component of the measured displacement
    # rad: of each component of the measured rotation; None where it is not measured
    rotation: float | None = None
    # force, moment: N and N m: of each component of the wrench: they displace the tool unseen
    force: float = 0.0
    moment: float = 0.0
    gauges: tuple[str, ...] = ()  # axes of the base that dial gauges read along: x, -z; none: a tracker reads

    def __post_init__(self) -> None:
        """Refuse what is no standard deviation."""
        for name, value, least in (
            ("position", self.position, 0.0),
            ("rotation", self.rotation, 0.0),
            ("force", self.force, -1.0),
            ("moment", self.moment, -1.0),
        ):
            if value is not None and not (np.isfinite(value) and value > least):
                raise BeamstiffError(f"noise: found {name} = {value}, expected a positive standard deviation")
        if self.force < 0 or self.moment < 0:
            raise BeamstiffError(
                "noise: found a negative standard deviation of the wrench, expected 0 or more"
            )


def candidate_poses(
    kinematics: Kinematics, count: int, seed: int, region: Sequence[tuple[float, float]] | None = None
) -> Array:
    """Return random poses in reach, (count, A): joint limits, loops closed, TCP in a region, no obstacle met.

    Parameters
    ----------
    kinematics : Kinematics
    count : int
    seed : int
    region : three pairs, m, optional
        Least and largest x, y and z of the TCP: what the tracker sees, above the floor.

    Raises
    ------
    BeamstiffError
        When hardly any pose gets there.
    """
    random = np.random.default_rng(seed)
    robot = kinematics.robot
    if region is None and not robot.obstacles:
        return random_poses(kinematics, count, random)
    box = np.asarray(ANYWHERE if region is None else region, dtype=np.float64).reshape(3, 2)
    tcp = kinematics.node_index[robot.tcp]
    found = np.zeros((0, len(robot.actuated)))
    for _ in range(50):
        drawn = random_poses(kinematics, max(2 * count, 64), random)
        positions = closed_posture(kinematics, drawn)[0].node_positions
        reached = inside(box, positions[:, tcp])
        found = np.concatenate([found, drawn[reached & clear(kinematics, positions)]])
        if len(found) >= count:
            return found[:count]
    wanted = [] if region is None else [f"have their TCP in the region {_shown(box)}"]
    wanted += ["keep clear of its obstacles"] if robot.obstacles else []
    more = "leave it more room" if region is None else "make it larger, or move it to where the robot reaches"
    raise BeamstiffError(
        f"robot {robot.name!r}: only {len(found)} of {count} random poses {' and '.join(wanted)}; {more}"
    )


def inside(region: Array | Sequence[tuple[float, float]], positions: Array) -> NDArray[np.bool_]:
    """Return which positions (n, 3) lie in a region, (n,)."""
    low, high = np.asarray(region, dtype=np.float64).T
    return np.asarray(((positions >= low) & (positions <= high)).all(axis=1))


def _shown(region: Array) -> str:
    sides = zip("xyz", region.tolist(), strict=True)
    return ", ".join(f"{axis} from {a:g} to {b:g} m" for axis, (a, b) in sides if np.isfinite([a, b]).any())


def force_loads(magnitude: float, directions: Sequence[str] = ("x", "y", "z")) -> Array:
    """Return forces along axes of the base frame as wrenches (L, 6), N: ``"-z"`` points down."""
    loads = np.zeros((len(directions), 6))
    for row, direction in zip(loads, directions, strict=True):
        axis = direction.removeprefix("-").removeprefix("+")
        if axis not in AXES:
            raise BeamstiffError(
                f"direction of a load: found {direction!r}, expected x, y or z, with a sign or not"
            )
        row[AXES.index(axis)] = -magnitude if direction.startswith("-") else magnitude
    return loads


def candidate_tests(
    robot: Robot,
    poses: ArrayLike,
    loads: ArrayLike,
    largest_force: float = np.inf,
    largest_moment: float = np.inf,
) -> Measurements:
    """Return every load at every pose as a table of tests not yet measured.

    Parameters
    ----------
    robot : Robot
    poses : (P, A) array, rad or m
    loads : (L, 6) array, N and N m
        Wrenches at the TCP, base frame.
    largest_force, largest_moment : float, N and N m
        What the machine may carry.

    Returns
    -------
    Measurements
        P * L rows, the load running fastest, without displacements.

    Raises
    ------
    BeamstiffError
        When there is no pose or load, a load is zero or too large.
    """
    q = actuated_values(robot, np.asarray(poses))
    wrenches = np.asarray(loads, dtype=np.float64).reshape(-1, 6)
    if not len(q) or not len(wrenches):
        raise BeamstiffError(f"found {len(q)} poses and {len(wrenches)} loads, expected at least one of each")
    if not np.isfinite(wrenches).all() or not wrenches.any(axis=1).all():
        raise BeamstiffError("loads: found a load of zero or no number, expected forces and moments")
    for name, part, limit in (
        ("force", wrenches[:, :3], largest_force),
        ("moment", wrenches[:, 3:], largest_moment),
    ):
        sizes = np.linalg.norm(part, axis=1)
        if (sizes > limit * (1 + 1e-12)).any():
            raise BeamstiffError(
                f"loads: found a {name} of {sizes.max():.6g}, more than the {limit:.6g} allowed"
            )
    return make_measurements(
        [variable.name for variable in robot.actuated],
        np.repeat(q, len(wrenches), axis=0),
        tcp=robot.tcp,
        wrench=np.tile(wrenches, (len(q), 1)),
        pose=np.repeat(np.arange(len(q)), len(wrenches)),
        source="<plan>",
    )


def information(
    robot: Robot, tests: Measurements, noise: Noise, parameters: Sequence[str] | None = None
) -> tuple[tuple[str, ...], Array]:
    """Return what each test tells about the logarithms of the parameters.

    The Fisher information ``S^T W S`` of a row, S the sensitivity at the robot's present stiffness and W the
    inverse covariance of what is read there, load errors included: ``sigma^2 I + C cov(w) C^T``.

    `tests`: N rows, as from `candidate_tests`. `parameters`: stiffness values to find; default
    ``robot.identify``. Returns the names (m) and the information (N, m, m).
    """
    names, found, idle = _information(robot, tests, noise, parameters)
    problem = _undetermined(names, found.sum(axis=0), idle)
    if problem is not None:
        raise BeamstiffError(problem[0])
    return names, found


def identifiable(
    robot: Robot, tests: Measurements, noise: Noise, parameters: Sequence[str] | None = None
) -> tuple[tuple[str, ...], Array, dict[str, str]]:
    """Return what `information` does, of the parameters that the tests determine, and why not of the others.

    Of parameters that act only together, all but the first count as known.

    Returns the names (m), the information (N, m, m), and the parameters that these tests cannot determine,
    each with the reason.
    """
    names, found, idle = _information(robot, tests, noise, parameters)
    left_out: dict[str, str] = {}
    while (problem := _undetermined(names, found.sum(axis=0), idle)) is not None:
        message, why = problem
        keep = [at for at, name in enumerate(names) if name not in why]
        if not keep:
            raise BeamstiffError(message)
        left_out |= why
        names, idle = tuple(names[at] for at in keep), idle[keep]
        found = found[:, keep][:, :, keep]
    return names, found, left_out


def _information(
    robot: Robot, tests: Measurements, noise: Noise, parameters: Sequence[str] | None
) -> tuple[tuple[str, ...], Array, NDArray[np.bool_]]:
    """Return names, information and which of the parameters no test loads."""
    known = stiffness_parameters(robot)
    for name in parameters if parameters is not None else robot.identify:
        if known.get(name, 1.0) in (RIGID, FREE):
            raise BeamstiffError(
                f"{name} is {'rigid' if known[name] == RIGID else 'free'} in robot {robot.name!r}: a plan to "
                "find it needs a value to expect"
            )
    model = reduce_to_ports(robot, tests, parameters)
    sensitivity = model.derivatives(model.start)[1] * model.start
    read = _read_by(noise)
    sigma = np.array([noise.position] * 3 + [noise.rotation or 1.0] * 3)
    covariance = np.broadcast_to(np.diag(sigma**2), (len(sensitivity), 6, 6))
    if noise.force or noise.moment:
        structure = compile_structure(robot)
        poses, pose = np.unique(tests.q, axis=0, return_inverse=True)
        compliance = tcp_compliance(structure, posture(structure.kinematics, poses))[pose.reshape(-1)]
        of_wrench = np.array([noise.force**2] * 3 + [noise.moment**2] * 3)
        covariance = covariance + compliance * of_wrench @ compliance
    root = np.linalg.cholesky(read @ covariance @ read.T)
    whitened = np.linalg.solve(root, read @ sensitivity)
    found: Array = whitened.swapaxes(-1, -2) @ whitened
    return model.parameters, found, np.logical_not(sensitivity.any(axis=(0, 1)))


def _read_by(noise: Noise) -> Array:
    """Return what is read of the six components of a displacement, (k, 6)."""
    if noise.gauges:
        return force_loads(1.0, noise.gauges)
    return np.eye(6)[: 3 if noise.rotation is None else 6]


def _undetermined(
    names: Sequence[str], total: Array, idle: NDArray[np.bool_]
) -> tuple[str, dict[str, str]] | None:
    """Return what all tests together leave undetermined: a message, and the parameters to leave out."""
    if idle.any():
        never = [name for name, unloaded in zip(names, idle, strict=True) if unloaded]
        return (
            f"{never[0]} is never loaded by these tests: its stiffness cannot be found from them",
            dict.fromkeys(never, "is never loaded by these tests"),
        )
    shown = np.diagonal(total)
    unseen = [name for name, value in zip(names, shown, strict=True) if value <= SINGULAR * shown.max()]
    if unseen:
        return (
            f"{unseen[0]} moves next to nothing that these tests measure: measure rotations, load it more, "
            "or leave it out",
            dict.fromkeys(unseen, "moves next to nothing that these tests measure"),
        )
    scale = 1 / np.sqrt(shown)
    values, vectors = np.linalg.eigh(scale[:, None] * total * scale)
    if values[0] >= SINGULAR * values[-1]:
        return None
    part = np.abs(vectors[:, 0])
    group = [name for name, share in zip(names, part, strict=True) if share > 0.05 * part.max()]
    return (
        f"the parameters {listed(group)} act only together in all these tests: load other directions, "
        "measure rotations, or find fewer of them",
        {group[-1]: f"acts only together with {listed(group[:-1])}"},
    )
