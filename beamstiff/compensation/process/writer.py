"""Process models to YAML, as `reader` takes them: what measured runs taught, for the next path."""

from typing import Any

import numpy as np

from beamstiff.compensation.process.cantilever import Cantilever
from beamstiff.compensation.process.cutting import CuttingTable
from beamstiff.compensation.process.load import Constant, Process, Together
from beamstiff.compensation.process.parameters import LoadCell
from beamstiff.measure.table import WRENCH
from beamstiff.robot.writer import rows_of
from beamstiff.se3 import Array

DIGITS = 7  # that are written: of a clamp 2 m away a micrometre


def process_to_yaml(process: Process, head: str = "") -> str:
    """Return the text of a file that describes a process; `head`: its first lines, comments."""
    return head + "".join(f"{row}\n" for row in _rows(process))


def _rows(process: Process) -> list[str]:
    if isinstance(process, Together):
        rows = ["kind: together", "parts:"]
        for part in process.parts:
            first, *others = _rows(part)
            rows += [f"  - {first}", *(f"    {row}" for row in others)]
        return rows
    return list(rows_of(_fields(process)))


def _fields(process: Process) -> dict[str, Any]:
    match process:
        case Cantilever():
            sizes = {name: getattr(process, name) for name in ("length", "width", "thickness")}
            clamp = process.clamp
            return {
                "kind": "cantilever",
                **{name: _quantity(1e3 * value, "mm") for name, value in sizes.items()},
                "E": _quantity(1e-9 * process.modulus, "GPa"),
                "method": process.method,
                "friction": _number(process.friction),
                "clamp": {
                    "at": tuple(_quantity(1e3 * value, "mm") for value in clamp[:3, 3].tolist()),
                    **{axis: _numbers(clamp[:3, column]) for axis, column in (("x", 0), ("z", 2))},
                },
            }
        case CuttingTable():
            loads = zip(WRENCH, process.loads.T, strict=True)
            return {
                "kind": "cutting-table",
                "variable": process.variable,
                "values": _numbers(process.values),
                **{name: _numbers(values) for name, values in loads if values.any()},
                "frame": process.frame,
            }
        case LoadCell():
            turn = tuple(_quantity(value, "deg") for value in np.degrees(process.turn).tolist())
            return {"kind": "load-cell", "gain": _number(process.gain), "turn": turn}
        case Constant():
            loads = zip(WRENCH, process.value, strict=True)
            return {"kind": "constant", **{name: _number(value) for name, value in loads if value}}
        case _:
            return {"kind": "path"}


def _quantity(value: float, unit: str) -> str:
    return f"{value + 0.0:.{DIGITS}g} {unit}"


def _number(value: float) -> float:
    return float(f"{value:.{DIGITS}g}") + 0.0


def _numbers(values: Array) -> tuple[float, ...]:
    return tuple(map(_number, values.tolist()))
