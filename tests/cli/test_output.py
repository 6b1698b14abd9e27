from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from beamstiff.cli.output import check_outputs, json_text
from beamstiff.errors import BeamstiffError

leaves = (
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text()
)
plain = st.recursive(leaves, lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner), max_leaves=30)


@given(plain)
def test_json_is_read_back_the_same(value: Any) -> None:
    assert json.loads(json_text(value)) == value


@pytest.mark.parametrize("value", [float("nan"), float("inf"), [1.0, float("-inf")], {"a": [[float("nan")]]}])
def test_json_never_holds_what_is_no_number(value: Any) -> None:
    with pytest.raises(ValueError, match="not JSON compliant"):
        json_text(value)


def test_a_matrix_has_a_line_a_row() -> None:
    assert json_text([[1, 2], [3, 4]]) == "[\n  [1, 2],\n  [3, 4]\n]"


def test_an_output_must_not_be_an_input_under_another_name(tmp_path: Path) -> None:
    data = tmp_path / "data.csv"
    data.write_text("q1\n")
    (tmp_path / "link.csv").symlink_to(data)
    for other in (str(data), str(tmp_path / "link.csv"), f"{tmp_path}/./data.csv"):
        with pytest.raises(BeamstiffError, match=r"--out .* would overwrite the input"):
            check_outputs([data], None, out=other)
    check_outputs([data], "-", out=str(tmp_path / "other.csv"))
    check_outputs([data], "/dev/null", out="/dev/null")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["data.csv", "link.csv"]
