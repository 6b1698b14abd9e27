"""Process models from YAML, and loads that are not a beam's."""

from dataclasses import replace

import numpy as np
import pytest

from beamstiff.compensation.path import ToolPath
from beamstiff.compensation.process.cantilever import Cantilever
from beamstiff.compensation.process.files import parse_process, process_to_yaml
from beamstiff.compensation.process.load import CuttingTable
from beamstiff.errors import BeamstiffError

BEAM = """\
kind: cantilever
length: 585 mm
width: 50 mm
thickness: 14 mm
E: 69 GPa
clamp:
  at: [2285 mm, 0, 900 mm]
  x: [-2, 0, 0]
  z: [0, 0, 1]
friction: 0.15
"""
TABLE = """\
kind: cutting-table
variable: depth
values: [0 mm, 2 mm, 4 mm]
fx: [0 N, -100 N, -300 N]
fz: [0, 50, 100]
frame: FRAME
"""
FORCES = TABLE.replace("FRAME", "base")


def straight_path(columns: dict[str, list[float]] | None = None) -> ToolPath:
    """Return three targets along y, the tool's z along the base's x."""
    poses = np.tile(np.eye(4), (3, 1, 1))
    poses[:, :3, :3] = [[0, 0, 1], [0, 1, 0], [-1, 0, 0]]
    poses[:, 1, 3] = [0.0, 0.1, 0.2]
    given = {name: np.array(values) for name, values in (columns or {}).items()}
    return ToolPath("p", ("A", "B", "C"), np.arange(3), poses, np.ones(3, dtype=np.bool_), columns=given)


def test_a_beam_is_read_with_its_units() -> None:
    beam = parse_process(BEAM)
    assert isinstance(beam, Cantilever)
    assert (beam.length, beam.width, beam.thickness, beam.modulus) == (0.585, 0.05, 0.014, 69e9)
    assert beam.method == "incremental"
    np.testing.assert_allclose(beam.clamp[:3, :3], np.diag([-1, -1, 1]), atol=1e-15)
    np.testing.assert_allclose(beam.clamp[:3, 3], [2.285, 0, 0.9])


WHOLE = """\
kind: together
parts:
  - {kind: constant, fz: -920 N, mx: 3}
  - {kind: load-cell, gain: 1.03, turn: [0, 1 deg, -0.5 deg]}
  - {kind: path}
  - kind: together
    parts:
      - {kind: cantilever, length: 585 mm, width: 50 mm, thickness: 14 mm, E: 69 GPa, friction: 0.125,
         clamp: {at: [2.285, 0, 0.9], x: [-1, 0, 0], z: [0, 0.6, 0.8]}}
      - {kind: cutting-table, variable: y, values: [0 mm, 150 mm], fx: [-100, -300], frame: tool}
"""


def test_a_written_process_is_the_same_load() -> None:
    process = parse_process(WHOLE)
    again = parse_process(text := process_to_yaml(process, "# learned\n"))
    assert text.startswith("# learned\nkind: together\n")
    assert 'E: "69 GPa"' in text
    path = straight_path()
    path.poses[:, :3, 3] = [[1.9, 0.0, 0.895], [1.92, 0.005, 0.895], [1.95, 0.01, 0.895]]
    path = replace(path, wrench=np.arange(18.0).reshape(3, 6))
    expected = process.wrench(path.poses, path)
    assert np.abs(expected[:, :3] - [-100, 0, -920]).max() > 100  # the beam pushes too
    np.testing.assert_allclose(again.wrench(path.poses, path), expected, rtol=1e-5, atol=1e-3)


@pytest.mark.parametrize(
    ("frame", "expected"),
    [
        ("base", [-200.0, 0.0, 75.0]),
        ("tool", [75.0, 0.0, 200.0]),  # tool x is the base's -z, tool z its x
        ("feed", [75.0, -200.0, 0.0]),  # feed x is the base's y, feed z the tool's z
    ],
)
def test_a_table_of_cutting_forces_is_interpolated_in_its_frame(frame: str, expected: list[float]) -> None:
    table = parse_process(TABLE.replace("FRAME", frame))
    path = straight_path({"depth": [0.003] * 3})
    np.testing.assert_allclose(table.wrench(path.poses, path)[:, :3], [expected] * 3, atol=1e-12)


@pytest.mark.parametrize(("variable", "at"), [("way", [0.0, 0.1, 0.2]), ("y", [0.0, 0.1, 0.2])])
def test_a_table_may_be_over_the_way_or_a_coordinate(variable: str, at: list[float]) -> None:
    table = CuttingTable(variable, np.array([0.0, 1.0]), np.array([[0.0] * 6, [100.0] + [0.0] * 5]))
    path = straight_path()
    np.testing.assert_allclose(table.wrench(path.poses, path)[:, 0], 100 * np.array(at))


def test_outside_the_table_there_is_no_force() -> None:
    table = parse_process(TABLE.replace("FRAME", "base"))
    path = straight_path({"depth": [0.001, 0.0041, 0.001]})
    with pytest.raises(BeamstiffError, match=r"p:1: B: found depth = 0.0041, expected 0 to 0.004"):
        table.wrench(path.poses, path)
    with pytest.raises(BeamstiffError, match=r"found no column 'depth'.*known: depht, way"):
        table.wrench(path.poses, straight_path({"depht": [0, 0, 0]}))


def test_along_the_tool_there_is_no_feed_frame() -> None:
    table = parse_process(TABLE.replace("FRAME", "feed"))
    path = straight_path({"depth": [0.001] * 3})
    path.poses[:, :3, 3] = [[0, 0, 0], [1, 0, 0], [2, 0, 0]]
    with pytest.raises(BeamstiffError, match="A: the direction of travel is not known or along the tool"):
        table.wrench(path.poses, path)


def test_loads_add_up() -> None:
    parts = "[{kind: constant, fz: -920 N}, {kind: constant, fz: 20, mx: 1}]"
    both = parse_process(f"{{kind: together, parts: {parts}}}")
    path = straight_path()
    np.testing.assert_allclose(both.wrench(path.poses, path), [[0, 0, -900, 1, 0, 0]] * 3)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("kind: beam", r"<text>:1: kind: found 'beam', expected one of cantilever"),
        ("[1, 2]", r"<text>:1: found \[1, 2\], expected keys and values"),
        ("{}", r"<text>:1: kind: is missing"),
        (BEAM.replace("585 mm", "585 N"), r"<text>:2: length: found the unit 'N', expected a unit of length"),
        (BEAM.replace("585 mm", "0"), r"<text>:2: length: found 0, expected more than 0"),
        (
            BEAM.replace("friction: 0.15", "friction: -1"),
            r"<text>:10: friction: found -1, expected 0 or more",
        ),
        (
            BEAM.replace("friction", "frction"),
            r"<text>:10: frction: unknown key \(did you mean 'friction'\?\)",
        ),
        (BEAM.replace("[-2, 0, 0]", "[0, 0, 0]"), r"<text>:8: clamp.x: found a zero vector"),
        (BEAM.replace("[-2, 0, 0]", "[0, 0, 3]"), r"<text>:9: clamp.z: found the direction of x"),
        (
            BEAM.replace("[-2, 0, 0]", "[1, 0]"),
            r"<text>:8: clamp.x: found .* expected more values in the list",
        ),
        (BEAM + "method: exact", r"<text>:11: method: found 'exact', expected 'incremental' or 'eul"),
        (FORCES.replace("2 mm, 4 mm", "2 mm, 1 mm"), r"<text>:3: values: found values that do not rise"),
        (FORCES.replace("fz: [0, 50, 100]", "fz: [0, 50]"), r"<text>:5: fz: found .* list of 3 numbers"),
        (
            TABLE.replace("FRAME", "wrist"),
            r"<text>:6: frame: found 'wrist', expected 'base', 'tool' or 'feed'",
        ),
        ("kind: constant\nfz: -920 mm", r"<text>:2: fz: found the unit 'mm', expected a unit of force"),
        ("{kind: together, parts: [{kind: constant, fx: a}]}", r"parts.0.fx: found 'a'"),
    ],
)
def test_a_broken_process_is_named(text: str, message: str) -> None:
    with pytest.raises(BeamstiffError, match=message):
        parse_process(text)
