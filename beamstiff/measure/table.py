"""The table of measurements: one row a measured state, plain arrays in SI."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from beamstiff.errors import BeamstiffError, listed
from beamstiff.measure.arrays import Integers, equal_rows, finite, positive
from beamstiff.measure.instruments import Target, axes_along
from beamstiff.se3 import Array

if TYPE_CHECKING:
    import pandas as pd

Kind = Literal["displacement", "absolute"]
Names = NDArray[np.str_]

WRENCH = ("fx", "fy", "fz", "mx", "my", "mz")
DISPLACEMENT = ("dx", "dy", "dz", "rx", "ry", "rz")
ABSOLUTE = ("x", "y", "z", "a", "b", "c")
ON_ROBOT, FIXED = "on robot", "fixed"  # where a camera is
MEASURED: dict[Kind, tuple[str, ...]] = {"displacement": DISPLACEMENT, "absolute": ABSOLUTE}


@dataclass(frozen=True, eq=False, repr=False)
class Measurements:
    """Measured states of a machine, N rows, SI, base frame, from a file or `make_measurements`."""

    variables: tuple[str, ...]  # names of the actuated variables, the columns of `q` (A)
    # whether the rows hold TCP displacements (loaded minus unloaded) or absolute TCP positions
    kind: Kind
    q: Array  # (N, A), rad or m: actuated variables, drive-side readings
    wrench: Array  # (N, 6), N and N m: ``[f, m]`` at `load_point`, base frame
    displacement: Array  # (N, 6), m and rad: ``[d, r]`` of `point`, r a rotation vector; NaN: not measured
    # (N, 3), m and rad: of `point`, and rotation vector of the TCP frame; NaN where not measured
    position: Array
    rotation: Array
    # (N, 6), m and rad: standard deviation of every measured value, the row's own where known, else the
    # table's; NaN unknown
    sigma: Array
    # (N,): nodes where the displacement was measured and the wrench applied
    point: Names
    load_point: Names
    pose: Integers  # (N,): rows of one configuration have one id; ids of different runs differ
    step: Array  # (N,): order within the pose; NaN where not given
    time: Array  # (N,), s: since the start of the run; NaN where not given
    temperature: Array  # (N,), degC; NaN where not given
    link: Array  # (N, A), rad or m: readings of encoders behind the gears (`q2_link`); NaN where not read
    torque: Array  # (N, A), N m or N: measured drive torques or forces (`tau_q2`); NaN where not measured
    # (N, 3): unit vector along which a row reads one number, the first of `measured`; NaN: along the base's
    direction: Array
    # (N, 3), m: of a camera's rows the way from what is on the robot, camera or tag, to the other; else NaN
    sight: Array
    # (N,): what an instrument other than a tracker was set on, one of `targets`; "" for a tracker
    target: Names
    rows: Integers  # (N,): line of the file that each row stands in
    run: Integers  # (N,): file of each row, an index into `sources`
    # m and rad: of a measured value (for displacements the difference), where one holds for the whole table
    sigma_position: float | None
    sigma_rotation: float | None
    # all rows of a pose were differenced with one unloaded reading, so their errors are correlated
    shared_unloaded: bool
    continuous: bool  # the load history runs on from pose to pose; else each pose starts unloaded
    metadata: Mapping[str, str]  # what the ``# key: value`` lines say
    sources: tuple[str, ...]  # files the rows come from
    # of variables and of the time in the file, such as ``{"q1": "deg", "t": "s"}``: `q` is SI, what is
    # written for people follows them
    units: Mapping[str, str] = field(default_factory=dict)
    # least and largest x, y and z of the TCP where it can be measured, m; None: not said
    region: tuple[tuple[float, float], ...] | None = None
    batch: int | None = None  # rows that a proposal has at most; None: whole load cycles
    # axes of the base along which a proposal may pull, such as ``("x", "-z")``; none: those of the rows
    directions: tuple[str, ...] = ()
    sigma_load: float | None = None  # N: of the size of each load; `identify` counts it in
    targets: tuple[Target, ...] = ()  # sockets, base balls, planes, gauges (`measure.instruments`)
    camera: str = ""  # "on robot" or "fixed": where the camera is that read the rows (`measure.camera`)
    # (N, V): 1, -1 or 0 by the direction in which each variable last moved; None: as the rows follow
    approached: Array | None = None

    def __len__(self) -> int:
        return len(self.q)

    def __repr__(self) -> str:
        return (
            f"Measurements({self.kind}, {len(self)} rows, {len(np.unique(self.pose))} poses, "
            f"variables {listed(self.variables)}, source {self.source!r})"
        )

    @property
    def source(self) -> str:
        """The file the rows come from; several are joined by " + "."""
        return " + ".join(self.sources)

    @property
    def drive_columns(self) -> tuple[list[str], list[str]]:
        """Names of the columns that `link` and `torque` stand in."""
        return [f"{name}_link" for name in self.variables], [f"tau_{name}" for name in self.variables]

    @property
    def measured(self) -> Array:
        """Measured values (N, 6): `displacement`, or `position` and `rotation`; NaN where not measured."""
        if self.kind == "displacement":
            return self.displacement
        return np.concatenate([self.position, self.rotation], axis=1)

    @property
    def measured_mask(self) -> NDArray[np.bool_]:
        """Which of the six values of each row were measured (N, 6)."""
        return ~np.isnan(self.measured)

    @cached_property
    def axes(self) -> Array | None:
        """Axes (N, 3, 3) along which each row is read, base frame; None: along the base's in all."""
        return None if np.isnan(self.direction).all() else axes_along(self.direction)

    def along(self, values: Array) -> Array:
        """Return values (N, 6, ...), base frame, along the axes that each row is read in."""
        if self.axes is None:
            return values
        moved = values[:, :3]
        if self.camera == ON_ROBOT:
            sight = self.sight.reshape(self.sight.shape + (1,) * (values.ndim - 2))
            moved = moved + np.cross(values[:, 3:], sight, axis=1)
        turned = np.einsum("nij,nj...->ni...", self.axes, moved)
        return np.concatenate([turned, values[:, 3:]], axis=1)

    @property
    def by_tracker(self) -> NDArray[np.bool_]:
        """Which rows (N,) hold coordinates, not the reading of an instrument along a direction of its own."""
        return np.asarray(self.target == "")

    @property
    def sharing(self) -> Integers:
        """The number of the unloaded reading of each row, (N,): one a pose and reflector; -1 its own."""
        if not self.shared_unloaded:
            return np.full(len(self), -1)
        reflector, set_up = (np.unique(names, return_inverse=True)[1] for names in (self.point, self.target))
        return equal_rows(np.stack([self.pose, reflector, set_up], axis=1).astype(np.float64))

    def place(self, row: int) -> str:
        """Return where a row stands, as ``file:line``."""
        return f"{self.sources[self.run[row]]}:{self.rows[row]}"

    def to_frame(self) -> pd.DataFrame:
        """Return the table as a pandas DataFrame, SI, named as the columns of a file; one row a state."""
        import pandas as pd

        columns: dict[str, Any] = dict(zip(self.variables, self.q.T, strict=True))
        columns |= dict(zip(WRENCH, self.wrench.T, strict=True))
        columns |= dict(zip(MEASURED[self.kind], self.measured.T, strict=True))
        for names, values in zip(self.drive_columns, (self.link, self.torque), strict=True):
            columns |= {n: v for n, v in zip(names, values.T, strict=True) if not np.isnan(v).all()}
        columns |= {f"sigma_{n}": s for n, s in zip(MEASURED[self.kind], self.sigma.T, strict=True)}
        columns |= {"point": self.point, "load_point": self.load_point, "pose": self.pose, "step": self.step}
        columns |= {"t": self.time, "temperature": self.temperature, "row": self.rows}
        columns["source"] = np.array(self.sources)[self.run]
        return pd.DataFrame(columns)


def make_measurements(
    variables: Sequence[str],
    q: ArrayLike,
    *,
    tcp: str,
    wrench: ArrayLike | None = None,
    displacement: ArrayLike | None = None,
    position: ArrayLike | None = None,
    rotation: ArrayLike | None = None,
    sigma: ArrayLike | None = None,
    sigma_position: float | None = None,
    sigma_rotation: float | None = None,
    sigma_load: float | None = None,
    point: ArrayLike | None = None,
    load_point: ArrayLike | None = None,
    pose: ArrayLike | None = None,
    step: ArrayLike | None = None,
    time: ArrayLike | None = None,
    temperature: ArrayLike | None = None,
    link: ArrayLike | None = None,
    torque: ArrayLike | None = None,
    direction: ArrayLike | None = None,
    sight: ArrayLike | None = None,
    target: ArrayLike | None = None,
    targets: Sequence[Target] = (),
    rows: ArrayLike | None = None,
    shared_unloaded: bool = False,
    continuous: bool = False,
    metadata: Mapping[str, str] | None = None,
    source: str = "<arrays>",
    units: Mapping[str, str] | None = None,
    camera: str = "",
) -> Measurements:
    """Return a table from arrays, with the defaults of the file format for what is not given.

    Parameters
    ----------
    variables, q, ...
        As the attributes of `Measurements`; N rows. NaN in measured values means not measured. A displacement
        (N, 3) has no rotation. Without `pose`, rows of equal `q` are one pose.
    tcp : str
        Node that `point` and `load_point` default to.

    Raises
    ------
    BeamstiffError
        When there is no row, shapes do not fit, a number is not finite, sigma is not positive, or both kinds
        of measurement are given.

    Examples
    --------
    >>> make_measurements(["q1"], [[0.1], [0.1]], tcp="n1", displacement=[[0, 0, -1e-3]] * 2)
    Measurements(displacement, 2 rows, 1 poses, variables q1, source '<arrays>')
    """
    q_array = finite(q, f"{source}: q", -1, len(variables))
    if q_array.ndim != 2 or not len(q_array):
        raise BeamstiffError(f"{source}: q: found shape {q_array.shape}, expected at least one row of values")
    n = len(q_array)
    if displacement is not None and (position is not None or rotation is not None):
        raise BeamstiffError(
            f"{source}: found displacements and absolute positions, expected one of the two kinds"
        )
    if displacement is not None:
        displacement = finite(displacement, f"{source}: displacement", -1, missing=True)
        if displacement.ndim == 2 and displacement.shape[1] == 3:
            displacement = np.hstack([displacement, np.full((len(displacement), 3), np.nan)])

    def column(value: ArrayLike | None, name: str, *tail: int, default: float = np.nan) -> Array:
        array = np.full((n, *tail), default) if value is None else finite(value, name, *tail, missing=True)
        if array.shape != (n, *tail):
            raise BeamstiffError(f"{source}: {name}: found shape {array.shape}, expected {(n, *tail)}")
        return array

    def whole(value: ArrayLike, name: str) -> Integers:
        array = finite(column(value, name), f"{source}: {name}")
        if (array != np.round(array)).any():
            raise BeamstiffError(
                f"{source}: {name}: found {array[array != np.round(array)][0]}, expected whole numbers"
            )
        return array.astype(np.int64)

    def names(value: ArrayLike | None, default: str = tcp) -> Names:
        return np.broadcast_to(np.asarray(default if value is None else value, dtype=np.str_), (n,)).copy()

    turned = np.isnan(column(rotation, "rotation", 3))
    if (turned.any(axis=1) & ~turned.all(axis=1)).any():
        raise BeamstiffError(
            f"{source}: rotation: found some of three components missing, expected all or none"
        )
    own = column(sigma, "sigma", 6)
    if (own <= 0).any():
        raise BeamstiffError(
            f"{source}: sigma: found {own[own <= 0][0]}, expected positive standard deviations"
        )
    table = [
        np.nan if s is None else positive(s, f"{source}: {name}")
        for name, s in (("sigma_position", sigma_position), ("sigma_rotation", sigma_rotation))
    ]
    return Measurements(
        variables=tuple(variables),
        kind="displacement" if position is None and rotation is None else "absolute",
        q=q_array,
        wrench=finite(column(wrench, "wrench", 6, default=0.0), f"{source}: wrench", 6),
        displacement=column(displacement, "displacement", 6),
        position=column(position, "position", 3),
        rotation=column(rotation, "rotation", 3),
        sigma=np.where(np.isnan(own), np.repeat(table, 3), own),
        point=names(point),
        load_point=names(load_point),
        pose=equal_rows(q_array) if pose is None else whole(pose, "pose"),
        step=column(step, "step"),
        time=column(time, "time"),
        temperature=column(temperature, "temperature"),
        link=column(link, "link", len(variables)),
        torque=column(torque, "torque", len(variables)),
        direction=column(direction, "direction", 3),
        sight=column(sight, "sight", 3),
        target=names(target, ""),
        rows=np.arange(1, n + 1) if rows is None else whole(rows, "rows"),
        run=np.zeros(n, dtype=np.int64),
        sigma_position=sigma_position,
        sigma_rotation=sigma_rotation,
        shared_unloaded=shared_unloaded,
        continuous=continuous,
        metadata=dict(metadata or {}),
        sources=(source,),
        units=dict(units or {}),
        sigma_load=None if sigma_load is None else positive(sigma_load, f"{source}: sigma_load"),
        targets=tuple(targets),
        camera=camera,
    )
