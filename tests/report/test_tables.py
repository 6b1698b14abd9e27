import io

import pytest
from rich.console import Console

from beamstiff.report.tables import scale_of, table, worth

TITLE = "Where: share of the gap above noise that each place could account for"


def printed(width: int) -> list[str]:
    made = table(TITLE, "place", "share")
    made.add_row("joint_a3", "98 %")
    console = Console(width=width, file=io.StringIO())
    console.print(made)
    return [line.rstrip() for line in console.file.getvalue().splitlines()]


def test_a_title_wider_than_its_table_stays_on_one_line() -> None:
    lines = printed(80)
    assert lines[0] == TITLE
    assert lines[1].split() == ["place", "share"]
    assert lines[-1].split() == ["joint_a3", "98", "%"]


def test_where_there_is_no_terminal_the_widest_text_wraps_at_100_columns_and_no_number_does() -> None:
    why = "the rows say neither when nor how warm " * 4
    made = table("", "effect", "why", "a, mm", "b, mm", left=2)
    made.add_row("thermal-drift", why, "1234.56789", "0.000123")
    console = Console(width=200, file=io.StringIO())
    console.print(made)
    lines = console.file.getvalue().splitlines()
    assert max(map(len, lines)) == 100
    assert lines[2].split()[-2:] == ["1234.56789", "0.000123"]
    assert " ".join(" ".join(line.split()) for line in lines[2:]).count("neither") == 4
    wide = table("", *(f"column {number}" for number in range(20)), left=0)
    wide.add_row(*["1234567.8"] * 20)
    console = Console(width=300, file=io.StringIO())
    console.print(wide)
    assert console.file.getvalue().count("1234567.8") == 20


def test_a_title_wider_than_the_terminal_breaks_and_loses_nothing() -> None:
    lines = printed(30)
    assert " ".join(lines[:3]).startswith(TITLE)


@pytest.mark.parametrize(
    ("values", "unit", "shown"),
    [([1.481e-4, 3e-6], "rad", (1e3, "mrad")), ([1.5, 1e-3], "m", (1.0, "m"))],
)
def test_small_angles_and_lengths_have_small_units(
    values: list[float], unit: str, shown: tuple[float, str]
) -> None:
    assert scale_of(values, unit) == shown


def test_a_value_has_the_digits_that_its_standard_deviation_leaves() -> None:
    assert worth(0.0005604, 1e-4) == ("0.00056", "0.0001")
    assert worth(3.1, 20.0) == ("3", "20")
