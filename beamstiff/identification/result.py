"""What an identification says: values with their uncertainty, and what could not be known."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from beamstiff.errors import BeamstiffError, suggest
from beamstiff.identification.validation import HeldOut
from beamstiff.measure.table import Measurements
from beamstiff.robot.description import Robot
from beamstiff.se3 import Array
from beamstiff.shown import Shown

if TYPE_CHECKING:
    import pandas as pd

    from beamstiff.identification.bootstrap import Bootstrap
    from beamstiff.identification.pareto import Front
    from beamstiff.identification.reduced_model import Reduced


@dataclass(frozen=True)
class Parameter:
    """An identified stiffness."""

    name: str
    unit: str
    # value, std: None where the data do not bound the stiffness from above, or tell only a combination of it
    value: float | None
    std: float | None
    identifiable: bool
    interval: tuple[float, float] | None = None  # (low, high): 95 %
    # of a stiffness without value: with 97.5 % it is above; 0 where nothing is known
    lower_bound: float | None = None
    reason: str = ""  # why there is no value; else empty
    silent: bool = False  # no measured row feels it
    separate: str = ""  # what measurement would make it felt, in words; empty where none was sought


@dataclass(frozen=True)
class Combination:
    """Parameters identifiable only in combination, and the sum of theirs that is known."""

    parameters: tuple[str, ...]
    relation: str  # ``"1/J12.radial + 1/J33.radial"``, or nothing where the combination is no sum
    # value, std: of the relation
    value: float | None
    std: float | None
    kind: str  # "series", "parallel", "sum" or "mixed"; "ill-determined" where only noise hides the terms
    unit: str
    separate: str = ""  # what measurement would distinguish them, in words; empty where none was sought
    interval: tuple[float, float] | None = None  # (low, high): 95 %, of the value


@dataclass(frozen=True, repr=False)
class Identification(Shown):
    """Identified stiffness of a robot.

    Attributes
    ----------
    parameters : tuple of Parameter (m)
    degenerate : tuple of Combination
        What no amount of such rows could distinguish.
    ill_determined : tuple of Combination
        Sums that are well known though these rows with their noise hardly tell their terms.
    covariance : (m, m) array
        Of the logarithms of the stiffness values, in the order of `parameters`; infinite variance of what is
        not identifiable by itself.
    stiffness : (m,) array
        Values at the optimum, also of those that are not identifiable.
    robot : Robot
        With these values.
    rms : float, m
        Root mean square of the position residual's norm over the fitted rows.
    rms_held_out, rms_held_out_load : float or None, m
        The same on held-out poses, and loads; None with fewer than three.
    chi_square : float
        Sum of squared whitened residuals over the degrees of freedom; near 1 when noise explains
        the residual.
    method : str
    evaluations : int
    message : str
        Why the method stopped.
    interrupted : bool
        Stopped by hand: the best so far.
    predicted : (N, 6) array, m and rad
        Displacement of every row at the optimum.
    notes : tuple of str
        What was left aside, and why, in sentences.
    held_out, held_out_load : HeldOut or None
        Errors row by row while poses, and loads, were held out: which of them the model misses.
    start : Robot or None
        As it was given.
    rows : Measurements or None
        What was fitted: copies once, and without what the robot's effects displace.
    bootstrap : Bootstrap or None
        Where it was asked for.
    reduced : Reduced or None
        The robot with what the rows can identify alone, where it was asked for.
    front : Front or None
        Of position error against rotation error, where it was asked for.
    """

    parameters: tuple[Parameter, ...]
    degenerate: tuple[Combination, ...]
    covariance: Array
    stiffness: Array
    robot: Robot
    rms: float
    rms_held_out: float | None
    rms_held_out_load: float | None
    chi_square: float
    method: str
    evaluations: int
    message: str
    interrupted: bool
    predicted: Array
    notes: tuple[str, ...] = ()
    ill_determined: tuple[Combination, ...] = ()
    held_out: HeldOut | None = None
    held_out_load: HeldOut | None = None
    start: Robot | None = None
    rows: Measurements | None = None
    bootstrap: Bootstrap | None = None
    reduced: Reduced | None = None
    front: Front | None = None

    def __getitem__(self, name: str) -> Parameter:
        """Return a parameter by its name."""
        by_name = {item.name: item for item in self.parameters}
        if name not in by_name:
            raise BeamstiffError(f"{name!r} was not identified{suggest(name, by_name)}")
        return by_name[name]

    @property
    def correlation(self) -> Array:
        """Correlation of the logarithms of the stiffness values, (m, m); NaN where there is no variance."""
        std = np.sqrt(np.diagonal(self.covariance))
        std = np.where(np.isfinite(std), std, np.nan)
        return np.asarray(self.covariance / np.outer(std, std))

    @property
    def conditional_std(self) -> dict[str, float]:
        """Standard deviation of every identifiable value while all others stay, SI, by name.

        Digits below it change nothing, also where only sums of parameters are well known.
        """
        variance = np.diagonal(self.covariance)
        known = np.flatnonzero(np.isfinite(variance) & (variance > 0.0))
        precision = np.linalg.pinv(self.covariance[np.ix_(known, known)], hermitian=True)
        least = np.minimum(variance[known], 1.0 / np.diagonal(precision))
        return {
            self.parameters[at].name: float(self.stiffness[at] * np.sqrt(one))
            for at, one in zip(known, least, strict=True)
            if one > 0.0
        }

    def to_frame(self) -> pd.DataFrame:
        """Return values, standard deviations and 95 % intervals as a pandas DataFrame, a row a parameter."""
        import pandas as pd

        rows = {
            item.name: {
                "value": item.value,
                "std": item.std,
                "low": item.lower_bound if item.interval is None else item.interval[0],
                "high": np.inf if item.interval is None else item.interval[1],
                "unit": item.unit,
                "identifiable": item.identifiable,
            }
            for item in self.parameters
        }
        return pd.DataFrame.from_dict(rows, orient="index")

    def covariance_frame(self) -> pd.DataFrame:
        """Return the covariance of the logarithms as a pandas DataFrame, labelled by parameter."""
        import pandas as pd

        names = [item.name for item in self.parameters]
        return pd.DataFrame(self.covariance, index=names, columns=names)

    def to_dict(self) -> dict[str, Any]:
        """Return the result as plain data, in the contract's form (``beamstiff identify --json``)."""
        names = [item.name for item in self.parameters]
        asked = {"bootstrap": self.bootstrap, "reduced": self.reduced, "pareto": self.front}
        return {
            "parameters": {item.name: _parameter(item) for item in self.parameters},
            "degenerate": [_combination(item) for item in self.degenerate],
            "ill_determined": [_combination(item) for item in self.ill_determined],
            "rms_mm": 1e3 * self.rms,
            "rms_held_out_mm": _mm(self.rms_held_out),
            "rms_held_out_load_mm": _mm(self.rms_held_out_load),
            "chi_square": self.chi_square,
            "correlation": {"names": names, "values": [[_plain(v) for v in row] for row in self.correlation]},
            "method": self.method,
            "evaluations": self.evaluations,
            "interrupted": self.interrupted,
            "notes": list(self.notes),
            **{key: value.to_dict() for key, value in asked.items() if value is not None},
        }


def _parameter(item: Parameter) -> dict[str, Any]:
    known = {name: getattr(item, name) for name in ("value", "std", "unit", "identifiable")}
    more = {
        "interval": _interval(item.interval),
        "lower_bound": item.lower_bound,
        "reason": item.reason or None,
        "separate": item.separate or None,
    }
    return known | {name: value for name, value in more.items() if value is not None}


def _combination(item: Combination) -> dict[str, Any]:
    names = ("relation", "value", "std", "kind", "unit", "separate")
    known = {"parameters": list(item.parameters)} | {name: getattr(item, name) for name in names}
    return known if item.interval is None else known | {"interval": _interval(item.interval)}


def _interval(ends: tuple[float, float] | None) -> list[float | None] | None:
    return None if ends is None else [_plain(end) for end in ends]


def _plain(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _mm(value: float | None) -> float | None:
    return None if value is None else 1e3 * value
