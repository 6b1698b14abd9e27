"""Tables with readings of sockets, ball bars, planes and dial gauges."""

import numpy as np
import pytest

from beamstiff import BeamstiffError, load_robot
from beamstiff.measure.instruments import axes_along, target
from beamstiff.measure.reader import parse_measurements
from beamstiff.measure.rows import concatenate
from beamstiff.measure.writer import measurements_to_csv

ROBOT = load_robot("kr240-2")
JOINTS = "q1 [deg],q2 [deg],q3 [deg],q4 [deg],q5 [deg],q6 [deg]"
AT = "0,100,-120,0,20,0"
ABSOLUTE = f"""# sigma_position: 0.01 mm
{JOINTS},instrument,target,direction,length [mm],reading [mm],target_x [mm],target_y [mm],target_z [mm]
{AT},socket,S1,,,,,,
{AT},ball-bar,B1,,300,0.05,1000,0,800
{AT},plane,,,,0,,,
{AT},gauge,G1,0 3 4,,-1.5,,,
"""


def test_each_instrument_says_what_is_sought_of_its_set_up() -> None:
    table = parse_measurements(ABSOLUTE, ROBOT)
    sought = {one.name: one.sought for one in table.targets}
    assert sought == {
        "S1": ("x", "y", "z"),
        "B1": (),
        "plane": ("offset", "tilt1", "tilt2"),
        "G1": ("offset",),
    }
    assert table.kind == "absolute"
    assert table.measured_mask.sum(axis=1).tolist() == [3, 1, 1, 1]
    assert table.measured[1:, 0].tolist() == [5e-5, 0.0, -1.5e-3]
    np.testing.assert_allclose(table.direction[3], [0, 0.6, 0.8])
    assert not table.by_tracker.any()


def test_written_tables_are_read_back() -> None:
    table = parse_measurements(ABSOLUTE, ROBOT)
    again = parse_measurements(measurements_to_csv(table, ROBOT), ROBOT)
    np.testing.assert_array_equal(again.measured, table.measured)
    np.testing.assert_allclose(again.sigma, table.sigma)
    assert [one.sought for one in again.targets] == [one.sought for one in table.targets]
    assert again.targets[1].place == pytest.approx(table.targets[1].place)
    assert again.targets[3].normal == pytest.approx(table.targets[3].normal)


def test_displacements_along_one_direction_are_projections() -> None:
    text = (
        f"{JOINTS},fz,instrument,direction,dreading [mm]\n{AT},-500,gauge,-z,0.4\n{AT},-500,gauge,1 1 0,0.1\n"
    )
    table = parse_measurements(text, ROBOT)
    assert table.kind == "displacement"
    assert len(table.targets) == 2  # another direction is another set-up
    moved = np.random.default_rng(0).standard_normal((2, 6, 4))
    read = table.along(moved)
    np.testing.assert_allclose(read[0, 0], -moved[0, 2])
    np.testing.assert_allclose(read[1, 0], (moved[1, 0] + moved[1, 1]) / np.sqrt(2))
    np.testing.assert_allclose(read[:, 3:], moved[:, 3:])
    np.testing.assert_allclose(np.linalg.norm(read[:, :3], axis=1), np.linalg.norm(moved[:, :3], axis=1))


def test_axes_are_orthonormal_and_the_first_is_the_direction() -> None:
    direction = np.random.default_rng(1).standard_normal((20, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    axes = axes_along(direction)
    np.testing.assert_allclose(axes[:, 0], direction)
    np.testing.assert_allclose(axes @ axes.swapaxes(1, 2), np.tile(np.eye(3), (20, 1, 1)), atol=1e-12)


@pytest.mark.parametrize(
    ("row", "message"),
    [
        ("sockett,S,,,", "instrument: found 'sockett', expected one of .*socket"),
        ("gauge,G,,,0.1", "direction: found none"),
        ("gauge,G,north,,0.1", "direction: found 'north'"),
        ("socket,S,z,,", "direction: found one at a socket"),
        ("socket,S,,,0.2", "reading: found 0.0002 m at a socket"),
        ("ball-bar,B,,-3,0.1", "length: found -0.003 m"),
        ("socket,tcp,,,", None),
        (",,,,0.1", "instrument: found none beside a reading"),
    ],
)
def test_what_cannot_be_meant_is_refused(row: str, message: str | None) -> None:
    text = f"{JOINTS},instrument,target,direction,length [mm],reading [mm]\n{AT},{row}\n{AT},socket,S2,,,\n"
    if message is None:
        text, message = text.replace("tcp", ROBOT.tcp), f"target: found '{ROBOT.tcp}'"
    with pytest.raises(BeamstiffError, match=message):
        parse_measurements(text, ROBOT)


def test_a_socket_has_no_displacement_and_a_name_one_set_up() -> None:
    with pytest.raises(BeamstiffError, match="a ball that is held does not move"):
        parse_measurements(f"{JOINTS},instrument,dreading\n{AT},socket,0\n", ROBOT)
    text = f"{JOINTS},instrument,target,direction,reading\n{AT},gauge,G,z,0\n{AT},gauge,G,x,0\n"
    with pytest.raises(BeamstiffError, match="unlike in line 2"):
        parse_measurements(text, ROBOT)
    first = parse_measurements(f"{JOINTS},instrument,target,direction,reading\n{AT},gauge,G,z,0\n", ROBOT)
    other = parse_measurements(f"{JOINTS},instrument,target,direction,reading\n{AT},gauge,G,x,0\n", ROBOT)
    assert len(concatenate([first, first]).targets) == 1
    with pytest.raises(BeamstiffError, match="target 'G' is not the same in both"):
        concatenate([first, other])
    assert target("wall", "plane", normal=(2, 0, 0)).sought == ("offset",)
