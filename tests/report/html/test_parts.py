import json
import shlex
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from beamstiff.errors import BeamstiffError
from beamstiff.report.html.parts import embedded, label
from beamstiff.report.html.provenance import provenance, sha256


@given(st.recursive(st.text() | st.floats(allow_nan=False, allow_infinity=False), st.lists))
def test_embedded_json_reads_back_and_holds_nothing_that_ends_a_script(value: object) -> None:
    text = embedded(value)
    assert json.loads(text) == value
    assert not set("<>&") & set(text)


def test_numbers_that_are_none_are_refused() -> None:
    with pytest.raises(ValueError, match="not JSON compliant"):
        embedded({"value": float("nan")})


@given(st.text())
def test_a_label_holds_no_tag(text: str) -> None:
    assert not set("<>") & set(label(text))


def test_the_hash_is_the_published_one_of_a_known_text(tmp_path: Path) -> None:
    (tmp_path / "abc").write_bytes(b"abc")  # FIPS 180-2, appendix B.1
    assert sha256(tmp_path / "abc") == "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"


def test_the_command_can_be_typed_again() -> None:
    typed = ["diagnose", "my robot.yaml", "a'b.csv", "--html", "out.html"]
    assert shlex.split(provenance([], 0, typed).command) == ["beamstiff", *typed]


def test_a_file_that_is_gone_is_named(tmp_path: Path) -> None:
    with pytest.raises(BeamstiffError, match=r"gone\.csv: cannot be read"):
        provenance([tmp_path / "gone.csv"], 0, [])
