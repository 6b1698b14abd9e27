"""Keys of caches for what depends on some parts of a robot only."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from beamstiff.robot.description import Robot


class Same:
    """Objects that never change, as a key: the same objects are equal, for comparing them would take long.

    `of`: what has these parts, and is not compared: other objects with the same parts are as good.
    """

    def __init__(self, *parts: object, of: Any = None) -> None:
        self.parts, self.of = parts, of

    def __hash__(self) -> int:
        return hash(tuple(map(id, self.parts)))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Same) and all(
            one is another for one, another in zip(self.parts, other.parts, strict=True)
        )


def geometry_of(robot: Robot) -> tuple[object, ...]:
    """Return the parts that say where frames and nodes are: robots of other stiffness share them."""
    return robot.variables, robot.frames, robot.nodes, robot.loops
