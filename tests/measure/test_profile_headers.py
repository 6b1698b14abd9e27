"""Headers and what a profile says of them. Truth: the cells written here by hand."""

import pytest

from beamstiff.errors import BeamstiffError
from beamstiff.measure.foreign_tables import guessed_profile
from beamstiff.measure.point_lists import parse_points
from beamstiff.measure.profiles import parse_profile

LIST = "Point;J1 [deg];X [mm];Y [mm];Z [mm];load [kg]\nP1;90;1000;0;-2;30\n"
PROFILE = """separator: semicolon
columns: {pose: Point, q1: "J1 [deg]", x: "X [mm]", y: "Y [mm]", z: "Z [mm]", fz: "load [kg]"}
units: {joints: deg, length: mm, fz: kg}
"""


def test_a_name_without_its_unit_is_taken_where_it_stands_once() -> None:
    short = PROFILE.replace('"J1 [deg]"', "J1").replace('"load [kg]"', "load")
    assert parse_points(LIST, parse_profile(short)).text == parse_points(LIST, parse_profile(PROFILE)).text
    twice = LIST.replace("Point", "J1 [rad]")
    with pytest.raises(BeamstiffError, match=r"no column 'J1' in the header, which has 'J1 \[rad\]', 'J1"):
        parse_points(twice, parse_profile(short.replace("pose: Point, ", "")))


def test_units_may_stand_in_a_row_of_their_own() -> None:
    below = "Point;J1;X;Y;Z;load\n;deg;mm;[mm];mm;kg\nP1;90;1000;0;-2;30\n"
    bare = PROFILE.replace(" [deg]", "").replace(" [mm]", "").replace(" [kg]", "")
    assert parse_points(below, parse_profile(bare)).text == parse_points(LIST, parse_profile(PROFILE)).text
    with pytest.raises(BeamstiffError, match=r"t:1: x: found the unit 'm' .*'X \[mm\]' in the header"):
        parse_points(below, parse_profile(bare.replace("length: mm", "length: m")), "t")
    rows = [line.split(";") for line in below.splitlines()[1:]]
    guessed = guessed_profile(below.splitlines()[0].split(";"), ";", ["q1"], rows)
    assert "columns: {pose: Point, q1: J1, x: X, y: Y, z: Z, fz: load}" in guessed
    assert "units: {joints: deg, length: mm, fz: kg}" in guessed


def test_a_missing_column_is_told_with_those_that_there_are() -> None:
    with pytest.raises(BeamstiffError, match=r"no column 'Pointt' .* has 'Point', .*did you mean 'Point'"):
        parse_points(LIST, parse_profile(PROFILE.replace("Point", "Pointt")))


@pytest.mark.parametrize("separator", ["comma", "tab", "'::'"])
def test_another_separator_is_suspected_where_it_finds_the_column(separator: str) -> None:
    profile = parse_profile(PROFILE.replace("semicolon", separator))
    with pytest.raises(BeamstiffError, match=r"t:1: pose: .*as separated, but with `separator: semicolon`"):
        parse_points(LIST, profile, "t")


@pytest.mark.parametrize(
    ("right", "wrong", "message"),
    [
        ("length: mm", "length: m", r"t:1: x: found the unit 'm' .*'X \[mm\]'.*`units: \{length: mm\}`"),
        ("joints: deg", "joints: rad", r"t:1: q1: found the unit 'rad' .*`units: \{joints: deg\}`"),
        ("joints: deg", "joints: mm", r"t:1: q1: found the unit 'mm' .*`units: \{joints: deg\}`"),
        ("fz: kg", "fz: N", r"t:1: fz: found the unit 'N' .*'load \[kg\]'.*`units: \{fz: kg\}`"),
        ("fz: kg", "fz: lb", r"t:1: fz: found the unit 'lb' .*`units: \{fz: kg\}`"),
    ],
)
def test_a_unit_that_contradicts_the_header_is_refused(right: str, wrong: str, message: str) -> None:
    with pytest.raises(BeamstiffError, match=message):
        parse_points(LIST, parse_profile(PROFILE.replace(right, wrong)), "t")


@pytest.mark.parametrize(("cell", "unit"), [("load [kgf]", "kg"), ("load (kg)", "kg"), ("load [A]", "N")])
def test_the_same_size_and_brackets_that_hold_no_unit_are_no_contradiction(cell: str, unit: str) -> None:
    text, profile = LIST.replace("load [kg]", cell), PROFILE.replace("load [kg]", cell)
    assert parse_points(text, parse_profile(profile.replace("fz: kg", f"fz: {unit}"))).count == 1


def test_by_numbers_a_header_that_is_wrong_is_passed_over() -> None:
    numbers = "separator: semicolon\nskip: 1\ncolumns: {x: 3, y: 4, z: 5}\nunits: {length: m}\n"
    assert parse_points(LIST, parse_profile(numbers)).text.splitlines()[1] == "1000.0,0.0,-2.0"
