"""Cells of text to numbers: whole columns at once, cell by cell only to say what is wrong."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from beamstiff.errors import BeamstiffError, shown
from beamstiff.se3 import Array

_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?", re.ASCII)
_MISSING = {"nan", "na", "n/a", "null", "none", "-", "--", "#n/a", "?", "inf", "-inf", "+inf", "infinity"}
# what a number may be made of; float() also takes nan, inf, 1_000 and digits of other scripts
_PLAIN = b"0123456789+-.eE \t"


class CellError(BeamstiffError):
    """A cell that holds no number; `row` is its place in the column."""

    def __init__(self, row: int, message: str) -> None:
        self.row = row
        super().__init__(message)


def numbers(cells: Sequence[str], *, may_be_empty: bool, decimal_comma: bool = False) -> Array:
    """Return the numbers of a column, NaN exactly where a cell is empty.

    `decimal_comma`: numbers are written ``1,5``.
    """
    if decimal_comma:
        if any("." in cell for cell in cells):
            return _one_by_one(cells, may_be_empty, decimal_comma)
        cells = [cell.replace(",", ".") for cell in cells]
    if "".join(cells).encode("utf-8", "replace").translate(None, _PLAIN):
        return _one_by_one(cells, may_be_empty, decimal_comma)
    try:
        values = np.fromiter(map(float, cells), dtype=np.float64, count=len(cells))
    except ValueError:
        return _one_by_one(cells, may_be_empty, decimal_comma)
    if not np.isfinite(values).all():
        return _one_by_one(cells, may_be_empty, decimal_comma)
    return values


def _one_by_one(cells: Sequence[str], may_be_empty: bool, decimal_comma: bool) -> Array:
    values = np.full(len(cells), np.nan)
    for row, cell in enumerate(cells):
        text = cell.strip()
        if not text:
            if not may_be_empty:
                raise CellError(row, "found an empty cell, expected a number")
            continue
        if decimal_comma:
            if "." in text and "," in text:
                raise CellError(row, f"found {shown(text)}, expected a number with one decimal comma")
            if "." in text:
                raise CellError(row, f"found {shown(text)}, expected a decimal comma as declared")
            text = text.replace(",", ".")
        if not _NUMBER.fullmatch(text):
            raise CellError(row, f"found {shown(cell.strip())}, expected {_expected(text, may_be_empty)}")
        values[row] = float(text)
        if not np.isfinite(values[row]):
            raise CellError(row, f"found {shown(text)}, expected a finite number")
    return values


def _expected(text: str, may_be_empty: bool) -> str:
    if re.fullmatch(r"[+-]?\d+,\d+", text):
        return "a number with a decimal point (or declare '# decimal: comma' before the header)"
    if text.lower() in _MISSING:
        return "a number, or an empty cell where there is none" if may_be_empty else "a finite number"
    if re.fullmatch(r"[+-]?[\d.]+\s*[A-Za-zµ°*/]+", text):
        return "a number; its unit stands in the header, like dx [mm]"
    return "a number"
