"""What a model can lack: one file an effect. A new one is a new file with an `EFFECT` in it.

Every module of this folder that has an `EFFECT` is an effect; the order is that of their names.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from importlib import import_module
from pkgutil import iter_modules

from beamstiff.diagnosis.effects.effect import Effect, Normalisation, Quantity, Shape
from beamstiff.diagnosis.residual.baseline import Baseline

__all__ = ["EFFECTS", "Effect", "Normalisation", "Quantity", "Shape"]


def _as_read(shapes: Callable[[Baseline, str | None], list[Shape]]) -> Callable[..., list[Shape]]:
    """Return shapes whose columns are along the axes that each row is read in."""

    def read(baseline: Baseline, component: str | None) -> list[Shape]:
        found = shapes(baseline, component)
        if baseline.rows.axes is None:
            return found
        return [replace(shape, columns=baseline.rows.along(shape.columns)) for shape in found]

    return read


def _found() -> dict[str, Effect]:
    modules = [import_module(f"{__name__}.{item.name}") for item in iter_modules(__path__)]
    effects = [module.EFFECT for module in modules if hasattr(module, "EFFECT")]
    return {
        effect.name: replace(effect, shapes=_as_read(effect.shapes))
        for effect in sorted(effects, key=lambda effect: effect.name)
    }


EFFECTS = _found()
