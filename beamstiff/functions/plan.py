"""`plan`: which poses and loads to measure, to find the stiffness as well as possible."""

import os
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike

from beamstiff.diagnosis.notes import chosen_for
from beamstiff.diagnosis.residual.baseline import fitted_names
from beamstiff.errors import BeamstiffError, OptionError, listed, shown, suggest
from beamstiff.files import write_whole
from beamstiff.functions.checks import axes_of, names_of, one_of, whole
from beamstiff.functions.robots import as_robot
from beamstiff.planning.campaign import Plan, by_pose, plan_csv, plan_of
from beamstiff.planning.candidates import Noise, candidate_poses, candidate_tests, force_loads, identifiable
from beamstiff.planning.designs import (
    CRITERIA,
    AtRandom,
    Criterion,
    Enough,
    choose_tests,
    how_many,
    random_designs,
)
from beamstiff.planning.moving import driven, sooner_driven
from beamstiff.robot.description import Robot
from beamstiff.robot.kinematics import compile_kinematics
from beamstiff.robot.plausibility import robot_doubts
from beamstiff.robot.reader import RobotLike
from beamstiff.robot.stiffness_parameters import check_stiffness, parameter_unit
from beamstiff.se3 import Array
from beamstiff.shown import Shown
from beamstiff.units import quantity

MOST_TESTS, MOST_CANDIDATES = 500, 10_000
TESTS = 20  # to make if nothing else is said
GROWING = (0.5, 1, 2, 4)  # sizes that are looked at, to say how many tests are enough


@dataclass(frozen=True, eq=False, repr=False)
class MeasurementPlan(Shown):
    """Tests to make, and what is expected of them."""

    robot: Robot
    campaign: Plan  # the tests, and the standard errors that they should give
    candidates: int  # how many tests, or poses, there were to choose from
    at_random: AtRandom  # random choices of as many
    enough: Enough  # choices of growing size
    left_out: dict[str, str]  # parameters that cannot be found, and why not
    unit: str  # what was chosen: a "test", or a "pose" with all loads
    seed: int
    # s: for moving, of the most telling tests and of those chosen; None where no speed is known
    moving: tuple[float, float] | None = None
    notes: tuple[str, ...] = ()  # what in the robot is hardly meant, and what was chosen for it

    def to_csv(self) -> str:
        """Return the tests as the text of a CSV table to fill in."""
        return plan_csv(self.campaign, self.robot)

    def write(self, path: str | os.PathLike[str]) -> None:
        """Write the tests as a CSV table to fill in."""
        write_whole(os.fspath(path), self.to_csv())

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON, SI."""
        design, tests, drawn = self.campaign.design, self.campaign.tests, self.at_random
        median = float(np.median(drawn.worst))
        moving = {"moving_s": dict(zip(("most_telling", "chosen"), self.moving or (), strict=False))}
        states = zip(tests.pose.tolist(), tests.q.tolist(), tests.wrench.tolist(), strict=True)
        return {
            "parameters": {
                name: {
                    "value": self.robot.parameter(name),
                    "std": error * self.robot.parameter(name),
                    "relative_std": error,
                    "unit": parameter_unit(self.robot, name),
                }
                for name, error in design.standard_errors.items()
            },
            "left_out": self.left_out,
            "criterion": design.criterion,
            "value": design.value,
            "efficiency": design.efficiency,
            "random": {
                "designs": drawn.worst.size,
                "median_value": float(np.median(drawn.values)),
                "median_worst": median if np.isfinite(median) else None,
            },
            "enough": {
                "counts": self.enough.counts.tolist(),
                "worst": self.enough.worst.tolist(),
                "knee": self.enough.knee,
            },
            "seed": self.seed,
            "tests": [
                {"pose": pose, "q": dict(zip(tests.variables, q, strict=True)), "wrench": wrench}
                for pose, q, wrench in states
            ],
        } | (moving if self.moving is not None else {})


def plan(
    robot: RobotLike,
    parameters: Sequence[str] | None = None,
    *,
    tests: int | None = None,
    poses: int | None = None,
    force: float | str = 1000.0,
    moment: float | str = 0.0,
    directions: Sequence[str] = ("x", "y", "z"),
    loads: ArrayLike | None = None,
    criterion: str = "D",
    sigma_position: float | str = 3e-5,
    sigma_rotation: float | str | None = None,
    gauges: Sequence[str] = (),
    region: Sequence[tuple[float, float]] | None = None,
    candidates: int = 300,
    seed: int = 0,
    speed: Sequence[str] | None = None,
) -> MeasurementPlan:
    """Plan which poses and loads to measure, to find the stiffness as well as possible.

    Parameters
    ----------
    robot : Robot, path, or name of a bundled robot
        Its stiffness values are what is expected.
    parameters : sequence of str, optional
        Stiffness values to find; default ``robot.identify``, or where that is empty the drives.
    tests : int, optional
        Tests (rows) to make; default 20.
    poses : int, optional
        Poses instead of tests: each takes all loads.
    force, moment : float or str, N and N m
        Of each load along and about a direction; 0 for none. A text carries its unit (``"2 kN"``).
    directions : sequence of str
        Of these loads, base frame: ``"x"``, ``"-z"``.
    loads : (L, 6) array, optional, N and N m
        Wrenches at the TCP instead of `force` and `moment`.
    criterion : "D", "A" or "E"
        What to make small: volume, mean or worst of the errors.
    sigma_position, sigma_rotation : float or str, m and rad
        Noise of a measured displacement and rotation; no rotation is measured by default.
    gauges : sequence of str
        Directions, base frame, along which dial gauges read, such as ``"z"``; default: a tracker reads all.
    region : three pairs, m, optional
        Least and largest x, y, z of the TCP.
    candidates : int
        Random poses to choose from.
    seed : int
        Of these poses.
    speed : sequence of str, optional
        Of the joints, such as ``"30 deg/s"`` for all that turn and ``"q1=60deg/s"`` for one; default those of
        the robot, where it has them for all. Of tests that tell within 2 % as much as the best, those are
        chosen that take the least time for moving.

    Returns
    -------
    MeasurementPlan

    Raises
    ------
    BeamstiffError
        When there is nothing to choose from, or the tests cannot determine the parameters.

    Examples
    --------
    >>> found = plan("ir663", tests=12, candidates=30)
    >>> len(found.campaign.tests), found.to_dict()["criterion"]
    (12, 'D')
    """
    machine = as_robot(robot)
    check_stiffness(machine)
    if tests is not None and poses is not None:
        raise OptionError("tests", "found beside --poses (poses=...), expected one of them")
    count = poses if poses is not None else TESTS if tests is None else tests
    whole("tests" if poses is None else "poses", count, 1, MOST_TESTS)
    whole("candidates", candidates, 1, MOST_CANDIDATES)
    whole("seed", seed, 0)
    by = str(criterion).upper()
    if by not in CRITERIA:
        one_of("criterion", criterion, CRITERIA)
    noise = _noise(sigma_position, sigma_rotation, axes_of("gauges", gauges))
    wrenches = _loads(force, moment, directions) if loads is None else np.asarray(loads, dtype=np.float64)
    names, fastest = names_of("parameters", parameters), _speed(machine, speed)
    notes = [*robot_doubts(machine)]
    if names is None and not machine.identify:
        names = list(fitted_names(machine))
        notes += chosen_for(machine)
    drawn = candidate_poses(compile_kinematics(machine), candidates, seed, region)
    possible = candidate_tests(machine, drawn, wrenches)
    found, tells, left_out = identifiable(machine, possible, noise, names)
    if poses is not None:
        tells = by_pose(possible, tells)
    kind = cast("Criterion", by)
    best = choose_tests(tells, count, found, kind)
    campaign = plan_of(possible, best, noise, poses is not None, 1.0 if fastest is None else fastest)
    moving = None
    if fastest is not None:
        chosen = sooner_driven(best, tells, possible.q[:: len(possible) // len(tells)], fastest)
        sooner = plan_of(possible, chosen, noise, poses is not None, fastest)
        moving = driven(campaign.tests.q, fastest), driven(sooner.tests.q, fastest)
        campaign = sooner if moving[1] < moving[0] else campaign
        moving = moving[0], min(moving)
    sizes = sorted({min(max(len(found), round(count * share)), len(tells)) for share in GROWING})
    return MeasurementPlan(
        robot=machine,
        campaign=campaign,
        candidates=len(tells),
        at_random=random_designs(tells, count, kind, seed=seed),
        enough=how_many(tells, found, sizes, kind),
        left_out=left_out,
        unit="test" if poses is None else "pose",
        seed=seed,
        moving=moving,
        notes=tuple(notes),
    )


def _speed(robot: Robot, speed: Sequence[str] | None) -> Array | None:
    """Return the speeds of the joints (A,), rad/s or m/s, the robot's own if none is given; None: unknown."""
    result = np.array([one.speed or np.nan for one in robot.actuated])
    if speed is None and np.isnan(result).any():
        return None
    names = [variable.name for variable in robot.actuated]
    for text in sorted(names_of("speed", speed) or (), key=lambda text: "=" in text):
        name, named, value = (part.strip() for part in text.rpartition("="))
        if named and name not in names:
            raise OptionError("speed", f"there is no joint {name!r}{suggest(name, names)}")
        fits = dict[int, float]()
        for at, variable in enumerate(robot.actuated):
            if not named or variable.name == name:
                with suppress(BeamstiffError):
                    fits[at] = quantity(value, "speed" if variable.kind == "length" else "angular speed")
        if not fits or min(fits.values()) <= 0:
            raise OptionError("speed", f"found {shown(text)}, expected a speed such as 30deg/s or q1=0.2m/s")
        result[list(fits)] = list(fits.values())
    if np.isnan(result).any():
        lack = [name for name, value in zip(names, result, strict=True) if np.isnan(value)]
        raise OptionError("speed", f"found none of {listed(lack)}, expected one for each joint")
    return result


def _size(name: str, value: float | str, kind: str) -> float:
    try:
        return quantity(value, kind)
    except BeamstiffError as error:
        raise OptionError(name, str(error)) from None


def _noise(position: float | str, rotation: float | str | None, gauges: tuple[str, ...]) -> Noise:
    sizes = {"sigma_position": _size("sigma_position", position, "length")}
    if rotation is not None:
        sizes["sigma_rotation"] = _size("sigma_rotation", rotation, "angle")
    for name, size in sizes.items():
        if size <= 0:
            raise OptionError(name, f"found {shown(size)}, expected a positive standard deviation")
    if gauges and rotation is not None:
        raise OptionError("sigma_rotation", "found beside gauges, which read no rotation; leave it out")
    return Noise(sizes["sigma_position"], sizes.get("sigma_rotation"), gauges=gauges)


def _loads(force: float | str, moment: float | str, directions: Sequence[str]) -> Array:
    """Return the wrenches to choose from, (L, 6)."""
    parts = []
    for name, value, kind in (("force", force, "force"), ("moment", moment, "moment")):
        size = _size(name, value, kind)
        if size < 0:
            raise OptionError(
                name, f"found {shown(value)}, expected 0 or more, signs go with --directions (directions=...)"
            )
        along = force_loads(size, axes_of("directions", directions))
        if size > 0:
            parts.append(along if kind == "force" else np.roll(along, 3, axis=1))
    if not parts:
        raise BeamstiffError("--force and --moment (force=, moment=): found 0 for both, expected a load")
    return np.concatenate(parts)
