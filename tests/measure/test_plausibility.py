"""Tables that are valid and hardly meant, by loads, units and positions; and what no analysis can use."""

import re
from dataclasses import replace

import numpy as np
import pytest

from beamstiff import BeamstiffError
from beamstiff.measure.instruments import target
from beamstiff.measure.plausibility import copies_between, counted_once, doubts, require_usable
from beamstiff.measure.reader import parse_measurements
from beamstiff.measure.rows import concatenate
from beamstiff.measure.table import Measurements
from beamstiff.robot.description import Robot
from tests.diagnosis.machines import at_random, elbow, nominal

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


def test_planes_read_one_number_and_positions_need_three() -> None:
    there = ARM.model_copy(update={"identify": ()})
    read = np.column_stack([np.zeros(4), np.full((4, 2), np.nan)])
    with pytest.raises(BeamstiffError, match="no row has a value in y or z"):
        require_usable(at_random(there, 4, seed=1, position=read))
    table = {"target": ["table"] * 4, "targets": [target("table", "plane")]}
    require_usable(at_random(there, 4, seed=1, position=read, **table))


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


def test_positions_without_a_coordinate_are_refused_by_its_name(arm: Robot) -> None:
    table = parse_measurements("q1,d2,x,z\n0.1,0.2,1,3\n0.2,0.2,1,3\n", arm)
    with pytest.raises(BeamstiffError, match="no row has all of x y z: no row has a value in y;"):
        require_usable(table)


def test_times_that_go_back_or_are_missing_are_told(arm: Robot) -> None:
    def told(*times: float | str) -> str:
        rows = "".join(f"0.1,0.2,{row},{at}\n" for row, at in enumerate(times))
        return " ".join(doubts(parse_measurements("q1,d2,dx [mm],t\n" + rows, arm), arm))

    assert "t does not" not in told(1.0, 2.0, 2.0, 5.0)
    assert ":4: t does not increase here: rows are taken in the order of t" in told(1.0, 3.0, 2.0)
    assert ", nor in 1 other rows:" in told(3.0, 2.0, 1.0)
    assert ":2: t is empty: the whole table counts as one without t" in told("", 2.0, 5.0)


def test_a_second_run_may_begin_its_clock_anew(arm: Robot) -> None:
    runs = [
        parse_measurements("q1,d2,dx [mm],t\n" + "".join(f"0.1,0.2,{k},{k}\n" for k in (1, 2)), arm, name)
        for name in ("first", "second")
    ]
    assert "t does not" not in " ".join(doubts(concatenate(runs), arm))
