"""Programs of public repositories come back byte for byte; skipped where their clones are not there."""

import os
from pathlib import Path

import pytest

from beamstiff.errors import BeamstiffError
from benchmarks.public_programs import REPOSITORIES, faults, programs

FOLDER = Path(os.environ.get("BEAMSTIFF_PROGRAMS", ""))


@pytest.mark.skipif(not os.environ.get("BEAMSTIFF_PROGRAMS"), reason="BEAMSTIFF_PROGRAMS names no clones")
@pytest.mark.parametrize("language", REPOSITORIES)
def test_public_programs_come_back_byte_for_byte(language: str) -> None:
    count = 0
    for kind, _, name, content in programs(FOLDER):
        if kind != language or count > 12:
            continue
        try:
            _, found = faults(content, name)
        except BeamstiffError:  # without targets, or refused with a line
            continue
        assert not found, name
        count += 1
    assert count >= 3
