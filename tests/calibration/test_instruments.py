"""Calibration without a tracker, against closed forms, finite differences and what the literature says."""

from dataclasses import replace

import numpy as np
import pytest

from beamstiff import BeamstiffError, Robot, calibrate
from beamstiff.calibration.statement import build_calibration
from beamstiff.calibration.validation import errors_on
from beamstiff.measure.instruments import Target, target
from beamstiff.measure.registration import fit_rigid_motion
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.planning.seated import reached, seated_postures
from beamstiff.robot.kinematics import compile_kinematics, posture
from beamstiff.se3 import Array
from tests.calibration.machines import machine, machined, measured, serial, variables, within

NOISE = 1e-5
REAL = machine(serial(), machined(serial(), 3) | {"ball.x": 2e-3, "ball.y": -1e-3, "ball.z": 1e-3})
PLACES = ((1.5, 0.3, 1.2), (1.2, -1.0, 1.6), (2.0, 0.8, 0.8))
NORMALS = ((0, 0, 1), (1, 0, 0.2), (0.1, 1, 0))
ROBOT_GROUPS = ("offset", "frame", "target")


def tcp(robot: Robot, q: Array) -> Array:
    kinematics = compile_kinematics(robot)
    return posture(kinematics, q).node_positions[:, kinematics.node_index[robot.tcp]]


def read(targets: list[Target], count: int, noise: float = NOISE) -> Measurements:
    """Return readings of a machine that is brought to each set-up, which the reader does not know."""
    rng = np.random.default_rng(7)
    each = [seated_postures(REAL, one, count, 10 + at) for at, one in enumerate(targets)]
    values = np.full((sum(map(len, each)), 3), np.nan)
    at = 0
    for one, q in zip(targets, each, strict=True):
        off, _ = reached(one, tcp(REAL, q))
        values[at : at + len(q), : off.shape[1]] = off + noise * rng.standard_normal(off.shape)
        at += len(q)
    return make_measurements(
        variables(REAL),
        np.concatenate(each),
        tcp=REAL.tcp,
        position=values,
        target=np.repeat([one.name for one in targets], [len(q) for q in each]),
        targets=[target(one.name, one.instrument, length=one.length) for one in targets],
        sigma_position=NOISE,
    )


def set_ups(instrument: str) -> list[Target]:
    if instrument == "plane":
        return [
            target(f"P{k}", "plane", place=p, normal=n)
            for k, (p, n) in enumerate(zip(PLACES, NORMALS, strict=True))
        ]
    length = 0.6 if instrument == "ball-bar" else None
    return [target(f"T{k}", instrument, place=p, length=length) for k, p in enumerate(PLACES)]


@pytest.fixture(scope="module")
def tables() -> dict[str, Measurements]:
    counts = {"socket": 40, "ball-bar": 80, "plane": 80}
    return {name: read(set_ups(name), count) for name, count in counts.items()}


def test_derivatives_are_those_of_finite_differences() -> None:
    q = within(serial(), 40, 5)
    targets = (
        target("bar", "ball-bar"),
        target("wall", "plane"),
        target("clock", "gauge", normal=(1, 2, 3)),
        target("seat", "socket"),
    )
    names = np.repeat([one.name for one in targets], 10)
    values = np.full((40, 3), np.nan)
    values[:30, 0], values[30:] = 0.01 * np.random.default_rng(0).standard_normal(30), 0.0
    rows = make_measurements(
        variables(serial()),
        q,
        tcp="ball",
        position=values,
        target=names,
        targets=targets,
        sigma_position=1e-5,
    )
    problem = build_calibration(serial(), rows, noticed=0).problem
    theta = 1e-3 * np.random.default_rng(1).standard_normal(len(problem.parameters))
    _, jacobian = problem.linearised(theta)
    for at, step in enumerate(1e-6 * np.eye(theta.size)):
        slope = (problem.residuals(theta - step) - problem.residuals(theta + step)) / 2e-6
        np.testing.assert_allclose(jacobian[:, at], slope, atol=1e-6 * np.abs(jacobian).max())


def test_a_bar_at_the_tip_of_one_link_sees_its_length_alone() -> None:
    """The base ball on the joint's axis: |p - s| is the link's length, in every posture."""
    link = Robot(
        name="link",
        variables=[{"name": "q1", "type": "revolute"}],
        frames=[{"name": "f1", "parent": "base", "theta": "q1"}],
        nodes=[{"name": "root"}, {"name": "tip", "frame": "f1", "at": [1.0, 0, 0]}],
        rigids=[{"name": "arm", "nodes": ["root", "tip"]}],
        fixed=["root"],
        tcp="tip",
    )
    q = np.linspace(-1, 1, 9)[:, None]
    rows = make_measurements(
        ["q1"],
        q,
        tcp="tip",
        position=np.tile([2e-3, np.nan, np.nan], (9, 1)),
        target=["bar"] * 9,
        targets=[target("bar", "ball-bar", place=(0, 0, 0), length=1.0)],
        sigma_position=1e-5,
    )
    found = calibrate(link, rows, ["tip", "q1"], folds=0)
    assert found.identifiability.identified == ("tip.x",)
    assert "q1" in found.identifiability.silent
    assert found["tip.x"].change == pytest.approx(2e-3, abs=1e-9)
    _, jacobian = found.statement.problem.linearised(np.zeros(4))
    np.testing.assert_allclose(jacobian[:, 0], 1e5)  # radial; across and about it nothing shows
    np.testing.assert_allclose(jacobian[:, 1:], 0.0, atol=1e-6)


@pytest.mark.parametrize(("instrument", "lacks"), [("socket", 1), ("ball-bar", 0), ("plane", 1)])
def test_the_scale_is_all_that_sockets_and_planes_do_not_tell(
    tables: dict[str, Measurements], instrument: str, lacks: int
) -> None:
    """Positions that are equal, or in a plane, stay so when the machine grows; a length tells the scale.

    A tracker finds 21 parameters of this robot besides its base (Khalil and Dombre 2002, chapter 11).
    """
    tracker = calibrate(serial(), measured(REAL, within(serial(), 60, 1), noise=NOISE), folds=0)
    own = {p.name for p in tracker.parameters if p.identified and p.parameter.group in ROBOT_GROUPS}
    found = calibrate(serial(), tables[instrument], folds=0)
    seen = {p.name for p in found.parameters if p.identified and p.parameter.group in ROBOT_GROUPS}
    # without a measuring frame the first axis is the frame: what places it is no parameter
    assert not any(name.startswith(("base", "f1.")) or name == "q1" for name in seen)
    assert len(seen) == len(own) - lacks
    assert found.noise == pytest.approx(1.0, abs=0.2)


@pytest.mark.parametrize("instrument", ["socket", "ball-bar", "plane"])
def test_what_is_found_holds_for_fresh_postures_but_for_the_scale(
    tables: dict[str, Measurements], instrument: str
) -> None:
    fresh = within(serial(), 100, 99)
    found = calibrate(serial(), tables[instrument], folds=0)
    with_scale = instrument != "ball-bar"
    left = fit_rigid_motion(tcp(found.robot, fresh), tcp(REAL, fresh), with_scale=with_scale).rms
    before = fit_rigid_motion(tcp(serial(), fresh), tcp(REAL, fresh), with_scale=with_scale).rms
    assert left < 0.1e-3 < 1e-3 < before
    for one, truth in zip(found.targets, set_ups(instrument), strict=True):
        if instrument == "ball-bar":
            assert one.place == pytest.approx(truth.place, abs=0.02)
            assert found[f"{one.name}.x"].value == pytest.approx(one.place[0])


def test_a_bar_of_unknown_length_leaves_the_scale_open(tables: dict[str, Measurements]) -> None:
    rows = tables["ball-bar"]
    free = replace(rows, targets=tuple(target(one.name, "ball-bar") for one in rows.targets))
    fits = [calibrate(serial(), some, folds=0).parameters for some in (rows, free)]
    count = [sum(p.identified and p.parameter.group in ROBOT_GROUPS for p in fit) for fit in fits]
    assert count[1] == count[0] - 1


def test_three_gauges_at_a_point_are_a_tracker_in_the_base_frame() -> None:
    rows = measured(REAL, within(serial(), 40, 1), noise=NOISE)
    gauges = [target(f"G{k}", "gauge", place=(0, 0, 0), normal=axis) for k, axis in enumerate(np.eye(3))]
    alone = np.full((120, 3), np.nan)
    alone[:, 0] = rows.position.ravel()
    split = make_measurements(
        rows.variables,
        np.repeat(rows.q, 3, axis=0),
        tcp="ball",
        position=alone,
        target=np.tile([one.name for one in gauges], 40),
        targets=gauges,
        direction=np.tile(np.eye(3), (40, 1)),
        sigma_position=rows.sigma_position,
    )
    one, other = (calibrate(serial(), some, fixed=["base"], folds=0) for some in (rows, split))
    assert one.identifiability.identified == other.identifiability.identified
    for a, b in zip(one.parameters, other.parameters, strict=True):
        assert b.value == pytest.approx(a.value, abs=1e-9)
        assert b.std == (None if a.std is None else pytest.approx(a.std, rel=1e-6))


def test_errors_are_told_of_other_tables_and_stations_are_refused(tables: dict[str, Measurements]) -> None:
    found = calibrate(serial(), tables["socket"])
    assert found.held_out is not None
    assert found.held_out.position_rms == pytest.approx(np.sqrt(3) * NOISE, rel=0.3)
    known = errors_on(found, tables["socket"]).position_rms
    assert known == pytest.approx(found.after.position_rms, rel=1e-6)
    with pytest.raises(BeamstiffError, match="a socket beside stations"):
        calibrate(serial(), tables["socket"], stations=True)


def test_a_plane_needs_three_points() -> None:
    rows = read([target("P", "plane", place=PLACES[0], normal=(0, 0, 1))], 2)
    with pytest.raises(BeamstiffError, match="P: found 2 points of a plane, expected 3"):
        calibrate(serial(), rows)
