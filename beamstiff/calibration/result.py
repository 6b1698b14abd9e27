"""What a geometric calibration found."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from beamstiff.calibration.identifiability import Identifiability
from beamstiff.calibration.parameters import Parameter
from beamstiff.calibration.statement import Statement, rigid_gap
from beamstiff.errors import BeamstiffError, suggest
from beamstiff.measure.arrays import Integers
from beamstiff.robot.coupling import frame_expressions
from beamstiff.robot.description import Robot
from beamstiff.robot.parts import CalibratedParameter
from beamstiff.se3 import Array
from beamstiff.shown import Shown

if TYPE_CHECKING:
    from beamstiff.measure.instruments import Target
    from beamstiff.measure.table import Measurements

CORRELATION_DIGITS = 3  # behind the point, as written


@dataclass(frozen=True)
class Errors:
    """Sizes of residuals: norms over the rows, m in position and rad in orientation; None not measured."""

    position_mean: float | None
    position_rms: float | None
    position_max: float | None
    orientation_mean: float | None
    orientation_rms: float | None
    orientation_max: float | None

    def to_dict(self) -> dict[str, float | None]:
        """Return plain data, mm and deg."""
        result: dict[str, float | None] = {}
        for kind in ("mean", "rms", "max"):
            for part, unit, factor in (("position", "mm", 1e3), ("orientation", "deg", 180 / np.pi)):
                value = getattr(self, f"{part}_{kind}")
                result[f"{part}_{kind}_{unit}"] = None if value is None else factor * value
        return result


def errors_of(gap: Array, used: NDArray[np.bool_]) -> Errors:
    """Return the sizes of residuals (N, 6) where they were measured (N, 6)."""
    found: list[float | None] = []
    for part in (slice(0, 3), slice(3, 6)):
        rows = used[:, part].any(axis=1)
        size = np.linalg.norm(np.where(used, gap, 0.0)[rows, part], axis=1)
        if size.size:
            found += [float(size.mean()), float(np.sqrt((size**2).mean())), float(size.max())]
        else:
            found += [None, None, None]
    return Errors(*found)


@dataclass(frozen=True)
class Found:
    """A parameter as found."""

    parameter: Parameter
    nominal: float  # of the robot, SI: 0 for an encoder's zero
    value: float
    std: float | None  # standard deviation; None where it was held

    @property
    def name(self) -> str:
        """Name of the parameter."""
        return self.parameter.name

    @property
    def change(self) -> float:
        """Deviation from the robot as it was described, SI."""
        return self.value - self.nominal

    @property
    def identified(self) -> bool:
        """Whether it was sought; if not, it stayed."""
        return self.std is not None


def calibrated_parameters(
    found: Sequence[Found], covariance: Array, before: Sequence[CalibratedParameter] = ()
) -> tuple[CalibratedParameter, ...]:
    """Return what a robot file says of the geometry that was fitted: how sure each parameter is.

    What an earlier calibration says `before` of parameters that this one held stays.
    """
    at = [
        k
        for k, item in enumerate(found)
        if item.std and item.parameter.group not in ("compliance", "instrument")
    ]
    fitted = {found[k].name for k in at}
    stays = [k for k, item in enumerate(before) if item.name not in fitted]
    kept = [
        before[k].model_copy(
            update={"correlation": tuple(c for k2, c in enumerate(before[k].correlation) if k2 in stays)}
        )
        for k in stays
    ]
    std = np.sqrt(np.diag(covariance)[at])
    correlation = np.round(covariance[np.ix_(at, at)] / np.outer(std, std), CORRELATION_DIGITS)
    new = [
        CalibratedParameter(
            name=found[k].name,
            std=float(f"{std[row]:.3g}"),
            correlation=(0.0,) * len(kept) + tuple(np.clip(correlation[row, :row], -1.0, 1.0).tolist()),
        )
        for row, k in enumerate(at)
    ]
    return (*kept, *new)


@dataclass(frozen=True, eq=False, repr=False)
class Calibration(Shown):
    """A calibrated robot, how sure its parameters are, and what is left; N rows, t parameters."""

    robot: Robot  # with the geometry, and the compliances, found. Writes itself with `save_robot`
    # (S, 4, 4): where the robot's base stands in the measuring frame; in several, if each table has its own
    bases: Array
    target: Array  # (3, 3): how the measured target is turned against the frame of the TCP
    parameters: tuple[Found, ...]  # (t)
    covariance: Array  # (t, t): SI units; 0 for parameters that were held
    identifiability: Identifiability  # at the start
    after: Errors  # as calibrated
    held_out: Errors | None  # on poses while they were left out
    predicted: Array  # (N, 6): positions and rotation vectors in the measuring frame
    # (N, 6), m and rad: measured less predicted, ``[d, r]``, in the measuring frame; NaN where not measured
    residual: Array
    held_out_residual: Array | None  # (N, 6)
    sigma: Array  # (N, 6), m and rad: the noise that the readings counted with
    pose: Integers  # (N,): rows of one pose have one number
    noise: float  # factor by which the residual exceeds the noise as stated (or the usual one where none is)
    claimed: bool  # whether the table states its noise
    method: str
    message: str
    costs: Array  # (iterations + 1,)
    statement: Statement  # what was estimated
    notes: tuple[str, ...] = ()
    targets: tuple[Target, ...] = ()  # of instruments without a tracker, as found, in the measuring frame
    rows: Measurements | None = None  # what was fitted
    tests: Mapping[str, Errors] = field(default_factory=dict)  # on other readings, by name
    # how far lengths and angles are off, in realistic deviations, where the noise is not as stated
    spread: float | None = None

    def __getitem__(self, name: str) -> Found:
        known = {item.name: item for item in self.parameters}
        if name not in known:
            raise BeamstiffError(f"{name!r} was not among the parameters{suggest(name, known)}")
        return known[name]

    @property
    def base(self) -> Array:
        """Where the robot's base stands in the (first) measuring frame, (4, 4)."""
        return np.asarray(self.bases[0])

    @property
    def values(self) -> Mapping[str, float]:
        """What was found, by name, SI."""
        return {item.name: item.value for item in self.parameters}

    @cached_property
    def nominal_residual(self) -> Array:
        """Residual (N, 6) of the robot as described, laid over the readings as a rigid body."""
        problem = self.statement.problem
        return np.where(problem.used, rigid_gap(problem), np.nan)

    @property
    def before(self) -> Errors:
        """The errors of the robot as described, laid over the readings as a rigid body."""
        return errors_of(self.nominal_residual, self.statement.problem.used)

    def written_std(self, nominal: Robot) -> dict[str, float]:
        """Return the std of every number in the robot while all others stay, SI, by its name there.

        Where nodes were moved with the geometry, to keep joints together, no more than 1e-8: its digits are
        those that keep them so.
        """
        most = np.inf if self.robot.nodes == nominal.nodes else 1e-8
        sought = [at for at, item in enumerate(self.parameters) if item.std]
        precision = np.linalg.pinv(self.covariance[np.ix_(sought, sought)], hermitian=True)
        least = 1.0 / np.sqrt(np.diagonal(precision))
        exact = {
            self.parameters[at].name: float(min(self.parameters[at].std or 0.0, one))
            for at, one in zip(sought, least, strict=True)
        }
        for item in self.compliances:  # written as stiffness
            if item.name in exact:
                exact[item.name] /= item.value**2 or np.inf
        for frame, of_frame in frame_expressions(self.robot).items():
            for (
                name,
                expression,
            ) in of_frame.items():  # a zero is written with every expression of its variable
                own = [exact[one] for one in (f"{frame}.{name}", *expression.coefficients) if one in exact]
                exact |= {f"{frame}.{name}": min(most, *own)} if own else {}
        return exact

    @property
    def compliances(self) -> tuple[Found, ...]:
        """The compliances among the parameters."""
        return tuple(item for item in self.parameters if item.parameter.group == "compliance")

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON: SI, errors in mm and deg; covariance in the order of `identified`."""
        sought = [at for at, item in enumerate(self.parameters) if item.identified]
        return {
            "parameters": {
                item.name: {
                    "nominal": item.nominal,
                    "value": item.value,
                    "change": item.change,
                    "std": item.std,
                    "unit": item.parameter.unit,
                    "identified": item.identified,
                }
                for item in self.parameters
            },
            "identified": list(self.identifiability.identified),
            "covariance": self.covariance[np.ix_(sought, sought)].tolist(),
            "dependent": {name: dict(like) for name, like in self.identifiability.dependent.items()},
            "silent": list(self.identifiability.silent),
            "condition": self.identifiability.condition,
            "base": self.base.tolist(),
            "bases": self.bases.tolist(),
            "target": self.target.tolist(),
            **({"instruments": [asdict(one) for one in self.targets]} if self.targets else {}),
            "nominal": self.before.to_dict(),
            "calibrated": self.after.to_dict(),
            "held_out": None if self.held_out is None else self.held_out.to_dict(),
            "rms_mm": self.after.to_dict()["position_rms_mm"],
            "rms_held_out_mm": None if self.held_out is None else self.held_out.to_dict()["position_rms_mm"],
            "noise_factor": self.noise,
            "method": self.method,
            "iterations": len(self.costs) - 1,
            **({"tests": {name: one.to_dict() for name, one in self.tests.items()}} if self.tests else {}),
            "notes": list(self.notes),
        }
