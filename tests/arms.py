"""Arms of rigid links in the plane x, y, which many tests work out by hand."""

from collections.abc import Sequence
from typing import Any

from beamstiff.robot.description import Robot
from beamstiff.robot.parts import Frame, Joint, JointStiffness, Node, Rigid, Variable


def planar_arm(
    name: str,
    lengths: Sequence[float],
    springs: Sequence[float | JointStiffness],
    nodes: str,
    links: Sequence[str],
    joints: Sequence[str] = ("J1", "J2", "J3"),
    limits: tuple[float, float] | None = None,
    **more: Any,
) -> Robot:
    """Return links from joint to joint; `nodes` are the foot and both ends of each link, the last the TCP."""
    foot, *ends = nodes.split()
    numbers = range(1, len(lengths) + 1)
    stiffness = [one if isinstance(one, JointStiffness) else JointStiffness(torsional=one) for one in springs]
    parents, offsets = ["base", *(f"f{at}" for at in numbers)], [0.0, *lengths]
    before = [foot, *ends[1::2]]
    return Robot(
        name=name,
        variables=[Variable(name=f"q{at}", type="revolute", limits=limits) for at in numbers],
        frames=[
            Frame(name=f"f{at}", parent=parents[at - 1], d=offsets[at - 1], theta=f"q{at}") for at in numbers
        ],
        nodes=[Node(name=foot)]
        + [
            Node(name=ends[at], frame=f"f{at // 2 + 1}", at=(lengths[at // 2] * (at % 2), 0, 0))
            for at in range(len(ends))
        ],
        rigids=[Rigid(name=link, nodes=ends[2 * at : 2 * at + 2]) for at, link in enumerate(links)],
        joints=[
            Joint(
                name=joints[at],
                nodes=[before[at], ends[2 * at]],
                frame=f"f{at + 1}",
                variable=f"q{at + 1}",
                stiffness=stiffness[at],
            )
            for at in range(len(lengths))
        ],
        fixed=[foot],
        tcp=ends[-1],
        **more,
    )


def on_rail(robot: Robot, travel: float = 2.0) -> Robot:
    """Return a robot on a rigid carriage, which slides along z of the base frame as ``e1`` says."""
    first, *frames = robot.frames
    rail = Variable(name="e1", type="prismatic", limits=(-travel, travel))
    moved = [node.model_copy(update={"frame": "rail"}) for node in robot.nodes if node.frame == "base"]
    others = [node for node in robot.nodes if node.frame != "base"]
    foot = next(node for node in moved if node.name in robot.fixed)
    slide = Joint(
        name="rail", nodes=["ground", foot.name], frame="rail", variable="e1", stiffness=JointStiffness()
    )
    return robot.model_copy(
        update={
            "variables": (rail, *robot.variables),
            "frames": (
                Frame(name="rail", parent="base", r="e1"),
                first.model_copy(update={"parent": "rail"}),
                *frames,
            ),
            "nodes": (Node(name="ground", frame="rail"), *moved, *others),
            "joints": (slide, *robot.joints),
            "fixed": ("ground",),
        }
    )
