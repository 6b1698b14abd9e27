"""Numbers in the place and form of others."""

import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from beamstiff.compensation.editing import Slot, line_of, read_bytes, replaced, rewritten
from beamstiff.errors import BeamstiffError

from .programs import number_texts


@given(number_texts(3000.0), st.floats(-3000.0, 3000.0), st.integers(0, 6))
def test_a_rewritten_number_is_right_to_half_its_last_decimal(text: str, value: float, decimals: int) -> None:
    assert abs(float(rewritten(text, value, decimals)) - value) <= 0.5001 * 10.0**-decimals


@given(number_texts(3000.0), st.integers(0, 6))
def test_an_unchanged_number_keeps_its_text(text: str, decimals: int) -> None:
    assert rewritten(text, float(text), decimals) == text


@given(number_texts(3000.0), st.floats(-3000.0, 3000.0))
def test_a_number_loses_no_decimals_and_keeps_its_exponent(text: str, value: float) -> None:
    new = rewritten(text, value, 3)
    for sign in "eE":
        assert (sign in new) == (sign in text)
    if "e" not in text.lower():
        decimals = len(text.partition(".")[2])
        assert len(new.partition(".")[2]) >= decimals


@pytest.mark.parametrize(
    ("text", "value", "expected"),
    [
        ("1500", 1500.4321, "1500.432"),
        ("1500.", 1499.9, "1499.900"),
        ("-0.5", 0.25, "0.250"),
        ("+1.0", 2.0, "+2.000"),
        ("+1.0", -2.0, "-2.000"),
        (".5", 0.75, ".750"),
        ("-0012.50", -3.25, "-0003.250"),
        ("1.5e3", 1500.25, "1.500250e3"),
        ("1.5E-01", 0.1625, "1.63E-01"),
        ("1.50E+002", -99.5, "-9.9500E+001"),
        ("0.0", -0.0001, "0.0"),
    ],
)
def test_the_form_of_a_number_survives(text: str, value: float, expected: str) -> None:
    assert rewritten(text, value, 3) == expected


def test_numbers_in_a_column_stay_aligned() -> None:
    text = "X    1.5 Y  -20.25 Z"
    slots = [Slot(5, "1.5", 1.0, 3), Slot(12, "-20.25", 1.0, 3)]
    new = replaced(text, zip(slots, (-1.75, 5.0), strict=True))
    assert new == "X -1.750 Y   5.000 Z"
    assert len(new) == len(text)


def test_a_tab_in_front_of_a_number_stays() -> None:
    assert replaced("X\t1.5", [(Slot(2, "1.5", 1.0, 3), 2.0)]) == "X\t2.000"


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_lines_are_counted_whatever_their_ends(end: str) -> None:
    text = end.join("abcd")
    assert [line_of(text, text.index(letter)) for letter in "abcd"] == [1, 2, 3, 4]


@pytest.mark.parametrize(
    ("content", "message"),
    [(b"", "is empty"), (b"\xff\xfeL\0", "UTF-16"), (b"LIN\0", "binary"), (None, "no such file")],
)
def test_files_that_are_no_text_are_refused(tmp_path: Path, content: bytes | None, message: str) -> None:
    path = tmp_path / "a.src"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(BeamstiffError, match=message):
        read_bytes(path)


def test_a_folder_is_no_file(tmp_path: Path) -> None:
    with pytest.raises(BeamstiffError, match=f"^{re.escape(str(tmp_path))}: is a folder, expected a file$"):
        read_bytes(tmp_path)
