"""Effects that a robot's file may hold, in a line."""

from collections.abc import Mapping
from typing import Any

from beamstiff.robot.parts import AddedEffect


def added(key: str, shape: str, scales: Mapping[str, Any] | None = None, **parameters: Any) -> AddedEffect:
    """Return an effect at a component, such as backlash:q2, or of the machine as a whole."""
    effect, _, component = key.partition(":")
    place = {"effect": effect, "component": component or None, "shape": shape}
    return AddedEffect(**place, parameters=parameters, scales=scales or {})
