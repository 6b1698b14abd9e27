"""What a map holds at each pose, how it follows from compliance and Jacobian, and why a pose has none."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import IntEnum
from typing import TYPE_CHECKING, Literal

import numpy as np

from beamstiff.errors import BeamstiffError, listed, suggest
from beamstiff.fem.condensation import STIFFEST
from beamstiff.se3 import Array

if TYPE_CHECKING:
    import xarray

MOTIONS = ("dx", "dy", "dz", "rx", "ry", "rz")
LOADS = ("fx", "fy", "fz", "mx", "my", "mz")
Need = Literal["compliance", "weight", "jacobian", "wrench", "direction"]


@dataclass(frozen=True)
class Quantity:
    """What is known of a quantity."""

    long_name: str
    unit: str
    needs: tuple[Need, ...]  # what it follows from: of the pose, and of what was asked
    # which end of its values is the bad one; None for what has no order
    worst: Literal["least", "largest"] | None = None
    # axes beside those of the grid: none, those of a displacement, those of a matrix
    components: tuple[tuple[str, ...], ...] = ()

    @property
    def size(self) -> int:
        """How many numbers it has at a pose."""
        return int(np.prod([len(names) for names in self.components], dtype=np.int64))


QUANTITIES: dict[str, Quantity] = {
    "stiffness": Quantity(
        "least translational stiffness of the TCP over all directions of force, rotation free",
        "N/m",
        ("compliance",),
        "least",
    ),
    "stiffness_along": Quantity(
        "translational stiffness of the TCP along the direction given, rotation free",
        "N/m",
        ("compliance", "direction"),
        "least",
    ),
    "rotational_stiffness": Quantity(
        "least rotational stiffness of the TCP over all axes of moment, translation free",
        "N m/rad",
        ("compliance",),
        "least",
    ),
    "compliance_trace": Quantity(
        "trace of the translational compliance of the TCP", "m/N", ("compliance",), "largest"
    ),
    "deflection": Quantity(
        "distance by which the TCP moves under the wrench", "m", ("compliance", "wrench"), "largest"
    ),
    "displacement": Quantity(
        "displacement [d, r] of the TCP under the wrench, base frame",
        "m, rad",
        ("compliance", "wrench"),
        None,
        (MOTIONS,),
    ),
    "sag": Quantity("distance by which the TCP sags under dead weight", "m", ("weight",), "largest"),
    "compliance": Quantity(
        "compliance of the TCP, displacement = C wrench, base frame",
        "(m, rad)/(N, N m)",
        ("compliance",),
        None,
        (MOTIONS, LOADS),
    ),
    "stiffness_matrix": Quantity(
        "stiffness of the TCP, wrench = K displacement, base frame",
        "(N, N m)/(m, rad)",
        ("compliance",),
        None,
        (LOADS, MOTIONS),
    ),
    "kappa": Quantity(
        "condition number after Frobenius of the normalised Jacobian: 1 isotropic, infinite singular",
        "1",
        ("jacobian",),
        "largest",
    ),
    "dexterity": Quantity(
        "1/kappa of the normalised Jacobian: 1 isotropic, 0 singular", "1", ("jacobian",), "least"
    ),
    "manipulability": Quantity(
        "product of the singular values of the normalised Jacobian", "1", ("jacobian",), "least"
    ),
}

# what maps call their own: no axis is called so
OWN = (*QUANTITIES, "reason", "q", "joint", "motion", "load")


def check_quantities(names: tuple[str, ...], wrench: bool, direction: bool, weight: bool) -> None:
    """Refuse quantities that are unknown, named twice, or lack what they follow from."""
    if not names:
        raise BeamstiffError(f"found no quantity, expected some of {listed(QUANTITIES, 20)}")
    for at, name in enumerate(names):
        if name not in QUANTITIES:
            raise BeamstiffError(
                f"unknown quantity {name!r}{suggest(name, QUANTITIES)}, expected {listed(QUANTITIES, 20)}"
            )
        if name in names[:at]:
            raise BeamstiffError(f"the quantity {name} is given twice")
        if "wrench" in QUANTITIES[name].needs and not (wrench or weight):
            raise BeamstiffError(f"the quantity {name} needs a wrench, such as fz=-900N")
        if "direction" in QUANTITIES[name].needs and not direction:
            raise BeamstiffError(f"the quantity {name} needs a direction, such as z or 0.6,0,0.8")


def from_compliance(name: str, compliance: Array, displacement: Array, direction: Array | None) -> Array:
    """Return a quantity at P poses; infinite where the TCP is rigid.

    `compliance` (P, 6, 6); `displacement` (P, 6): under the wrench; `direction` (3,): of length 1.
    """
    along, about = compliance[:, :3, :3], compliance[:, 3:, 3:]
    if name == "compliance":
        return compliance
    if name == "displacement":
        return displacement
    if name == "deflection":
        return np.asarray(np.linalg.norm(displacement[:, :3], axis=1))
    if name == "compliance_trace":
        return np.asarray(np.trace(along, axis1=1, axis2=2))
    values = np.linalg.eigvalsh(about if name == "rotational_stiffness" else along)
    softest: Array = np.asarray(values[:, -1], dtype=np.float64)
    if name == "stiffness_along":
        assert direction is not None
        softness = (along @ direction) @ direction
        softest = np.where(softness > STIFFEST * softest, softness, 0.0)
    with np.errstate(divide="ignore", over="ignore"):
        return np.where(softest > 0.0, 1.0 / softest, np.inf)


def from_jacobian(name: str, jacobian: Array) -> Array:
    """Return a quantity at P poses from normalised Jacobians (P, 6, A)."""
    from beamstiff.planning.dexterity import inverse_condition  # loads an optimiser

    if name == "manipulability":
        return np.asarray(np.linalg.svd(jacobian, compute_uv=False).prod(axis=1))
    dexterity = inverse_condition(jacobian)
    if name == "dexterity":
        return dexterity
    with np.errstate(divide="ignore", over="ignore"):
        return np.where(dexterity > 0.0, 1.0 / dexterity, np.inf)


def dimension_names(variables: Iterable[str]) -> dict[str, str]:
    """Return what the axes of a map are called in its file, by variable.

    An axis has its variable's name, or ``variable_NAME`` where a map calls something else so.
    """
    names = tuple(variables)
    result = {}
    for name in names:
        called = name
        while called in OWN or (called != name and called in names):
            called = f"variable_{called}"
        result[name] = called
    return result


def variable_of(dataset: xarray.Dataset, axis: str) -> str:
    """Return the variable that an axis of a map stands for."""
    return str(dataset[axis].attrs.get("variable", axis))


class Reason(IntEnum):
    """What stands in `reason` at each pose of a map; 0 where all quantities are there."""

    COMPUTED = 0
    LIMITS = 1
    LOOP_OPEN = 2
    OUT_OF_REACH = 3
    OTHER_CONFIGURATION = 4
    SINGULAR = 5
    MECHANISM = 6
    RIGID = 7

    @property
    def label(self) -> str:
        """The name, as files have it."""
        return self.name.lower()


MEANING = {
    Reason.LIMITS: "a joint variable would be outside its limits",
    Reason.LOOP_OPEN: "a loop does not close",
    Reason.OUT_OF_REACH: "the TCP does not get there",
    Reason.OTHER_CONFIGURATION: "reached only in another configuration than that of the posture held",
    Reason.SINGULAR: "a loop leaves variables undetermined: no Jacobian",
    Reason.MECHANISM: "the structure is a mechanism",
    Reason.RIGID: "the TCP is rigid: infinite stiffness",
}
