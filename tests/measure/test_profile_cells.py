"""Texts cut and read as a profile says. Truth: numbers written here by hand, and the standard gravity."""

import csv

import pytest

from beamstiff.errors import BeamstiffError
from beamstiff.measure.point_lists import PointTable, parse_points, signals_of
from beamstiff.measure.profiles import parse_profile

COLUMNS = "columns: {point: 2, pose: 3, x: 4, y: 5, z: 6}\nunits: {length: mm}\n"
SEPARATED = "columns: {point: 1, x: 2, y: 3, z: 4}\nunits: {length: mm}\n"
NAMED = "columns: {point: Name, x: X, y: Y, z: Z}\nunits: {length: mm}\n"
LOADED = "columns: {pose: 1, q1: 2, fz: 3}\nunits: {joints: deg, fz: kg}\n"


def rows(made: PointTable) -> list[list[str]]:
    return list(csv.reader(made.text.splitlines()))[1:]


@pytest.mark.parametrize(
    ("separator", "line"),
    [
        ('["::", comma]', "A::tip::p1, 1000.5, -2, 3e1"),
        ('[comma, "::"]', 'A::tip::p1, "1000.5", -2, 3e1'),
        ('["::", whitespace]', "A::tip :: p1 1000.5   -2 3e1"),
        ('[":", "::"]', "A::tip:p1:1000.5:-2::3e1"),
        ('["::"]', "A::tip::p1::1000.5::-2::3e1"),
        ('"|"', "A|tip|p1|1000.5|-2|3e1"),
        ('";"', "A;tip;p1;1000.5;-2;3e1"),
        ('" "', "A tip p1  1000.5 -2 3e1"),
        ("[whitespace]", "A tip p1  1000.5 -2 3e1"),
        ('"\\t"', "A\ttip\tp1\t1000.5\t-2\t3e1"),
    ],
)
def test_a_separator_is_a_name_a_text_or_several_of_these(separator: str, line: str) -> None:
    profile = parse_profile(f"separator: {separator}\n{COLUMNS}")
    assert rows(parse_points(line, profile)) == [["tip", "p1", "1.0005", "-0.002", "0.03"]]


def test_in_quotes_nothing_separates() -> None:
    profile = parse_profile(f'separator: ["::", comma]\n{COLUMNS}')
    ((point, pose, *_),) = rows(parse_points('A::"a::b, c", d,1,2,3', profile))
    assert (point, pose) == ("a::b, c", "d")


@pytest.mark.parametrize("separator", ["koma", '"."', '"-"', '"1"', '""', "[]", "5", '["::", koma]', "[[a]]"])
def test_a_separator_that_names_or_cuts_numbers_is_refused(separator: str) -> None:
    with pytest.raises(BeamstiffError, match=r"p\.yaml:1: separator: found .*or the text between cells"):
        parse_profile(f"separator: {separator}\n{COLUMNS}", "p.yaml")


def test_a_short_row_says_how_it_was_cut() -> None:
    with pytest.raises(BeamstiffError, match="found 4 cells separated by '::' or comma, expected at least 6"):
        parse_points("A::tip,1,2\n", parse_profile(f'separator: ["::", comma]\n{COLUMNS}'))


def test_a_row_with_more_cells_than_the_header_is_refused() -> None:
    text = "Name,X,Y,Z\nA,1.5,2.5,3.5,,\nB,1,5,2,5,3,5\n"
    message = r"t:3: found 7 cells, expected 4 as in the header \('Name' to 'Z'\); decimal commas .*profile"
    with pytest.raises(BeamstiffError, match=message):
        parse_points(text, parse_profile(NAMED), "t")
    with pytest.raises(BeamstiffError, match=r"expected 4 as in the header \('Name' to 'Z'\)\Z"):
        parse_points(text.replace(",", ";"), parse_profile(f"separator: semicolon\n{NAMED}"), "t")
    trailing = text[: text.index("B")]
    assert rows(parse_points(trailing, parse_profile(NAMED))) == [["A", "0.0015", "0.0025", "0.0035"]]


@pytest.mark.parametrize("decimal", ["point", "comma"])
@pytest.mark.parametrize(
    "lines",
    [
        "A,1000,5,-233,25,3,125\nB,-1,5,2,0,3,1\n",
        "A, 6051,4411, 159,8802, 1634,2532, late\n",
    ],
)
def test_numbers_that_decimal_commas_cut_in_two_are_refused(lines: str, decimal: str) -> None:
    profile = parse_profile(f"decimal: {decimal}\n{SEPARATED}")
    with pytest.raises(BeamstiffError, match="t:1: found only digits behind every comma: decimal commas"):
        parse_points(lines, profile, "t")


@pytest.mark.parametrize(
    "further",
    ["", ",7", ",7,8", ",0.02,0.02,0.03", ",7,8,9.5", ",0.5,8,9", ",-7,8,9", ",7,8,late", ",,,"],
)
def test_a_list_of_whole_numbers_may_have_further_columns(further: str) -> None:
    made = parse_points(f"A,1000,2000,3000{further}\n", parse_profile(SEPARATED))
    assert rows(made) == [["A", "1.0", "2.0", "3.0"]]


def test_one_row_of_decimal_points_tells_that_no_comma_is_one() -> None:
    made = parse_points("A,1000,2000,3000,7,8,9\nB,1.5,2,3,4,5,6\n", parse_profile(SEPARATED))
    assert rows(made)[1] == ["B", "0.0015", "0.002", "0.003"]


@pytest.mark.parametrize(
    ("cell", "message"),
    [
        ("6051,4411", r"t:1: x: .*with a decimal point \(or declare `decimal: comma` in the profile\)"),
        ("6051 mm", "t:1: x: .*its unit stands under `units` of the profile"),
    ],
)
def test_advice_on_a_list_names_the_keys_of_its_profile(cell: str, message: str) -> None:
    profile = parse_profile(f"separator: semicolon\n{SEPARATED}")
    with pytest.raises(BeamstiffError, match=message):
        parse_points(f"A;{cell};2;3\n", profile, "t")


def test_a_hung_mass_pulls_down_with_its_weight() -> None:
    made = parse_points("1,10,-0.00\n2,10,122.32\n3,10,-0.01\n4,10,\n", parse_profile(LOADED))
    assert [row[-1] for row in rows(made)] == ["0.0", repr(-9.80665 * 122.32), "0.0", ""]
    assert made.text.startswith("pose,q1 [rad],fz [N]\n")
    assert made.notes == ("column 3: masses, taken as weight along -z of the base",)
    grams = parse_profile(LOADED.replace("fz: kg", "force: g"))
    assert rows(parse_points("1,10,500\n", grams))[0][-1] == repr(-9.80665 * 0.5)


def test_a_force_stays_as_it_is() -> None:
    made = parse_points("1,10,-0.00\n2,10,-500\n", parse_profile(LOADED.replace("kg", "N")))
    assert [row[-1] for row in rows(made)] == ["0.0", "-500.0"]
    assert made.notes == ()


def test_a_negative_mass_is_refused() -> None:
    with pytest.raises(BeamstiffError, match=r"t:2: fz: found '-0\.5' kg, expected no negative mass"):
        parse_points("1,10,3\n2,10,-0.5\n", parse_profile(LOADED), "t")


@pytest.mark.parametrize("column", ["fx", "fy"])
def test_a_mass_along_x_or_y_is_refused_with_the_reason(column: str) -> None:
    message = f"{column}: found the unit 'kg', expected a unit of force such as N: .* along -z of the base"
    with pytest.raises(BeamstiffError, match=message):
        parse_profile(LOADED.replace("fz", column))


def test_a_mass_in_a_log_is_a_weight_too() -> None:
    profile = parse_profile("samples: true\ncolumns: {t: 1, q1: 2, fz: 3}\nunits: {t: s, q1: rad, fz: kg}\n")
    _, wrench = signals_of("0,0,10\n1,0,0\n", profile)
    assert wrench.values[:, 2].tolist() == [-9.80665 * 10, 0.0]


@pytest.mark.parametrize(
    ("skipped", "note"),
    [
        (1, "1 row skipped, as `points` does not name them: SMR9"),
        (2, "2 of 11 rows skipped, as `points` does not name them: SMR9"),
    ],
)
def test_many_skipped_rows_are_counted_before_all_else(skipped: int, note: str) -> None:
    base = "base: {B: [0, 0, 0], C: [1, 0, 0], D: [0, 1, 0]}\npoints: {SMR1: tip, SMR2: tip}\n"
    lines = ["B,0,0,0", "C,1000,0,0", "D,0,1000,0"]
    lines += ["SMR9,1,2,3"] * skipped + ["SMR1,1,2,3"] * (11 - skipped)
    notes = parse_points("\n".join(lines), parse_profile(SEPARATED + base)).notes
    assert notes[0 if skipped > 1 else 1] == note
    assert notes[1 if skipped > 1 else 0].startswith("carried to the base frame")
    assert notes[2] == "`points` names what the list lacks: SMR2"


@pytest.mark.parametrize(
    ("cells", "seconds"),
    [
        (("23:59:30", "0:00:15.5", "00:01"), (86370.0, 86415.5, 86460.0)),
        (("2026-11-12 08:00:01", "2026-11-13T00:00"), (28801.0, 86400.0)),
        (("3", "4.5", "5"), (3.0, 4.5, 5.0)),
    ],
)
def test_times_are_numbers_times_of_day_or_dates(cells: tuple[str, ...], seconds: tuple[float, ...]) -> None:
    profile = parse_profile("columns: {t: 1, x: 2, y: 3, z: 4}\nunits: {length: mm, time: s}\npoint: tip\n")
    made = parse_points("\n".join(f"{cell},1,2,3" for cell in cells), profile)
    at = made.text.splitlines()[-len(cells) - 1].split(",").index("t [s]")
    assert tuple(float(row[at]) for row in rows(made)[-len(cells) :]) == seconds


@pytest.mark.parametrize("cells", [("08:03", "8.5"), ("2026-13-12 08:00",)])
def test_what_is_no_time_is_refused(cells: tuple[str, ...]) -> None:
    profile = parse_profile("columns: {t: 1, x: 2, y: 3, z: 4}\nunits: {length: mm, time: s}\npoint: tip\n")
    with pytest.raises(BeamstiffError, match="t: found"):
        parse_points("\n".join(f"{cell},1,2,3" for cell in cells), profile)
