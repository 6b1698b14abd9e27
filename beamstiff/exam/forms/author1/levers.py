"""Rods whose lever arm about the axis changes with the joint angle, and spring balancers across an axis."""

from functools import partial

import numpy as np

from beamstiff.exam.added_parts import axis_in_the_middle, lever, with_balancer, with_rod
from beamstiff.exam.campaign import Array, Truth
from beamstiff.exam.components import stiffness_of, turning_drives
from beamstiff.exam.effect import Drive, Reality, built, form, in_pose
from beamstiff.exam.laws import Curved, Situation
from beamstiff.exam.machine import in_the_middle, joints_of, machine_of, stroke
from beamstiff.exam.parameters import DrawRequest, Parameters
from beamstiff.exam.rotations import turned_by
from beamstiff.robot.description import Robot

SWING = (1.15, 4.0)  # stiffness at the middle over that at an end of the range
WIDEST = np.deg2rad(75.0)  # half the range that a rod can serve
NEAR = 0.3  # of the swing's logarithm: else a rod sits behind gears
GEARED = np.deg2rad(130.0)  # and with gears
CLEAR = np.deg2rad(12.0)  # from its dead centres
SHARE = (0.03, 0.7)  # of the drive's stiffness that it adds where its lever is longest
PULL = (1e3, 3e4)  # N in the middle of the range
LEVEL = 0.5  # cosine to the vertical of the axes that weight turns


def rod_drives(robot: Robot) -> list[str]:
    """Return the turning drives whose range a rod can serve, by gears perhaps; all where there is none."""
    found = turning_drives(robot)
    return [name for name in found if stroke(robot, name)[1] <= GEARED] or found


def draw_lever(request: DrawRequest) -> dict[str, float]:
    """Return the crank: `start`, its angle to the frame at mid-range; `gear`, its turn over the joint's."""
    middle, half = stroke(request.robot, request.component)
    swing = request.sized(*SWING)
    crank, frame = request.uniform(0.2, 0.35), request.uniform(0.8, 1.3)
    way = request.sign()
    direct = [1.0] if request.form == "rod" and half <= WIDEST else []
    best = (np.inf, 0.0, 0.0)
    for gear in (*direct, *np.linspace(0.1, 1.0, 46).tolist()):
        reach = gear * half
        low, high = CLEAR + reach, np.pi - CLEAR - reach
        if low >= high:
            continue
        starts = np.linspace(low, high, 41)
        arms = lever(crank, frame, starts[:, None] + np.linspace(-reach, reach, 31))[0] ** 2
        miss = np.abs(np.log(arms.max(axis=1) / arms.min(axis=1) / swing))
        at = int(miss.argmin())
        if miss[at] < best[0]:
            best = (float(miss[at]), float(starts[at]), float(gear))
        if gear == 1.0 and best[0] < NEAR:
            break  # a rod on the joint itself
    return {"crank": crank, "frame": frame, "start": best[1], "gear": best[2], "way": way, "middle": middle}


def _rod(truth: Truth, reality: Reality) -> Reality:
    """Return the reality with a rod on the joint itself in place of its drive, or behind gears."""
    p, machine, variable = truth.parameters, reality.machine, str(truth.component)
    if p["gear"] != 1.0:
        return _GEARED.impose(truth, reality)
    k, arm = stiffness_of(machine.robot, variable), float(lever(p["crank"], p["frame"], p["start"])[0])
    for name, own in joints_of(machine.robot, variable):
        machine = machine.with_stiffness(name, own, 0.0)
        machine = with_rod(machine, name, (p["crank"], p["frame"]), p["way"] * p["start"], k / arm**2, None)
    return reality.with_machine(machine)


def _geared(p: Parameters, drive: Drive, e: Array, situation: Situation) -> Curved:
    arm = float(lever(p["crank"], p["frame"], p["start"])[0])
    now = lever(p["crank"], p["frame"], angle_of(p, drive.component, situation))[0]
    k = stiffness_of(drive.robot, drive.component) * (now / arm) ** 2
    return k * e, k


def angle_of(p: Parameters, variable: str, situation: Situation) -> Array:
    """Return the crank's angle to the frame, (P,), rad, kept clear of its dead centres."""
    angle = p["start"] + p["way"] * p["gear"] * (situation.values[variable] - p["middle"])
    return np.asarray(np.clip(angle, 0.5 * CLEAR, np.pi - 0.5 * CLEAR))


def balanced_axes(robot: Robot) -> list[str]:
    """Return the level axes among the first three that are driven."""
    g = np.array(robot.gravity)
    if not g.any():
        return []
    machine = machine_of(robot)
    main = [variable.name for variable in robot.actuated][:3]
    found = []
    for name in turning_drives(robot):
        axis, _ = axis_in_the_middle(machine, joints_of(robot, name)[0][0])
        if name in main and abs(axis @ g) < LEVEL * np.linalg.norm(g):
            found.append(name)
    return found


def draw_balancer(request: DrawRequest) -> dict[str, float]:
    """Return the spring: pull N at mid-range, stiffness (at small strains) over the drive's, and place."""
    middle, _ = stroke(request.robot, request.component)
    crank, frame = request.uniform(0.2, 0.4), request.uniform(0.8, 1.4)
    pull = request.sized(*PULL) * request.uniform(0.6, 1.5)
    return {
        "share": request.sized(*SHARE),
        "pull": pull,
        "growth": pull * request.uniform(1.0, 3.0),  # N/m over the stroke
        "crank": crank,
        "frame": frame,
        "angle": request.sign() * request.uniform(np.deg2rad(40.0), np.deg2rad(140.0)),
        "middle": middle,
        "way": _way(request.robot, str(request.component)),
    }


def _way(robot: Robot, variable: str) -> float:
    """Return whether the joint turns with or against its axis when the variable grows."""
    machine = machine_of(robot)
    hinge = machine.hinge(joints_of(robot, variable)[0][0])
    here, there = in_the_middle(robot), in_the_middle(robot, **{variable: 1e-3})
    a, b = (machine.node(n).frame for n in hinge.nodes)
    relative = [p.rotations[a][0].T @ p.rotations[b][0] for p in (here, there)]
    spin = here.rotations[a][0] @ turned_by(relative[1] @ relative[0].T)
    return float(np.sign(spin @ (here.rotations[hinge.frame][0] @ hinge.axes[:, 0])))


def _coil(p: Parameters, strong: float, longer: Array) -> Curved:
    return np.full_like(longer, strong), p["pull"] + p["growth"] * longer


def _gas(p: Parameters, strong: float, longer: Array) -> Curved:
    """Return a gas spring: polytropic, squeezed where the rod is drawn out."""
    squeezed = 1.0 - np.minimum(longer / (1.3 * p["pull"] / p["growth"]), 0.7)
    pull = p["pull"] * squeezed**-1.3
    return strong * pull / p["pull"], pull


_GEARED = in_pose("actuator-lever", "geared", _geared, draw_lever)
FORMS = (
    form("actuator-lever", "rod", _rod, draw_lever),
    _GEARED,
    built("gravity-compensator", "coil", partial(with_balancer, _coil), draw_balancer),
    built("gravity-compensator", "gas", partial(with_balancer, _gas), draw_balancer),
)
