"""What of a process may be fitted to a measured run: parameters, what is expected of them, new values."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from beamstiff.compensation.path import ToolPath
from beamstiff.compensation.process.cantilever import Cantilever
from beamstiff.compensation.process.load import CuttingTable, Process, Together
from beamstiff.se3 import Array, rotate_screw, rotation_from_vector

GAIN, TURN = 0.05, float(np.radians(2.0))  # of a load cell as it is calibrated and mounted
FORCES = 0.3  # of a table of forces, as a share
BENDING, PLACE, FRICTION = 0.2, 5e-3, 0.3  # of a beam: stiffness as a share, clamp, m, coefficient


@dataclass(frozen=True)
class LoadCell:
    """What a load cell misreads: on top of the loads that the path states as it read them."""

    gain: float = 1.0
    turn: tuple[float, float, float] = (0.0, 0.0, 0.0)  # rad, of the cell's frame against the base

    def wrench(self, tool: Array, path: ToolPath) -> Array:
        """Return the true load less the one that was read, (N, 6)."""
        read = np.zeros((len(tool), 6)) if path.wrench is None else path.wrench
        turn = rotation_from_vector(np.array([self.turn]))
        return np.asarray(self.gain * (rotate_screw(turn) @ read[..., None])[..., 0] - read)


@dataclass(frozen=True, eq=False)
class Parameter:
    """One number of a process, told from its nominal value 0 (1 for a factor)."""

    name: str
    unit: str
    nominal: float
    expected: float  # standard deviation before the run
    least: float
    most: float
    set: Callable[[Any, float], Any]  # the part of the process with another value


def parameters_of(process: Process) -> list[tuple[int | None, Parameter]]:
    """Return the parameters of a process; of a sum those of its parts, with their number."""
    if isinstance(process, Together):
        return [
            (at, parameter) for at, part in enumerate(process.parts) for _, parameter in parameters_of(part)
        ]
    found: list[Parameter] = []
    if isinstance(process, Cantilever):
        found = [
            Parameter("friction", "", process.friction, FRICTION, 0.0, 1.0, _with("friction")),
            Parameter("process stiffness", "", 1.0, BENDING, 0.1, 10.0, _times("modulus")),
            *(
                Parameter(f"clamp {axis}", "m", 0.0, PLACE, -0.1, 0.1, _clamp(at))
                for at, axis in enumerate("xyz")
            ),
        ]
    elif isinstance(process, CuttingTable):
        found = [Parameter("process stiffness", "", 1.0, FORCES, 0.0, 10.0, _times("loads"))]
    elif isinstance(process, LoadCell):
        found = [
            Parameter("load-cell gain", "", 1.0, GAIN, 0.5, 2.0, _with("gain")),
            *(
                Parameter(f"load-cell turn {axis}", "rad", 0.0, TURN, -0.5, 0.5, _cell(at))
                for at, axis in enumerate("xyz")
            ),
        ]
    return [(None, parameter) for parameter in found]


def with_values(
    process: Process, parameters: Sequence[tuple[int | None, Parameter]], values: Sequence[float]
) -> Process:
    """Return the process with other values of its parameters."""
    parts = list(process.parts) if isinstance(process, Together) else [process]
    for (at, parameter), value in zip(parameters, values, strict=True):
        parts[at or 0] = parameter.set(parts[at or 0], float(value))
    return Together(tuple(parts)) if isinstance(process, Together) else parts[0]


def _with(name: str) -> Callable[[Any, float], Any]:
    return lambda part, value: replace(part, **{name: value})


def _times(name: str) -> Callable[[Any, float], Any]:
    return lambda part, factor: replace(part, **{name: getattr(part, name) * factor})


def _clamp(axis: int) -> Callable[[Cantilever, float], Cantilever]:
    def moved(part: Cantilever, value: float) -> Cantilever:
        clamp = part.clamp.copy()
        clamp[:3, 3] += value * clamp[:3, axis]
        return replace(part, clamp=clamp)

    return moved


def _cell(axis: int) -> Callable[[LoadCell, float], LoadCell]:
    def turned(part: LoadCell, value: float) -> LoadCell:
        x, y, z = (value if at == axis else old for at, old in enumerate(part.turn))
        return replace(part, turn=(x, y, z))

    return turned
