"""The equilibrium of the loaded machine to second order: against exact equilibria and the elastica."""

import numpy as np
import pytest

from beamstiff.fem.geometric_stiffness import loaded_compliance, loaded_displacement
from beamstiff.fem.static_response import nodal_loads
from beamstiff.fem.structure import compile_structure
from beamstiff.measure.table import make_measurements
from beamstiff.model.linear import predict_displacements
from beamstiff.se3 import Array
from tests.fem.builders import STEEL, at_rest, frame, relative_error, some_rotation
from tests.fem.random_frames import machine_frame
from tests.fem.rigid_bodies import RigidBodies
from tests.fem.test_geometric_stiffness import MACHINES


def falls_with_the_third_power(errors: list[float], size: float) -> bool:
    """Return whether errors at halved loads are of third order, or rounding."""
    first, second = errors
    return second < first / 6.5 or second < 1e-9 * size


@pytest.mark.parametrize("name", MACHINES)
@pytest.mark.parametrize("payload", [False, True], ids=["wrenches", "payload"])
def test_machines_of_rigid_bodies_move_as_in_their_exact_equilibrium(name: str, payload: bool) -> None:
    """What is left falls with the third power of the load; the linear displacement misses the second."""
    points, tcp, parts = MACHINES[name]
    push = np.random.default_rng(len(name)).normal(size=(len(points), 6)) * ([200] * 3 + [100] * 3)
    push[list(parts.get("fixed", (0,)))] = 0.0
    errors, shares = [], (0.2, 0.1)
    for share in shares:
        loads, weight = share * push, {}
        if payload:
            weight = {"masses": [(tcp, 30.0, (0.3, 0.2, -0.4))], "gravity": (0, 0, -9.81 * share)}
        structure = compile_structure(frame(points, tcp=tcp, **parts, **weight))
        found = loaded_displacement(structure, at_rest(structure), loads[None], gravity=payload)[0]
        exact = RigidBodies(points, **parts, **weight).displacement(loads, gravity=payload)
        errors.append(float(np.abs(found - exact).max()))
    assert falls_with_the_third_power(errors, float(np.abs(exact).max()))
    assert errors[0] < 1e-3 * np.abs(exact).max()


@pytest.mark.parametrize("elements", [1, 3])
def test_the_tip_of_a_bent_beam_draws_in(elements: int) -> None:
    """By P^2 L^5 / 15 (EI)^2, half of the integral of the slope's square, v' = P (L x - x^2/2) / EI.

    The force pulls along the turned beam: that lengthens it by P v / EA.
    """
    rotation, force, length = some_rotation(2), 400.0, 2.0
    points = np.linspace(0, length, elements + 1)[:, None] * rotation[:, 0]
    beams = [(at, at + 1) for at in range(elements)]
    robot = frame(points, beams=beams, up=rotation[:, 1], gravity=(0, 0, 0), material=STEEL)
    structure = compile_structure(robot)
    load = nodal_loads(structure, 1, {robot.tcp: np.array([*(force * rotation[:, 1]), 0, 0, 0])})
    moved = rotation.T @ loaded_displacement(structure, at_rest(structure), load)[0, -1, :3]
    EI, EA = (STEEL.E * structure.beam_properties[name][0] for name in ("Iz", "A"))
    tip = force * length**3 / (3 * EI)
    assert moved[1] == pytest.approx(tip, rel=1e-5)
    assert moved[0] == pytest.approx(force * tip / EA - 9 / 15 * tip**2 / length, rel=1e-4)


def difference(name: str, share: float, moved: bool) -> float:
    """Return by how much the compliance under a payload is off, of itself, against exact equilibria."""
    points, tcp, parts = MACHINES[name]
    weight = {"masses": [(tcp, 30.0, (0.3, 0.2, -0.4))], "gravity": (0, 0, -9.81 * share)}
    structure = compile_structure(frame(points, tcp=tcp, **parts, **weight))
    loads = np.zeros((1, len(points), 6))
    found = loaded_compliance(structure, at_rest(structure), loads, gravity=True, moved=moved)[0]
    bodies, expected = RigidBodies(points, **parts, **weight), np.zeros((3, 6))
    for at in range(6):
        ends: list[Array] = []
        for sign in (1.0, -1.0):
            push = np.zeros((len(points), 6))
            push[tcp, at] = 0.5 * sign
            ends.append(bodies.displacement(push, gravity=True)[tcp, :3])
        expected[:, at] = ends[0] - ends[1]
    return relative_error(found[:3], expected)


@pytest.mark.parametrize("name", ["soft four-bar", "joint that closes a loop", "struts"])
def test_the_compliance_is_that_where_the_weight_has_moved_the_machine(name: str) -> None:
    one, half = (difference(name, share, moved=False) for share in (1.0, 0.5))
    assert half < one / 3.2
    assert one < 0.2 * difference(name, 1.0, moved=True)


def test_loops_that_no_load_strains_leave_no_rounding() -> None:
    """Rigid parts close a loop by rows of mere rounding: under weight a small force moves in proportion."""
    robot = machine_frame(65, more=6, loops=3).robot()
    wrench = np.outer([1e-2, 1.0], [1.0, 2.0, 3.0, 0.1, 0.2, 0.3])
    push = make_measurements([], [[], []], tcp=robot.tcp, wrench=wrench)
    small, large = predict_displacements(robot, push, True)
    np.testing.assert_allclose(100 * small[:3], large[:3], rtol=1e-4)
