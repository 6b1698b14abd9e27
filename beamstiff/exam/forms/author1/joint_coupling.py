"""Torque on one axis that turns another."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from beamstiff.exam.campaign import Truth
from beamstiff.exam.effect import DrawRequest, Effect, stiffness_of, turning_drives
from beamstiff.exam.machine import Cross, joints_of
from beamstiff.exam.reality import Reality
from beamstiff.robot.description import Robot

SHARE = (0.02, 0.8)  # of the geometric mean of the two compliances


def places(robot: Robot) -> list[str | None]:
    """Return neighbouring drives, and the outer two of the last three (a wrist)."""
    order = [v.name for v in robot.variables]
    names = sorted((str(n) for n in turning_drives(robot)), key=order.index)
    pairs = list(pairwise(names))
    if len(names) >= 6:
        pairs.append((names[-3], names[-1]))
    return [f"{a}+{b}" for a, b in pairs]


def draw(request: DrawRequest) -> dict[str, float]:
    """Return how strongly and which way the two joints are linked."""
    found = {"share": request.sign() * request.sized(*SHARE)}
    if request.form == "gear":
        found["ratio"] = request.uniform(0.5, 2.0)
    return found


def impose(truth: Truth, reality: Reality) -> Reality:
    """Return the reality with the two joints linked."""
    p, machine = truth.parameters, reality.machine
    first, second = (stiffness_of(machine.robot, name) for name in str(truth.component).split("+"))
    k = np.diag([first, second])
    if truth.form == "compliance":
        cross = p["share"] / np.sqrt(first * second)
        added = np.linalg.inv(np.array([[1 / first, cross], [cross, 1 / second]])) - k
    else:
        # a third spring between the two gears; its stiffness gives the wanted share of coupling
        n = np.array([1.0, -np.sign(p["share"]) * p["ratio"] * np.sqrt(first / second)])
        a, b, share = n[0] ** 2 / first, n[1] ** 2 / second, min(abs(p["share"]), 0.9)
        # coupling of k + s n n^T: s|n1 n2|/sqrt(k1 k2 ...) grows with s; solved by bisection
        low, high = 0.0, 1e3 * (first + second)
        for _ in range(80):
            s = 0.5 * (low + high)
            coupled = s * np.sqrt(a * b) / np.sqrt((1 + s * a) * (1 + s * b))
            low, high = (s, high) if coupled < share else (low, s)
        added = s * np.outer(n, n)
    one, two = (joints_of(machine.robot, name)[0] for name in str(truth.component).split("+"))
    return reality.with_machine(machine.plus(crosses=(Cross(one, two, added),)))


EFFECT = Effect("joint-coupling", ("compliance", "gear"), places, draw, impose)
