"""Tables that are valid and hardly meant, by loads, units and positions; and what no analysis can use."""

import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from beamstiff import BeamstiffError, diagnose
from beamstiff.measure import Measurements, make_measurements, parse_measurements
from beamstiff.measure.doubts import copies_between, counted_once, doubts, require_scale, require_usable
from beamstiff.measure.rows import concatenate
from beamstiff.robot.closure import every_assembly
from beamstiff.robot.description import Robot
from beamstiff.robot.kinematics import compile_kinematics, posture
from beamstiff.robot.reader import load_robot
from beamstiff.se3 import Array, rotation_from_vector
from tests.diagnosis.machines import at_random, elbow, nominal

FRAME, PLACE = np.array([0.3, -0.2, 1.1]), np.array([2.0, -1.0, 0.4])  # rad, m: a tracker stands somewhere

ARM = elbow()


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("q1,d2,dx\n1,0,0\n90,0,0\n", "t.csv:3: q1: 90 rad is more than two turns.*q1 \\[deg\\]"),
        (
            "q1,d2,dx\n4,0,0\n",
            "t.csv:2: q1: 4 rad lies outside the limits -3.14159 to 3.14159 rad.*229.2 deg",
        ),
        ("q1,d2,dx\n0,0,0.639\n", "t.csv:2: a displacement of 0.639 m is large"),
        ("q1,d2,rx\n0,0,0.5\n", "t.csv:2: a rotation of 0.5 rad is large"),
        ("# sigma_position: 0.03\nq1,d2,dx\n0,0,0\n", "t.csv: sigma_position: 0.03 m is large"),
        ("# sigma_rotation: 0.02\nq1,d2,rx\n0,0,0\n", "t.csv: sigma_rotation: 0.02 rad is large"),
        ("q1,d2,fx,dx\n0,0,1,0\n0,0,-9e6,0\n", "t.csv:3: a load of 9e\\+06 N"),
    ],
)
def test_what_is_hardly_meant_is_told(text: str, part: str, arm: Robot) -> None:
    found = doubts(parse_measurements(text, arm, "t.csv"), arm)
    assert len(found) == 1
    assert re.match(part, found[0])


def test_a_common_table_leaves_no_doubt(arm: Robot) -> None:
    text = "# sigma_position: 0.03 mm\nq1 [deg],d2 [mm],fz,dz [mm],rx [deg]\n90,900,-900,-1.2,0.02\n"
    assert doubts(parse_measurements(text, arm), arm) == ()


def test_rows_that_were_pasted_twice_are_told(arm: Robot) -> None:
    rows = "0.5,0.25,10,0.001\n0.5,0.25,20,0.002\n0.5,0.25,30,0.003\n"
    found = doubts(parse_measurements(f"q1,d2,fx,dx\n{rows}{rows}", arm, "t.csv"), arm)
    assert len(found) == 1
    assert found[0].startswith("t.csv:5: 3 rows are copies of others to the last digit (this one of t.csv:2)")
    again = rows.replace("0.001", "0.0011").replace("0.002", "0.0021")
    assert doubts(parse_measurements(f"q1,d2,fx,dx\n{rows}{again}", arm), arm) == ()


def test_a_table_of_another_robot_is_told(arm: Robot) -> None:
    found = doubts(parse_measurements("# robot: kr500\nq1,d2,fx,dx\n0.5,0.25,10,0.001\n", arm, "t.csv"), arm)
    assert found == (f"t.csv: the table is of robot 'kr500', here it is read with {arm.name!r}",)


def test_an_absolute_table_has_no_large_displacements(arm: Robot) -> None:
    assert doubts(parse_measurements("q1,d2,x,y,z,a,b,c\n0,0,2,1,1,3,0,0\n", arm), arm) == ()


# Springs of 1e-6 m/N and more in each direction: x along the load of 900 N, z less than y.
STATES = [
    (900.0, 0.0, 0.0, 0.9, 0.1, -0.2),
    (0.0, -800.0, 0.0, -0.1, -1.1, 0.3),
    (0.0, 0.0, 700.0, -0.2, -0.3, 0.8),
]


def table_of(states: list[tuple[float, ...]], sigma: str = "0.03 mm", header: str = "") -> str:
    """Return a table of loads and displacements; `header` orders the columns otherwise."""
    rows = [f"0,0.5,{','.join(map(str, state))},{at}" for at, state in enumerate(states)]
    return "\n".join(
        [f"# sigma_position: {sigma}"] * bool(sigma)
        + [f"q1,d2,{header or 'fx,fy,fz,dx [mm],dy [mm],dz [mm]'},t", *rows, ""]
    )


def test_loads_of_the_wrong_sign_are_the_first_doubt(arm: Robot) -> None:
    assert doubts(parse_measurements(table_of(STATES), arm), arm) == ()
    turned = [(-fx, -fy, -fz, *moved) for fx, fy, fz, *moved in STATES]
    far = table_of(turned).replace("0,0.5,-900", "20,0.5,-900")  # and degrees without their unit
    first, second = doubts(parse_measurements(far, arm, "t.csv"), arm)
    assert first.startswith(
        "t.csv: the tool moved against its load in 3 of 3 rows, which no elastic machine does: is the sign"
    )
    assert "more than two turns" in second


def test_loads_of_another_frame_and_swapped_columns_are_doubted(arm: Robot) -> None:
    swapped = "fx,fy,fz,dz [mm],dy [mm],dx [mm]"
    (told,) = doubts(parse_measurements(table_of(2 * STATES, header=swapped), arm), arm)
    assert "against its load in 4 of 6 rows, which no elastic machine does" in told
    (told,) = doubts(parse_measurements(table_of(2 * STATES + 3 * STATES[1:2], header=swapped), arm), arm)
    assert "against its load in 4 of 9 rows: are the loads given in another frame" in told
    assert "noise" not in told
    (told,) = doubts(parse_measurements(table_of(2 * STATES + 3 * STATES[1:2], "", swapped), arm), arm)
    assert "or the noise, which is not stated" in told


def test_rows_within_their_noise_and_few_bad_ones_say_nothing(arm: Robot) -> None:
    turned = [(-fx, -fy, -fz, *moved) for fx, fy, fz, *moved in STATES]
    assert doubts(parse_measurements(table_of(turned, "0.5 mm"), arm), arm) == ()
    assert doubts(parse_measurements(table_of(5 * STATES + turned), arm), arm) == ()


def test_loads_beside_the_reflector_and_moments_without_rotations_are_not_judged(arm: Robot) -> None:
    for more, cells in (("load_point", "base"), ("mx", "5")):
        turned = [(-fx, -fy, -fz, *moved, cells) for fx, fy, fz, *moved in STATES]
        nodes = [node.name for node in arm.nodes if node.name != arm.tcp]
        header = f"fx,fy,fz,dx [mm],dy [mm],dz [mm],{more}"
        text = table_of(turned, header=header).replace("base", nodes[0])
        assert doubts(parse_measurements(text, arm), arm) == ()


def test_degrees_in_all_columns_are_told_in_one_sentence(arm: Robot) -> None:
    two = arm.model_copy(
        update={"variables": (*arm.variables, arm.variables[0].model_copy(update={"name": "q4"}))}
    )
    (told,) = doubts(parse_measurements("q1,d2,q4,dx\n90,0,-120,0\n", two, "t.csv"), two)
    assert told == (
        "t.csv:2: q1: 90 rad is more than two turns; if the column is in degrees, write q1 [deg] "
        "(and so for q4)"
    )


def test_noise_beyond_all_readings_is_doubted_before_joints_and_sizes(arm: Robot) -> None:
    text = table_of(STATES, "0.02").replace("0,0.5,900", "20,0.5,900")
    first, second = doubts(parse_measurements(text, arm, "t.csv"), arm)
    assert first == (
        "t.csv: sigma_position: 0.02 m is large, larger than anything measured (1.1 mm); a number without a "
        "unit is in m, write for instance sigma_position: 0.02 mm"
    )
    assert "more than two turns" in second


def read(name: str, assembly: str | None = None, noise: float = 1e-4, poses: int = 12) -> Measurements:
    """Return positions of the TCP of a robot, its loops put together in one of their ways."""
    robot = load_robot(name).model_copy(update={"assembly": assembly})
    kinematics, rng = compile_kinematics(robot), np.random.default_rng(2)
    low, high = np.array([variable.limits for variable in robot.actuated]).T
    q = 0.5 * (low + high) + 0.1 * (high - low) * rng.uniform(-1.0, 1.0, (poses, len(low)))
    at = posture(kinematics, q).node_positions[:, kinematics.node_index[robot.tcp]]
    seen = at @ rotation_from_vector(FRAME).T + PLACE + noise * rng.standard_normal(at.shape)
    names = [variable.name for variable in robot.actuated]
    return make_measurements(names, q, tcp=robot.tcp, position=seen, source="tracker.csv")


@pytest.mark.parametrize("factor", [1e3, 1e-3, 10.0])
def test_positions_in_a_wrong_unit_are_refused(factor: float) -> None:
    table, robot = read("kr240-2"), load_robot("kr240-2")
    require_scale(table, robot)
    wrong = replace(table, position=factor * table.position)
    with pytest.raises(
        BeamstiffError, match=r"tracker.csv: x y z: .* m apart .*: check the units; .* x \[mm\]"
    ):
        require_scale(wrong, robot)
    with pytest.raises(BeamstiffError, match="check the units"):
        diagnose(robot, wrong)


def test_joints_read_wrongly_and_rows_of_one_posture_are_no_wrong_unit() -> None:
    table, robot = read("kr240-2"), load_robot("kr240-2")
    for column in range(6):
        q = table.q.copy()
        q[:, column] = np.pi - q[:, column]
        require_scale(replace(table, q=q), robot)
    require_scale(replace(table, position=0.0 * table.position), robot)  # to be predicted
    require_scale(replace(table, q=0.0 * table.q, position=table.position[:1] + 1e-3 * table.position), robot)


@pytest.fixture(scope="module")
def names() -> list[str]:
    return [one.name for one in every_assembly(compile_kinematics(load_robot("five-bar")))]


def test_another_assembly_that_fits_the_positions_is_named(names: list[str]) -> None:
    taken, other = names[:2]
    (note,) = (
        one for one in doubts(read("five-bar", other), load_robot("five-bar")) if "fit the loops" in one
    )
    assert note.startswith("tracker.csv: ")
    assert f"put together as {other!r}" in note
    assert f"not as {taken!r}" in note
    assert f"--assembly={other}" in note


def test_of_the_assembly_that_is_taken_nothing_is_said(names: list[str]) -> None:
    robot = load_robot("five-bar")
    assert not [one for one in doubts(read("five-bar", names[0]), robot) if "fit the loops" in one]
    meant = robot.model_copy(update={"assembly": names[1]})
    assert not [one for one in doubts(read("five-bar", names[1]), meant) if "fit the loops" in one]


def said(table: Measurements) -> list[str]:
    """Return what is said of the joint values."""
    return [one for one in doubts(table, load_robot("kr240-2")) if "the positions fit robot" in one]


@pytest.mark.parametrize(
    ("column", "wrong", "told"),
    [
        (2, lambda q: -q, "q3 reversed"),
        (1, lambda q: q + np.pi / 2, "q2 -90 deg"),
        (4, lambda q: q + np.pi, "q5 +180 deg"),
    ],
)
def test_a_joint_that_was_read_with_a_wrong_sign_or_zero_is_named(
    column: int, wrong: Callable[[Array], Array], told: str
) -> None:
    table = read("kr240-2")
    q = table.q.copy()
    q[:, column] = wrong(q[:, column])
    (note,) = said(replace(table, q=q))
    assert note.startswith("tracker.csv: the positions fit robot 'kr240-2' with ")
    assert told in note


def test_swapped_columns_are_named() -> None:
    table = read("kr240-2")
    (note,) = said(replace(table, q=table.q[:, [0, 2, 1, 3, 4, 5]]))
    assert "q2 and q3 swapped" in note


def test_of_joints_that_were_read_right_and_of_few_postures_nothing_is_said() -> None:
    assert not said(read("kr240-2"))
    assert not said(read("kr240-2", noise=5e-3))  # a robot that wants calibration
    few = read("kr240-2", poses=5)
    assert not said(replace(few, q=few.q * [1, 1, -1, 1, 1, 1]))


def test_of_points_on_one_line_nothing_is_said() -> None:
    table, robot = read("kr240-2"), load_robot("kr240-2")
    q = np.repeat(table.q[:1], len(table), axis=0)
    q[:, 5] = np.linspace(-2.0, 2.0, len(q))  # the tool turns where it stands
    kinematics = compile_kinematics(robot)
    at = posture(kinematics, q).node_positions[:, kinematics.node_index[robot.tcp]]
    assert not said(replace(table, q=q, position=at))


@pytest.mark.parametrize(("off", "asked"), [(2 * np.pi, True), (4.0, False)])
def test_a_joint_outside_its_limits_by_a_full_turn_is_asked_about(off: float, asked: bool) -> None:
    table = read("kr240-2")
    q = table.q.copy()
    q[:, 1] += off
    (note,) = (one for one in doubts(replace(table, q=q), load_robot("kr240-2")) if "q2: " in one)
    assert note.endswith(": is it off by a full turn?") == asked


def loaded(seed: int = 1, rows: int = 12, source: str = "t.csv") -> Measurements:
    """Return rows of the elbow arm with what it does and noise."""
    there = nominal(ARM, at_random(ARM, rows, seed=seed, source=source))
    noise = 1e-5 * np.random.default_rng(seed).standard_normal((rows, 6))
    return replace(there.rows, displacement=there.predicted + noise)


def test_a_compliant_machine_is_usable() -> None:
    require_usable(loaded())


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"displacement": np.zeros((12, 6))}, "t.csv: all displacements are 0"),
        ({"displacement": -loaded().displacement}, "moved against its load in all 12 rows"),
    ],
)
def test_what_tells_nothing_of_the_machine_is_refused(changed: dict[str, np.ndarray], said: str) -> None:
    with pytest.raises(BeamstiffError, match=said):
        require_usable(replace(loaded(), **changed))


def test_some_rows_against_their_load_are_no_reason_to_refuse() -> None:
    rows = loaded()
    sign = np.where(np.arange(12) < 11, -1.0, 1.0)[:, None]
    require_usable(replace(rows, displacement=sign * rows.displacement))


def test_positions_are_not_asked_for_loads() -> None:
    there = ARM.model_copy(update={"identify": ()})
    rows = at_random(there, 4, seed=1, position=np.ones((4, 3)))
    require_usable(replace(rows, wrench=np.zeros((4, 6))))


def test_a_table_pasted_twice_counts_once() -> None:
    rows = loaded()
    twice = concatenate([rows, loaded(source="u.csv")])
    assert len(counted_once(twice)) == 12
    np.testing.assert_array_equal(counted_once(twice).displacement, rows.displacement)
    assert list(copies_between([rows, loaded(source="u.csv")])) == [
        "u.csv: 12 rows are copies of rows of t.csv: each counts once"
    ]
    assert list(copies_between([rows, loaded(seed=2)])) == []


def test_states_that_were_read_again_count_each_time() -> None:
    again = replace(loaded(seed=1), displacement=loaded(seed=1).displacement + 1e-7)
    assert len(counted_once(concatenate([loaded(seed=1), again]))) == 24


def test_a_dial_gauge_may_read_the_same_again() -> None:
    rows = loaded(rows=40)
    coarse = replace(rows, displacement=np.round(rows.displacement, 3))  # mm steps
    assert len(counted_once(concatenate([coarse, coarse]))) == 80
