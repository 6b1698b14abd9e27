"""What really happens in a campaign: the machine, its geometry, the loads on it and the readings of it."""

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Self

import numpy as np
from numpy.typing import NDArray

from beamstiff.exam.campaign import Array, SimulatedCampaign
from beamstiff.exam.machine import Machine
from beamstiff.exam.placing import Placed

# wrenches as they act, (N, 6), from the campaign, the machine placed at its rows, and the wrenches as read
LoadChange = Callable[[SimulatedCampaign, Placed, Array], Array]
# values as read, (N, 6), from the campaign, the machine placed at its rows, and the values as they are
ReadingChange = Callable[[SimulatedCampaign, Placed, Array], Array]
# where the drives are, (P, A), from what their encoders read
EncoderChange = Callable[[Array], Array]


@dataclass(frozen=True, eq=False)
class Reality:
    """A machine and a campaign on it as they really are.

    `geometry`: mapping of str to float, rad or m; errors of frame parameters (``f3.d``) and offsets of
        encoders (``q2``).
    `lever`: (3,) tuple, m; from the load's node to the true point of action, in the frame of the node.
    `target`: (3,) tuple, m; from the measured node to the true reflector, in the frame of the node, where
        displacements are read.
    `marked`: (3,) tuple, m; the same where absolute positions are read.
    """

    machine: Machine
    geometry: Mapping[str, float] = field(default_factory=dict)
    loads: tuple[LoadChange, ...] = ()
    readings: tuple[ReadingChange, ...] = ()
    encoders: tuple[EncoderChange, ...] = ()  # errors of encoders that change with the angle
    lever: tuple[float, float, float] = (0.0, 0.0, 0.0)
    target: tuple[float, float, float] = (0.0, 0.0, 0.0)
    marked: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def with_machine(self, machine: Machine) -> Self:
        """Return the same with another machine."""
        return dataclasses.replace(self, machine=machine)

    def with_errors(self, errors: Mapping[str, float]) -> Self:
        """Return the same with errors added to the geometry."""
        more = {name: self.geometry.get(name, 0.0) + error for name, error in errors.items()}
        return dataclasses.replace(self, geometry={**self.geometry, **more})

    def with_encoder(self, variable: str, error: Callable[[Array], Array]) -> Self:
        """Return the same with one more error of an encoder, from what it reads (P,)."""
        at = [v.name for v in self.machine.robot.actuated].index(variable)

        def change(q: Array) -> Array:
            moved = q.copy()
            moved[:, at] += error(q[:, at])
            return moved

        return dataclasses.replace(self, encoders=(*self.encoders, change))


def places_of(machine: Machine, nodes: NDArray[np.str_], placed: Placed) -> Array:
    """Return where the node of every row is, (N, 3), m, on the placed machine."""
    places = np.empty((len(nodes), 3))
    for name in np.unique(nodes):
        rows = nodes == name
        places[rows] = placed.node(machine.node(str(name)))[rows]
    return places


def axes_of(machine: Machine, nodes: NDArray[np.str_], placed: Placed) -> Array:
    """Return the axes of the frame of every row's node, (N, 3, 3), on the placed machine."""
    frames = [machine.node(str(name)).frame for name in nodes]
    return np.stack([placed.rotations[frame][row] for row, frame in enumerate(frames)])
