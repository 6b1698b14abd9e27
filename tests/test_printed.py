"""What pages show is compared word by word, and numbers to their last digit, or to half a percent."""

import pytest

from tests.printed import prints

SHOWN = "12 rows leave 0.069 mm: (23 %)\n  of -1.50 N\n"


@pytest.mark.parametrize("printed", ["0.069 mm: (23 %)", "0.070 mm: (22 %)", "0.068 mm:\n(24\n%)"])
def test_the_last_digit_may_be_another_one(printed: str) -> None:
    assert prints(SHOWN, f"12 rows leave {printed} of -1.50 N\n")


@pytest.mark.parametrize(
    "printed",
    [
        "12 rows leave 0.071 mm: (23 %) of -1.50 N",
        "12 rows leave 0.069 mm: (25 %) of -1.50 N",
        "13 rows leave 0.069 mm: (23 %) of -1.50 N",
        "12 rows leave 0.069 mm: (23 %) of 1.50 N",
        "12 rows leave 0.069 m: (23 %) of -1.50 N",
        "12 rows leave 0.069 mm: (23 %) of -1.50 N, or not",
        "12 rows leave 0.069 mm: (23 %)",
        "12 rows leave 0.0694 mm: (23 %) of -1.50 N",
        "12 rows leave 0.069 mm: (23 %) of -1.5 N",
        "12 rows leave 0.069 mm: (23.4 %) of -1.50 N",
        "12 rows leave .069 mm: (23 %) of -1.50 N",
    ],
)
def test_all_else_may_not(printed: str) -> None:
    assert not prints(SHOWN, printed)


def test_dots_stand_for_anything() -> None:
    assert prints("rows leave\n...of -1.5 N", "rows leave\n0.1 mm, and\nmore of -1.5 N")
    assert not prints("rows leave\n...of -1.5 N", "rows leave\n0.1 mm, and\nmore of -1.9 N")


@pytest.mark.parametrize(
    ("shown", "printed"), [("0.00 mm", "-0.00 mm"), ("0.9.1", "0.8.1"), ("0 rows", "1 rows")]
)
def test_neither_is_a_zero_with_a_sign_nor_a_version_a_number_that_was_rounded(
    shown: str, printed: str
) -> None:
    assert prints(shown, shown)
    assert not prints(shown, printed)


def test_both_ends_of_an_interval_are_rounded() -> None:
    assert prints("closes (67 to 97\n%)", "closes (66 to 98 %)")
    assert not prints("closes (67 to 97 %)", "closes (65 to 97 %)")


def test_long_numbers_agree_to_half_a_percent() -> None:
    assert prints("4.922e-10 rad", "4.915e-10 rad")
    assert not prints("4.922e-10 rad", "4.822e-10 rad")
    assert not prints("4.922e-10 rad", "4.922e-11 rad")
