"""What pages show is compared word by word, and numbers to their last digit."""

from __future__ import annotations

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
    ],
)
def test_all_else_may_not(printed: str) -> None:
    assert not prints(SHOWN, printed)


def test_dots_stand_for_anything() -> None:
    assert prints("rows leave\n...of -1.5 N", "rows leave\n0.1 mm, and\nmore of -1.5 N")
    assert not prints("rows leave\n...of -1.5 N", "rows leave\n0.1 mm, and\nmore of -1.9 N")
