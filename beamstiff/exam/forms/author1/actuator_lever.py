"""Drives by a rod whose lever arm about the axis changes with the joint angle."""

from __future__ import annotations

import dataclasses

import numpy as np

from beamstiff.exam.across import Across, across, lever, with_rod
from beamstiff.exam.campaign import Array, Truth
from beamstiff.exam.effect import DrawRequest, Effect, at_joints, stiffness_of, stroke, turning_drives
from beamstiff.exam.laws import Situation, Stiffness
from beamstiff.exam.machine import joints_of
from beamstiff.exam.reality import Reality
from beamstiff.robot.description import Robot

SWING = (1.15, 4.0)  # stiffness at the middle over that at an end of the range
WIDEST = np.deg2rad(75.0)  # half the range that a rod can serve
NEAR = 0.3  # of the swing's logarithm: else a rod sits behind gears
GEARED = np.deg2rad(130.0)  # and with gears
CLEAR = np.deg2rad(12.0)  # from its dead centres


def places(robot: Robot) -> list[str | None]:
    """Return the turning drives whose range a rod can serve, by gears perhaps; all where there is none."""
    found = turning_drives(robot)
    return [name for name in found if stroke(robot, name)[1] <= GEARED] or found


def draw(request: DrawRequest) -> dict[str, float]:
    """Return the crank's shape; the stiffness is that of the drive at mid-range.

    The crank's angle to the frame is `start` at mid-range; `gear` is its turn over the joint's.
    """
    middle, half = stroke(request.robot, request.component)
    swing = request.sized(*SWING)
    crank, frame = request.uniform(0.2, 0.35), request.uniform(0.8, 1.3)
    way = request.sign()
    direct = [1.0] if request.form == "rod" and half <= WIDEST else []
    best: tuple[float, float, float] | None = None
    for gear in (*direct, *np.linspace(0.1, 1.0, 46).tolist()):
        reach = gear * half
        low, high = CLEAR + reach, np.pi - CLEAR - reach
        if low >= high:
            continue
        starts = np.linspace(low, high, 41)
        arms = lever(crank, frame, starts[:, None] + np.linspace(-reach, reach, 31))[0] ** 2
        miss = np.abs(np.log(arms.max(axis=1) / arms.min(axis=1) / swing))
        at = int(miss.argmin())
        if best is None or miss[at] < best[0]:
            best = (float(miss[at]), float(starts[at]), float(gear))
        if gear == 1.0 and best[0] < NEAR:
            break  # a rod on the joint itself
    assert best is not None
    return {"crank": crank, "frame": frame, "start": best[1], "gear": best[2], "way": way, "middle": middle}


def impose(truth: Truth, reality: Reality) -> Reality:
    """Return the reality with the joint driven through a lever."""
    p, variable = truth.parameters, str(truth.component)
    joint_stiffness = stiffness_of(reality.machine.robot, variable)
    arm = float(lever(p["crank"], p["frame"], p["start"])[0])
    machine = reality.machine
    if truth.form == "rod" and p["gear"] == 1.0:
        place = Across(variable, p["crank"], p["frame"], p["way"] * p["start"])
        for name, own in joints_of(machine.robot, variable):
            hinge = machine.hinge(name)
            free = hinge.stiffness.copy()
            free[own] = 0.0
            machine = machine.with_hinge(dataclasses.replace(hinge, stiffness=free))
            machine = with_rod(machine, across(machine, name, place), joint_stiffness / arm**2, None)
        return reality.with_machine(machine)

    def stiffness(situation: Situation) -> Array:
        angle = p["start"] + p["way"] * p["gear"] * (situation.values[variable] - p["middle"])
        angle = np.clip(angle, 0.5 * CLEAR, np.pi - 0.5 * CLEAR)
        return np.asarray(joint_stiffness * (lever(p["crank"], p["frame"], angle)[0] / arm) ** 2)

    return at_joints(truth, reality, lambda _: Stiffness(stiffness))


EFFECT = Effect("actuator-lever", ("rod", "geared"), places, draw, impose)
