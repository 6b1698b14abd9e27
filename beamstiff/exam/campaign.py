"""What the exam draws: the effect that a machine really has, and the campaign in which it is measured."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any, Literal, Self

import numpy as np
from numpy.typing import NDArray

from beamstiff.errors import BeamstiffError

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
Names = NDArray[np.str_]
ROWS = ("q", "wrench", "pose", "step", "time", "temperature", "point", "load_point")


@dataclass(frozen=True)
class Truth:
    """An effect as the simulated machine has it: the label that the diagnosis must find."""

    effect: str  # name of the effect, as in the table of effects; or of one outside that table
    component: str | None  # where it sits
    form: str  # constitutive form, for instance ``"iwan"``
    parameters: Mapping[str, float] = field(default_factory=dict)  # the simulator's own of that form, SI

    @property
    def label(self) -> str:
        """``effect:component``, null for none."""
        return f"{self.effect}:{'null' if self.component is None else self.component}"


@dataclass(frozen=True, eq=False)
class SimulatedCampaign:
    """Which states are measured, in which order, and how well; N rows, A actuated variables."""

    q: Array  # (N, A): rad or m; drive-side readings, in the order of ``robot.actuated``
    wrench: Array  # (N, 6): N and N m; as read, at `load_point`, base frame
    pose: Integers  # (N,)
    step: Integers  # (N,): order within the pose; rows of equal pose and step are one state
    time: Array  # (N,): s
    temperature: Array  # (N,): degC
    point: Names  # (N,): node that is read
    load_point: Names  # (N,): node that is loaded
    kind: Literal["displacement", "absolute"] = "displacement"
    sigma_position: float = 0.0  # m: true noise of a value in the table, per component; 0 for none
    sigma_rotation: float = 0.0  # rad
    claimed_position: float | None = None  # m: what the table says of its noise
    claimed_rotation: float | None = None  # rad
    shared_unloaded: bool = False  # a pose's rows are differenced with one reading of their point
    rotations: bool = True  # whether rotations are measured as well

    def __post_init__(self) -> None:
        rows = len(self.q)
        one = ("pose", "step", "time", "temperature", "point", "load_point")
        shapes: dict[str, tuple[int, ...]] = {"wrench": (rows, 6), **dict.fromkeys(one, (rows,))}
        for name, shape in shapes.items():
            if np.shape(getattr(self, name)) != shape:
                found = np.shape(getattr(self, name))
                raise BeamstiffError(f"campaign: {name}: found shape {found}, expected {shape}")

    def __len__(self) -> int:
        return len(self.q)

    def states(self) -> tuple[Integers, Integers, Integers, Integers]:
        """Return states' first rows, rows' states, states' poses and turns in these; by pose, then step."""
        keys = np.stack([self.pose, self.step], axis=1)
        states, first, state_of = np.unique(keys, axis=0, return_index=True, return_inverse=True)
        pose = states[:, 0]
        turn = np.arange(len(pose)) - np.searchsorted(pose, pose)
        return first, state_of.reshape(-1), pose, turn

    def at(self, rows: Any) -> Self:
        """Return the campaign of some of the rows, in any order, or as often as they are named."""
        return replace(self, **{name: getattr(self, name)[rows] for name in ROWS})


def some(thing: Any, rows: Any) -> Any:
    """Return some rows, in any order, of an array, or of all arrays in a tuple, mapping or dataclass."""
    if isinstance(thing, np.ndarray):
        return thing[rows]
    if isinstance(thing, tuple):
        return tuple(some(part, rows) for part in thing)
    if isinstance(thing, Mapping):
        return {name: some(part, rows) for name, part in thing.items()}
    return type(thing)(*(some(getattr(thing, field.name), rows) for field in fields(thing)))
