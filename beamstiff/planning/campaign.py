"""A measurement campaign: the tests to make, chosen, and written as a table to fill in."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from beamstiff.errors import BeamstiffError
from beamstiff.measure.instruments import target
from beamstiff.measure.rows import subset
from beamstiff.measure.table import Measurements
from beamstiff.measure.writer import measurements_to_csv
from beamstiff.planning.candidates import Noise, force_loads
from beamstiff.planning.designs import Design
from beamstiff.planning.moving import nearest_next
from beamstiff.planning.poses import rounded_postures
from beamstiff.robot.description import Robot
from beamstiff.se3 import Array


@dataclass(frozen=True, eq=False)
class Plan:
    """Tests to make."""

    tests: Measurements  # poses and loads without displacements; the rows of a pose stand together
    # what they are expected to tell; `chosen` counts candidates, or poses where whole poses were chosen
    design: Design
    noise: Noise


def by_pose(tests: Measurements, information: Array) -> Array:
    """Return the information (P, m, m) of whole poses from that of the tests of `candidate_tests`."""
    poses, (_, m, _) = int(tests.pose.max()) + 1, information.shape
    return np.asarray(information.reshape(poses, -1, m, m).sum(axis=1))


def plan_of(
    tests: Measurements,
    design: Design,
    noise: Noise,
    whole_poses: bool = False,
    speed: Array | float = 1.0,
) -> Plan:
    """Return the campaign of a design of tests, or of whole poses, each soonest driven to at speeds (A,)."""
    rows = design.chosen
    if whole_poses:
        rows = np.arange(len(tests)).reshape(int(tests.pose.max()) + 1, -1)[rows].reshape(-1)
    return Plan(_in_order(subset(tests, rows), noise, speed), design, noise)


def _in_order(tests: Measurements, noise: Noise, speed: Array | float) -> Measurements:
    """Return the tests pose by pose, each pose next to the nearest one not yet visited, numbered anew."""
    first = np.unique(tests.pose, return_index=True)[1]
    route = nearest_next(tests.q[first] / speed)
    rank = {int(tests.pose[first[at]]): place for place, at in enumerate(route)}
    pose = np.array([rank[int(number)] for number in tests.pose])
    order = np.argsort(pose, kind="stable")
    step = np.concatenate([np.arange(size) for size in np.bincount(pose)])
    return replace(
        subset(tests, order),
        pose=pose[order],
        step=step.astype(np.float64),
        rows=np.arange(1, len(order) + 1),
        sigma_position=noise.position,
        sigma_rotation=noise.rotation,
    )


def plan_csv(campaign: Plan, robot: Robot) -> str:
    """Return the tests as CSV measurements whose displacement columns are to be filled in.

    Postures are in degrees and millimetres, with the digits that a pendant takes. The lines before the header
    say what to expect of it.
    """
    design, count = campaign.design, len(campaign.tests)
    efficient = np.floor(1000 * design.efficiency) / 10
    says = {
        "robot": robot.name,
        "plan": f"{count} tests, {design.criterion}-efficient to at least {efficient:g}%",
        "expected relative standard errors": ", ".join(
            f"{name} {error:.2%}" for name, error in design.standard_errors.items()
        ),
    }
    if (campaign.tests.displacement == campaign.tests.displacement).any():
        raise BeamstiffError("the tests of this campaign are measured already, expected a plan")
    units = {item.name: "deg" if item.kind == "angle" else "mm" for item in robot.actuated}
    q = rounded_postures(robot, campaign.tests.q, units)
    tests = replace(campaign.tests, q=q, units=units, metadata=says)
    return measurements_to_csv(_by_gauges(tests, campaign.noise.gauges), robot)


def _by_gauges(tests: Measurements, axes: Sequence[str]) -> Measurements:
    """Return tests with a row for the gauge along each axis; by a tracker where there is none."""
    if not axes:
        return tests
    along = force_loads(1.0, axes)[:, :3]
    gauges = [target(f"gauge {axis}", "gauge", normal=one) for axis, one in zip(axes, along, strict=True)]
    every = subset(tests, np.repeat(np.arange(len(tests)), len(axes)))
    return replace(
        every,
        target=np.tile([one.name for one in gauges], len(tests)),
        direction=np.tile(along, (len(tests), 1)),
        targets=tuple(gauges),
    )
