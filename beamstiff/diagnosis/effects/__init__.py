"""What a model can lack: one file an effect. A new one is a new file with an `EFFECT` in it.

Every module of this folder that has an `EFFECT` is an effect; the order is that of their names.
"""

from __future__ import annotations

from importlib import import_module
from pkgutil import iter_modules

from beamstiff.diagnosis.effects.effect import Effect, Normalisation, Quantity, Shape

__all__ = ["EFFECTS", "Effect", "Normalisation", "Quantity", "Shape"]


def _found() -> dict[str, Effect]:
    modules = [import_module(f"{__name__}.{item.name}") for item in iter_modules(__path__)]
    effects = [module.EFFECT for module in modules if hasattr(module, "EFFECT")]
    return {effect.name: effect for effect in sorted(effects, key=lambda effect: effect.name)}


EFFECTS = _found()
