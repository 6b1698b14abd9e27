"""What is written is read back."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from beamstiff.errors import BeamstiffError
from beamstiff.measure.reader import parse_measurements, read_measurements
from beamstiff.measure.rows import concatenate
from beamstiff.measure.table import Measurements, make_measurements
from beamstiff.measure.writer import measurements_to_csv, write_measurements
from beamstiff.robot.description import Robot

FLOATS = st.floats(-1e100, 1e100)
ANGLES = st.floats(-1e6, 1e6)
ARRAYS = ("q", "wrench", "displacement", "position", "rotation", "sigma", "step", "time", "temperature")


@st.composite
def tables(draw: st.DrawFn) -> Measurements:
    n = draw(st.integers(1, 5))

    def numbers(shape: Any, elements: Any = FLOATS, nan: bool = False) -> Any:
        values = draw(arrays(np.float64, shape, elements=elements))
        return np.where(draw(arrays(np.bool_, shape)), np.nan, values) if nan else values

    positive = st.floats(1e-12, 1e6)
    absolute = draw(st.booleans())
    turned = numbers((n, 3), st.floats(-10, 10))
    turned[draw(arrays(np.bool_, n))] = np.nan
    given: dict[str, Any] = (
        {"position": numbers((n, 3), nan=True), "rotation": turned}
        if absolute
        else {"displacement": np.hstack([numbers((n, 3), nan=True), numbers((n, 3), ANGLES, nan=True)])}
    )
    measured = np.hstack(list(given.values()))
    pose = draw(st.lists(st.integers(-9, 9), min_size=n, max_size=n, unique=True))
    sigma = np.where(np.isnan(measured), np.nan, numbers((n, 6), positive, nan=True))
    text = st.text(st.characters(codec="ascii", exclude_categories=["C"]), max_size=20).map(str.strip)
    return make_measurements(
        ["q1", "d2"],
        numbers((n, 2), ANGLES),
        tcp="tip",
        wrench=numbers((n, 6)),
        sigma=sigma,
        sigma_position=draw(st.none() | positive),
        sigma_rotation=draw(st.none() | positive),
        sigma_load=draw(st.none() | positive),
        point=draw(st.lists(st.sampled_from(["root", "elbow", "tip"]), min_size=n, max_size=n)),
        load_point=draw(st.lists(st.sampled_from(["root", "tip"]), min_size=n, max_size=n)),
        pose=pose,
        step=numbers(n, st.integers(-99, 99).map(float), nan=True),
        time=numbers(n, nan=True),
        temperature=numbers(n, st.floats(-273, 1e3), nan=True),
        shared_unloaded=not absolute and draw(st.booleans()),
        continuous=draw(st.booleans()),
        metadata={"note": draw(text.filter(lambda t: t == t.strip(',;\t "')))},
        **given,
    )


@given(table=tables())
def test_what_is_written_is_read_back_to_1e_15(table: Measurements, arm: Robot) -> None:
    back = parse_measurements(measurements_to_csv(table, arm), arm, require_measured=False)
    assert back.kind == table.kind
    measured = table.measured_mask
    for name in ARRAYS:
        a, b = getattr(table, name), getattr(back, name)
        if name == "sigma":  # of what was measured
            a, b = np.where(measured, a, 0.0), np.where(measured, b, 0.0)
        np.testing.assert_allclose(b, a, rtol=1e-15, atol=0, err_msg=name)
    for name in ("point", "load_point", "pose"):
        assert getattr(back, name).tolist() == getattr(table, name).tolist()
    for name in ("sigma_position", "sigma_rotation", "sigma_load"):
        assert getattr(back, name) == getattr(table, name)
    for name in ("shared_unloaded", "continuous", "variables"):
        assert getattr(back, name) == getattr(table, name)
    assert back.metadata["note"] == table.metadata["note"]


def test_the_text_is_for_people(arm: Robot) -> None:
    table = make_measurements(
        ["q1", "d2"],
        [[0.5, 0.25]],
        tcp="tip",
        wrench=[[0, 0, -900, 0, 0, 0]],
        displacement=[[0.000123, np.nan, -0.000639]],
        sigma_position=5e-5,
        metadata={"source": "bench"},
    )
    assert measurements_to_csv(table, arm).splitlines() == [
        "# source: bench",
        "# sigma_position: 0.05 mm",
        "q1 [rad],d2 [m],fx [N],fy [N],fz [N],mx [N*m],my [N*m],mz [N*m],dx [mm],dz [mm],pose",
        "0.5,0.25,0.0,0.0,-900.0,0.0,0.0,0.0,0.123,-0.639,0",
    ]


def test_a_plan_keeps_empty_columns_to_fill_in(arm: Robot) -> None:
    plan = make_measurements(["q1", "d2"], [[0.5, 0.25]], tcp="tip", displacement=np.full((1, 6), np.nan))
    lines = measurements_to_csv(plan, arm).splitlines()
    assert lines[0].endswith("dx [mm],dy [mm],dz [mm],pose")
    assert lines[1].endswith(",,,,0")


def test_files_of_different_noise_become_one(arm: Robot) -> None:
    def part(sigma: float | None) -> Measurements:
        return make_measurements(
            ["q1", "d2"], [[0, 0]], tcp="tip", displacement=np.ones((1, 6)), sigma_position=sigma
        )

    both = concatenate([part(1e-5), part(3e-5), part(None)])
    back = parse_measurements(measurements_to_csv(both, arm), arm)
    np.testing.assert_allclose(back.sigma, both.sigma, rtol=1e-15)


def test_the_file_is_there_whole_or_not_at_all(arm: Robot, tmp_path: Path) -> None:
    table = make_measurements(["q1", "d2"], [[0, 0]], tcp="tip", displacement=np.ones((1, 6)))
    path = tmp_path / "table.csv"
    write_measurements(table, path, arm)
    assert read_measurements(path, arm).displacement.tolist() == [[1] * 6]
    assert [entry.name for entry in tmp_path.iterdir()] == ["table.csv"]
    with pytest.raises(BeamstiffError, match="cannot be written"):
        write_measurements(table, tmp_path / "missing" / "table.csv", arm)
    with pytest.raises(BeamstiffError, match=str(tmp_path)):
        write_measurements(table, tmp_path, arm)
    other = make_measurements(["q2"], [[0]], tcp="tip", displacement=np.ones((1, 6)))
    with pytest.raises(BeamstiffError, match="found the variables q2, expected those of robot 'arm': q1, d2"):
        write_measurements(other, path, arm)
    assert read_measurements(path, arm).displacement.tolist() == [[1] * 6]
    assert [entry.name for entry in tmp_path.iterdir()] == ["table.csv"]


def test_a_node_of_another_robot_is_refused(arm: Robot) -> None:
    table = make_measurements(["q1", "d2"], [[0, 0]], tcp="flange", displacement=np.ones((1, 6)))
    with pytest.raises(BeamstiffError, match="point: found 'flange', expected a node of 'arm'"):
        measurements_to_csv(table, arm)


def test_metadata_of_several_lines_is_refused(arm: Robot) -> None:
    table = make_measurements(
        ["q1", "d2"], [[0, 0]], tcp="tip", displacement=np.ones((1, 6)), metadata={"note": "a\nb"}
    )
    with pytest.raises(BeamstiffError, match="one line of printable text"):
        measurements_to_csv(table, arm)


@given(degrees=st.lists(st.floats(-360, 360), min_size=1, max_size=5), mm=st.floats(-5e3, 5e3))
def test_joints_are_written_in_the_units_they_were_read_in(
    degrees: list[float], mm: float, arm: Robot
) -> None:
    text = "".join(f"{value!r},{mm!r},0\n" for value in degrees)
    read = parse_measurements(f"q1 [deg],d2 [mm],dx\n{text}", arm)
    assert dict(read.units) == {"q1": "deg", "d2": "mm"}
    written = measurements_to_csv(read, arm)
    assert written.startswith("q1 [deg],d2 [mm],fx [N]")
    np.testing.assert_allclose(parse_measurements(written, arm).q, read.q, rtol=1e-15, atol=0)


def test_a_short_decimal_stays_one(arm: Robot) -> None:
    read = parse_measurements("q1 [deg],d2 [mm],dx\n-14.9,0.3,0\n87.7,1234.5,0\n", arm)
    rows = measurements_to_csv(read, arm).splitlines()[1:]
    assert [row.split(",")[:2] for row in rows] == [["-14.9", "0.3"], ["87.7", "1234.5"]]


@pytest.mark.parametrize("swapped", ["path first", "no path"])
def test_arguments_of_other_types_say_what_was_expected(tmp_path: Path, arm: Robot, swapped: str) -> None:
    table = make_measurements(["q1", "d2"], [[0, 0]], tcp="tip", displacement=np.ones((1, 6)))
    file = tmp_path / "out.csv"
    arguments = (str(file), table, arm) if swapped == "path first" else (table, 3, arm)
    with pytest.raises(BeamstiffError, match=r"expected (measurements|the path of a CSV file)"):
        write_measurements(*arguments)
    assert not file.exists()
