"""Geometry that is off with its neighbours, tools that sit turned, payloads that are not as told."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from beamstiff.exam.campaign import Array, SimulatedCampaign, Truth
from beamstiff.exam.effect import DrawRequest, nowhere, slender, vector
from beamstiff.exam.forms.author4.by_form import Form, effect_of, prefixed, way_of
from beamstiff.exam.placing import Placed
from beamstiff.exam.reality import Reality
from beamstiff.robot.description import Robot
from beamstiff.robot.parts import FRAME_PARAMETERS, Mass

MOST = 0.25  # of the main error: each of those beside it
MARKED = 0.02  # of a tool's offset: where positions are read, the tool was measured with more care
ROUND = 0.05  # of a force: sidelong pulls at a pin, between its two ends


def parameters_of(robot: Robot) -> Sequence[str | None]:
    """Return the inner encoders' zeros, and the frames' lengths and angles that are not zero."""
    named = [
        f"{f.name}.{n}" for f in robot.frames for n in ("alpha", "d", "r") if getattr(f, n) not in (0, 0.0)
    ]
    return [*(v.name for v in robot.actuated[1:-1]), *named]


def _amount(request: DrawRequest) -> float:
    frame, _, parameter = str(request.component).partition(".")
    kinds = {v.name: v.kind for v in request.robot.variables}
    length = (FRAME_PARAMETERS[parameter] if parameter else kinds[frame]) == "length"
    return request.sign() * (request.sized(6e-5, 3e-3) if length else request.sized(5e-5, 2.5e-3))


def _bent(request: DrawRequest) -> dict[str, float]:
    """Draw an error, and smaller ones of the same frame, of either kind: 1 mrad goes with 1 mm."""
    main = _amount(request)
    frame, _, parameter = str(request.component).partition(".")
    shares = [request.sign() * request.uniform(0.05, 0.2) for _ in range(2)]
    found = {"main": main}
    if parameter and not request.robot.loops:
        others = [name for name in ("alpha", "d", "r") if name != parameter]
        found |= {f"{frame}.{n}": share * main for n, share in zip(others, shares, strict=True)}
    return found


def _stacked(request: DrawRequest) -> dict[str, float]:
    """Draw an error, and those of all inner encoders' zeros beside it, mostly small, some not."""
    main = _amount(request)
    inner = [v.name for v in request.robot.actuated[1:-1] if v.name != request.component]
    shares = np.clip(request.rng.laplace(0.0, 0.06, len(inner)), -MOST, MOST)
    return {"main": main} | {n: main * float(s) for n, s in zip(inner, shares, strict=True)}


def _geometry(truth: Truth, reality: Reality) -> Reality:
    main = str(truth.component)
    return reality.with_errors({main if n == "main" else n: error for n, error in truth.parameters.items()})


def _turned(request: DrawRequest) -> dict[str, float]:
    return {
        "off": request.uniform(0.06, 0.25) / float(np.sqrt(slender(request.robot))),
        "way": request.uniform(0.0, 2.0 * np.pi),
        "turned": request.sign() * request.sized(0.015, 0.8),
    }


def _clevis(request: DrawRequest) -> dict[str, float]:
    length = request.sized(3e-3, 0.15) / np.sqrt(slender(request.robot))
    return {**request.direction(length), **way_of(request, length * request.uniform(0.1, 0.4), "still_")}


def _tool(truth: Truth, reality: Reality) -> Reality:
    p = truth.parameters
    if truth.form == "turned-on-flange":  # by dowels with play: all that the tool carries goes round
        before, after = p["way"], p["way"] + p["turned"]
        move = p["off"] * np.array([np.cos(after) - np.cos(before), np.sin(after) - np.sin(before), 0.0])
        share = {"lever": 1.0, "target": 1.0, "marked": MARKED}
        there = {n: tuple(map(float, getattr(reality, n) + part * move)) for n, part in share.items()}
        return dataclasses.replace(reality, **there)  # type: ignore[arg-type]
    tcp = reality.machine.node(reality.machine.tcp)
    half, still = vector(p), prefixed(p, "still_")

    def change(campaign: SimulatedCampaign, placed: Placed, wrench: Array) -> Array:
        axes, force = placed.rotations[tcp.frame], wrench[:, :3]
        pull = np.einsum("pij,j,pi->p", axes, half / np.linalg.norm(half), force)
        # a pull sits at one end of the pin, a push at the other
        end = np.tanh(pull / np.maximum(ROUND * np.linalg.norm(force, axis=1), 1e-12))
        lever = (axes @ (still + end[:, None] * half)[..., None])[..., 0]
        lever = np.where((campaign.load_point == tcp.name)[:, None], lever, 0.0)
        return np.concatenate([force, wrench[:, 3:] + np.cross(lever, force)], axis=1)

    return reality.with_load(change)


def _emptied(request: DrawRequest) -> dict[str, float]:
    return {
        "share": request.sized(0.015, 0.7) * request.sign(),
        **request.direction(request.uniform(0.05, 0.2) / np.sqrt(slender(request.robot))),
        "usual": _capacity(request.robot),
    }


def _box(request: DrawRequest) -> dict[str, float]:
    way, off = request.uniform(0.0, 2.0 * np.pi), request.uniform(0.12, 0.4)
    off = off / np.sqrt(slender(request.robot))
    return {
        "mass": request.sized(0.01, 0.4) * _capacity(request.robot),
        "x": off * float(np.cos(way)),
        "y": off * float(np.sin(way)),
        "z": -request.uniform(0.02, 0.3) / np.sqrt(slender(request.robot)),
    }


def _capacity(robot: Robot) -> float:
    """Return the payload that the model has, or that such a robot usually carries, kg."""
    carried = sum(mass.mass for mass in robot.masses if mass.node == robot.tcp)
    return float(carried or 100.0 / slender(robot) ** 2)


def _payload(truth: Truth, reality: Reality) -> Reality:
    p, machine = truth.parameters, reality.machine
    tcp = machine.tcp
    if truth.form == "box-beside":
        added = Mass(node=tcp, mass=p["mass"], at=(p["x"], p["y"], p["z"]))
        return reality.with_machine(machine.plus(masses=(added,)))
    masses = []
    held = False
    for mass in machine.masses:
        if mass.node == tcp:  # fuller or emptier, and its centre moves with the filling
            held = True
            centre = np.array(mass.at) + p["share"] * vector(p)
            changed = {"mass": mass.mass * (1.0 + p["share"]), "at": tuple(map(float, centre))}
            masses.append(mass.model_copy(update=changed))
        else:
            masses.append(mass)
    if not held:
        at = tuple(map(float, vector(p)))
        masses.append(Mass(node=tcp, mass=abs(p["share"]) * p["usual"], at=at))  # type: ignore[arg-type]
    return reality.with_machine(dataclasses.replace(machine, masses=tuple(masses)))


EFFECTS = (
    effect_of(
        "geometry-error",
        parameters_of,
        {"bent-link": Form(_bent, _geometry), "stacked-zeros": Form(_stacked, _geometry)},
    ),
    effect_of(
        "tool-offset",
        nowhere,
        {"turned-on-flange": Form(_turned, _tool), "pin-in-clevis": Form(_clevis, _tool)},
    ),
    effect_of(
        "payload-error", nowhere, {"half-empty": Form(_emptied, _payload), "box-beside": Form(_box, _payload)}
    ),
)
