"""Geometry that is off with its neighbours, tools that sit turned, payloads that are not as told."""

import dataclasses

import numpy as np

from beamstiff.exam.campaign import Array, Truth
from beamstiff.exam.components import slender
from beamstiff.exam.draws import PHASE, by_reach, direction, each, evenly, signed, sized
from beamstiff.exam.effect import Seen, built, form, load
from beamstiff.exam.machine import Machine
from beamstiff.exam.parameters import DrawRequest, Parameters, vector
from beamstiff.exam.reality import Reality
from beamstiff.robot.parts import FRAME_PARAMETERS, Mass

MOST = 0.25  # of the main error: each of those beside it
MARKED = 0.02  # of a tool's offset: where positions are read, the tool was measured with more care
ROUND = 0.05  # of a force: sidelong pulls at a pin, between its two ends
STILL = ("still_x", "still_y", "still_z")


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


def _turned(truth: Truth, reality: Reality) -> Reality:
    """Return the reality with a tool turned on its flange by dowels with play: all on it goes round."""
    p = truth.parameters
    before, after = p["way"], p["way"] + p["turned"]
    move = p["off"] * np.array([np.cos(after) - np.cos(before), np.sin(after) - np.sin(before), 0.0])
    share = {"lever": 1.0, "target": 1.0, "marked": MARKED}
    there = {n: tuple(map(float, getattr(reality, n) + part * move)) for n, part in share.items()}
    return dataclasses.replace(reality, **there)  # type: ignore[arg-type]


def _draw_pin(request: DrawRequest) -> dict[str, float]:
    length = request.sized(3e-3, 0.15) / np.sqrt(slender(request.robot))
    return request.direction(length) | request.direction(length * request.uniform(0.1, 0.4), STILL)


def _pin(p: Parameters, seen: Seen, wrench: Array) -> Array:
    """Return loads of which a pull sits at one end of a pin in its clevis, a push at the other."""
    half, axes, force = vector(p), seen.tool_axes, wrench[:, :3]
    pull = np.einsum("pij,j,pi->p", axes, half / np.linalg.norm(half), force)
    end = np.tanh(pull / np.maximum(ROUND * np.linalg.norm(force, axis=1), 1e-12))
    return seen.with_arm(wrench, (axes @ (vector(p, STILL) + end[:, None] * half)[..., None])[..., 0])


def _draw_box(request: DrawRequest) -> dict[str, float]:
    way, off = request.uniform(0.0, 2.0 * np.pi), by_reach(evenly(0.12, 0.4))(request)
    found = {"mass": request.sized(0.01, 0.4) * _capacity(request)}
    found |= {"x": off * float(np.cos(way)), "y": off * float(np.sin(way))}
    return found | {"z": -by_reach(evenly(0.02, 0.3))(request)}


def _capacity(request: DrawRequest) -> float:
    """Return the payload that the model has, or that such a robot usually carries, kg."""
    carried = sum(mass.mass for mass in request.robot.masses if mass.node == request.robot.tcp)
    return float(carried or 100.0 / slender(request.robot) ** 2)


def _box(p: Parameters, machine: Machine, _: str) -> Machine:
    return machine.plus(masses=(Mass(node=machine.tcp, mass=p["mass"], at=(p["x"], p["y"], p["z"])),))


def _half_empty(p: Parameters, machine: Machine, _: str) -> Machine:
    """Return the machine whose payload is fuller or emptier, and whose centre moves with the filling."""

    def filled(mass: Mass) -> Mass:
        centre = np.array(mass.at) + p["share"] * vector(p)
        changed = {"mass": mass.mass * (1.0 + p["share"]), "at": tuple(map(float, centre))}
        return mass.model_copy(update=changed)

    masses = [filled(mass) if mass.node == machine.tcp else mass for mass in machine.masses]
    if all(mass.node != machine.tcp for mass in masses):
        at = tuple(map(float, vector(p)))
        masses.append(Mass(node=machine.tcp, mass=abs(p["share"]) * p["usual"], at=at))  # type: ignore[arg-type]
    return dataclasses.replace(machine, masses=tuple(masses))


FORMS = (
    form("geometry-error", "bent-link", _geometry, _bent),
    form("geometry-error", "stacked-zeros", _geometry, _stacked),
    form("tool-offset", "turned-on-flange", _turned,
         off=by_reach(evenly(0.06, 0.25)), way=PHASE, turned=signed(sized(0.015, 0.8))),
    load("tool-offset", "pin-in-clevis", _pin, _draw_pin),
    built("payload-error", "half-empty", _half_empty, each(share=signed(sized(0.015, 0.7))),
          direction(by_reach(evenly(0.05, 0.2))), usual=_capacity),
    built("payload-error", "box-beside", _box, _draw_box),
)  # fmt: skip
