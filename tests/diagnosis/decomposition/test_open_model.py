"""As much of the geometry is open as the readings determine, and as the machine stands."""

from types import SimpleNamespace
from typing import Any

import pytest

from beamstiff.diagnosis.decomposition import open_model
from beamstiff.diagnosis.decomposition.decompose import OPEN
from beamstiff.errors import BeamstiffError


def test_a_machine_that_buckles_with_all_open_is_calibrated_with_less(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A Stewart platform with an error along one leg does: its drives soften to make up for it."""

    def opened(*_: Any, parameters: tuple[str, ...] | None, **__: Any) -> SimpleNamespace:
        if parameters is None:
            raise BeamstiffError("so near buckling")
        return SimpleNamespace(count=100, determined=1.0)

    monkeypatch.setattr(open_model, "open_geometry", opened)
    model: Any = SimpleNamespace()
    assert open_model.open_as_determined(model, model, False, OPEN, True)[1] == OPEN[1]
    with pytest.raises(BeamstiffError, match="so near buckling"):
        open_model.open_as_determined(model, model, False, OPEN[:1], True)
