"""Encoders behind the gears in `identify`. Truth: virtual work on rigid links, ``s = J^T w / k``."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from beamstiff import identify, load_robot
from beamstiff.fem.static_response import nodal_loads, respond
from beamstiff.fem.structure import compile_structure
from beamstiff.identification.result import Identification
from beamstiff.measure.rows import subset
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.robot.kinematics import compile_kinematics, posture, twist_jacobian
from beamstiff.robot.parts import AddedEffect
from beamstiff.se3 import Array

KR500 = load_robot("kr500")  # its q1, q4 and q6 count clockwise: their springs open the other way
TOOL_NODE = {"name": "tool", "frame": "f6", "at": (0.25, 0.0, 0.15)}
ROBOT = type(KR500).model_validate(
    {key: getattr(KR500, key) for key in type(KR500).model_fields}
    | {
        "nodes": [*KR500.nodes, TOOL_NODE],
        "rigids": [*KR500.rigids, {"name": "link6", "nodes": ["n6b", "tool"]}],
        "tcp": "tool",
    }
)
NAMES = tuple(ROBOT.identify)
TRUE = np.array([1.4e7, 7e6, 5e6, 5e5, 2.5e5, 4e5])  # N m/rad
TOOL, ENCODER = 3e-5, 1e-5  # m, rad: noise
SEEDS = 50
Change = Callable[[Measurements], Measurements]
LOADS = np.concatenate([np.eye(6)[:3], -np.eye(6)[:3], np.array([[0, 0.7, -0.7, 0, 0, 0]])]) * 1500.0


def campaign(seed: int, poses: int = 6, straight: bool = False, sigma: float | None = TOOL) -> Measurements:
    """Return a campaign of seven loads a posture; of one load at another posture the encoders are unread."""
    rng = np.random.default_rng(seed)
    q = np.repeat(
        rng.uniform([-2, -1.5, 0, -2, -1.5, -2], [2, 0, 2, 2, 1.5, 2], (poses, 6)), len(LOADS), axis=0
    )
    q[:, 4] *= not straight
    wrench = np.tile(LOADS, (poses, 1))
    jacobian = twist_jacobian(kinematics := compile_kinematics(ROBOT), posture(kinematics, q), ROBOT.tcp)
    wound = np.einsum("nia,ni->na", jacobian, wrench) / TRUE
    displacement = np.einsum("nia,na->ni", jacobian, wound)[:, :3]
    curve = 3e-4 * np.sin(q + rng.uniform(0, 6, 6))  # of each gear
    link = q + wound + curve + rng.uniform(-1, 1, 6) + ENCODER * rng.standard_normal(q.shape)
    return make_measurements(
        ROBOT_VARIABLES,
        q,
        tcp=ROBOT.tcp,
        wrench=wrench,
        displacement=displacement + TOOL * rng.standard_normal(displacement.shape),
        sigma_position=sigma,
        link=np.mod(link, 2 * np.pi),
        source="t.csv",
    )


ROBOT_VARIABLES = [variable.name for variable in ROBOT.actuated]


def only(rows: Measurements, *joints: int) -> Measurements:
    """Return the table with the encoders behind some gears alone."""
    link = rows.link.copy()
    link[:, [at for at in range(link.shape[1]) if at not in joints]] = np.nan
    return replace(rows, link=link)


def relative(found: Identification) -> Array:
    """Return the stated std of each stiffness over its true value, (6,)."""
    return np.divide([np.inf if item.std is None else item.std for item in found.parameters], TRUE)


def test_stiffness_is_recovered_within_its_stated_std() -> None:
    away, inside, gain = [], [], []
    for seed in range(SEEDS):
        rows = only(campaign(seed), 1, 3)
        found, plain = identify(ROBOT, rows, folds=0), identify(ROBOT, only(rows), folds=0)
        intervals = np.array([item.interval for item in found.parameters], dtype=np.float64)
        away.append((found.stiffness - TRUE) / (relative(found) * TRUE))
        inside.append((intervals[:, 0] <= TRUE) & (intervals[:, 1] >= TRUE))
        gain.append(relative(plain) / relative(found))
    one, covered = (np.abs(away) < 1).mean(axis=0), np.mean(inside, axis=0)
    assert covered.min() >= 0.86  # of 50 draws at 95 %: less in one of 100
    assert one.min() >= 0.5
    assert (np.median(gain, axis=0)[[1, 3]] > 2).all()


def test_springs_in_series_that_the_tool_cannot_separate_are_known_by_one_encoder() -> None:
    """Where the wrist is straight, q4 and q6 turn about one line."""
    within = []
    for seed in range(SEEDS):
        rows = campaign(seed, straight=True)
        if seed < 3:
            plain = identify(ROBOT, only(rows), folds=0)
            assert [item.parameters for item in plain.degenerate] == [("J4.torsional", "J6.torsional")]
        found = identify(ROBOT, only(rows, 3), folds=0)
        assert not found.degenerate
        within.append(np.abs(found.stiffness - TRUE)[[3, 5]] < 2 * (relative(found) * TRUE)[[3, 5]])
        assert np.isfinite(relative(found)).all()
    share = np.mean(within, axis=0)
    assert (share >= 0.86).all()


def test_errors_of_the_loads_count_for_the_wind_up_too() -> None:
    away = []
    for seed in range(SEEDS):
        rows = campaign(seed)
        size = np.linalg.norm(rows.wrench, axis=1, keepdims=True)
        read = rows.wrench * (1.0 + 30.0 * np.random.default_rng(seed).standard_normal(size.shape) / size)
        found = identify(ROBOT, replace(rows, wrench=read, sigma_load=30.0), folds=0)
        away.append((found.stiffness - TRUE) / (relative(found) * TRUE))
    size = np.sqrt(np.mean(np.square(away), axis=0))
    assert (size < 1.35).all()  # of 50 draws: more in one of a thousand


def test_a_closed_loop_is_told_alike() -> None:
    """Truth: what the whole structure does (`fem.static_response`), not reduced to ports."""
    robot = load_robot("palletizer")
    true = robot.with_parameters({"J2.torsional": 4e6, "J3.torsional": 8e6})
    rng = np.random.default_rng(0)
    q = np.repeat(rng.uniform([-1, -0.3, 0, -1], [1, 0.7, 0.6, 1], (6, 4)), 6, axis=0)
    wrench = np.tile(np.concatenate([1000 * np.eye(6)[:3], -1000 * np.eye(6)[:3]]), (6, 1))
    structure = compile_structure(true)
    at = posture(structure.kinematics, q)
    answer = respond(structure, at, nodal_loads(structure, len(q), {robot.tcp: wrench}))
    joint = {one.name: number for number, one in enumerate(robot.joints)}
    own = [joint[name] for name in ("J1", "J2", "J3", "J4")]
    link = q + answer.joint_displacement[:, own, 3] + 1e-6 * rng.standard_normal(q.shape)
    moved = answer.displacement[:, structure.kinematics.node_index[robot.tcp], :3]
    rows = make_measurements(
        ["q1", "q2", "q3", "q4"],
        q,
        tcp=robot.tcp,
        wrench=wrench,
        displacement=moved + TOOL * rng.standard_normal(moved.shape),
        sigma_position=TOOL,
        link=link,
    )
    names = ["J1.torsional", "J2.torsional", "J3.torsional", "rod3"]
    found, plain = (identify(robot, one, names, folds=3) for one in (rows, only(rows)))
    for name, value in (("J2.torsional", 4e6), ("J3.torsional", 8e6)):
        std, without = found[name].std, plain[name].std
        assert std is not None
        assert without is not None
        assert found[name].value == pytest.approx(value, abs=3 * std)
        assert std < 0.3 * without
    assert found.held_out is not None
    assert found.held_out.residual.shape == found.predicted.shape == (len(rows), 6)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda rows: replace(rows, link=-rows.link), "q2_link is not used: it turns against the load"),
        (lambda rows: replace(rows, link=1e3 * rows.link), "q2_link is not used: no gear winds up so much"),
        (lambda rows: replace(rows, pose=np.arange(len(rows))), "q2_link is not used: found 0 indep"),
        (lambda rows: replace(rows, sigma=rows.sigma * np.nan), "the noise of the tool is not stated"),
    ],
)  # fmt: skip
def test_readings_that_say_nothing_are_left_out_with_the_reason(change: Change, said: str) -> None:
    rows = change(only(campaign(0), 1))
    found, plain = identify(ROBOT, rows, folds=0), identify(ROBOT, only(rows), folds=0)
    (note,) = (note for note in found.notes if "not used" in note)
    assert said in note
    assert found.stiffness.tolist() == plain.stiffness.tolist()


def test_a_state_that_several_points_saw_counts_once() -> None:
    rows = only(campaign(0), 1)
    twice = subset(rows, np.repeat(np.arange(len(rows)), 2))
    noise = TOOL * np.random.default_rng(9).standard_normal((len(rows), 3))
    twice.displacement[1::2, :3] += noise
    assert relative(identify(ROBOT, twice, folds=0))[1] > 0.98 * relative(identify(ROBOT, rows, folds=0))[1]


def test_what_else_identify_tells_takes_the_encoders_along() -> None:
    rows = campaign(0, straight=True)
    rows = replace(rows, displacement=np.hstack([rows.displacement[:, :3], np.zeros((len(rows), 3))]))
    found = identify(ROBOT, only(rows, 3), bootstrap=20, reduce=True, components="position")
    assert found.bootstrap is not None
    assert found.reduced is not None
    assert {"J4.torsional", "J6.torsional"} <= set(found.reduced.robot.identify)
    play = AddedEffect(
        effect="backlash",
        component="q2",
        shape="flank within 0.03",
        parameters={"half_width": 1e-4},
        scales={"torque": 2000.0},
    )
    beside = identify(ROBOT.model_copy(update={"effects": (play,)}), rows, folds=0)
    assert (
        "encoders behind the gears are not used: the robot's effects are not in their readings"
        in beside.notes
    )
