"""Where a gap is, each place with those that the rows do not distinguish from it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from beamstiff.diagnosis.effects import EFFECTS

if TYPE_CHECKING:
    from beamstiff.diagnosis.result import Diagnosis


def places_with_look_alikes(result: Diagnosis) -> list[dict[str, Any]]:
    """Return the components of `Diagnosis.where`, each with the places of the look-alikes of its causes."""
    found = () if result.decomposition is None else result.decomposition.causes
    told = [(one.key, one.indistinguishable) for one in found]
    if not told and result.also is None:  # of two it is not known which of them the others stand in for
        told = [(result.verdict.key, result.indistinguishable)]
    alike: dict[str, list[str]] = {}
    for key, others in told:
        for place in _places(key):
            alike.setdefault(place, []).extend(name for other in others for name in _places(other))
    components = result.where.get("components", ())
    names = [
        [name for name in alike.get(one["component"], ()) if name != one["component"]] for one in components
    ]
    return [
        {**one, "indistinguishable": list(dict.fromkeys(own))}
        for one, own in zip(components, names, strict=True)
    ]


def _places(key: str) -> tuple[str, ...]:
    """Return where a cause ``effect:component`` sits: its effect where that has no place; nothing of none."""
    effect, _, component = key.partition(":")
    if effect not in EFFECTS:
        return ()
    own = EFFECTS[effect].places(None if component == "null" else component)
    return tuple(place or effect for place in own)
