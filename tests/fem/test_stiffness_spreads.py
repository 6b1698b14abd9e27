"""Parts unlike by many powers of ten, against the truth in 120 digits: right, or refused with a name."""

from collections.abc import Callable

import numpy as np
import pytest

from beamstiff import BeamstiffError, compile_structure
from beamstiff.fem.condensation import condense
from beamstiff.fem.geometric_stiffness import loaded_compliance
from beamstiff.fem.static_response import nodal_loads, respond
from beamstiff.model.ports import find_ports
from tests.fem.builders import SECTION, STEEL, at_rest, frame
from tests.fem.exact_frame import exact_compliance
from tests.fem.random_frames import RandomFrame
from tests.fem.reference_frame import ReferenceFrame
from tests.fem.stiffness_spreads import chain, outcome, relative_error, stretched_tie, with_loops

SOME = range(6)


def test_the_truth_knows_the_cantilever() -> None:
    properties = {name: getattr(SECTION, name) for name in ("A", "Iy", "Iz", "J")}
    properties |= {"E": STEEL.E, "G": STEEL.G, "Ay": np.inf, "Az": np.inf}
    beam = (0, 1, properties, np.array([0.0, 1.0, 0.0]))
    exact = exact_compliance(ReferenceFrame(np.array([[0.0, 0, 0], [2, 0, 0]]), [0], [beam]), 1)
    assert exact[1, 1] == pytest.approx(8 / (3 * STEEL.E * SECTION.Iz), rel=1e-14)


@pytest.mark.parametrize("powers", [4, 8, 12, 16, 18])
def test_chains_are_right_whatever_the_spread(powers: int) -> None:
    assert {outcome(chain(1000 * powers + seed, powers))[0] for seed in SOME} == {"right"}


@pytest.mark.parametrize("powers", [4, 8, 12, 16, 20])
def test_structures_with_loops_are_right_or_refused(powers: int) -> None:
    found = [outcome(with_loops(1000 * powers + seed, powers)) for seed in range(12)]
    assert "wrong" not in {what for what, _ in found}
    assert sum(what == "right" for what, _ in found) >= 9
    for what, said in found:
        assert what == "right" or "is lost in rounding" in said or "a mechanism" in said


@pytest.mark.parametrize("gap", [0.0, 1e-16, 1e-14, 1e-12, 1e-10, 1e-9, 1e-8, 1e-6])
def test_a_free_elbow_under_a_stretched_tie(gap: float) -> None:
    """Right where the gap is known to enough digits, else a mechanism, and the elbow is named."""
    for seed in (None, 0, 1, 2):
        what, said = outcome(stretched_tie(gap, seed))
        assert what != "wrong"
        assert what == "right" if gap > 5e-9 else "j1.torsional" in said


@pytest.mark.parametrize("powers", [0, 8, 16, 20])
def test_what_a_chain_passes_on_is_its_load_whatever_the_spread(powers: int) -> None:
    """The wrench in every part of a chain follows from equilibrium alone."""
    load = np.array([3.0, -2.0, 5.0, 0.7, 0.4, -0.9])
    for seed in SOME:
        robot = chain(1000 * powers + seed, powers).robot()
        structure = compile_structure(robot)
        response = respond(structure, at_rest(structure), nodal_loads(structure, 1, {robot.tcp: load}))
        points = response.geometry.posture.node_positions[0]
        carried = [
            np.concatenate([load[:3], load[3:] + np.cross(points[-1] - at, load[:3])]) for at in points
        ]
        ends = [carried[max(pair)] if pair[1] > pair[0] else -carried[pair[1]] for pair in structure.elements]
        assert np.abs(response.element_forces[0, :, 1] - ends).max(initial=0.0) <= 1e-6 * np.abs(load).max()


@pytest.mark.parametrize("make", [chain, with_loops])
@pytest.mark.parametrize("powers", [4, 12, 16])
def test_ports_put_together_give_the_truth(make: Callable[[int, float], RandomFrame], powers: int) -> None:
    """With every joint on the tree a port: C = C_clamped + B^T (S + k)^-1 B."""
    for seed in SOME:
        made = make(1000 * powers + seed, powers)
        robot = made.robot()
        exact = exact_compliance(made.reference(), int(robot.tcp[1:]))
        structure = compile_structure(robot)
        names = [f"{robot.joints[at].name}.axial" for at in structure.unknowns.tree_joints]
        names = [name for name in names if np.isfinite(robot.parameter(name))]
        try:
            found = condense(structure, at_rest(structure), [robot.tcp], ports := find_ports(robot, names)[0])
        except BeamstiffError:
            assert make is with_loops
            continue
        own = np.diag([robot.parameter(port.name) for port in ports])
        by_ports = found.port_map[0].T @ np.linalg.inv(found.port_stiffness[0] + own) @ found.port_map[0]
        assert relative_error(found.clamped[0] + by_ports, exact) <= 1e-6


@pytest.mark.parametrize("soft", [1e-10, 1e-6, 1.0, 1e6])
def test_a_soft_mast_on_a_stiff_one_buckles_at_its_own_load(soft: float) -> None:
    """Beam-column on a beam 1e16 times stiffer: H/P (tan kL / k - L), Timoshenko and Gere art. 1.4."""
    made = [STEEL.model_copy(update={"E": k, "G": k}) for k in (1e16 * soft, soft)]
    points = [(0.1 * at, 0.0, 0.0) for at in range(9)]
    beams, material = [(at, at + 1) for at in range(8)], [made[0]] * 4 + [made[1]] * 4
    robot = frame(points, beams=beams, material=material, up=(0, 1, 0))
    structure, length, EI = compile_structure(robot), 0.4, soft * SECTION.Iz
    force = 0.7 * np.pi**2 * EI / (4 * length**2)
    found = loaded_compliance(
        structure, at_rest(structure), nodal_loads(structure, 1, {"n8": np.array([-force, 0, 0, 0, 0, 0])})
    )[0]
    k = np.sqrt(force / EI)
    assert found[1, 1] == pytest.approx((np.tan(k * length) / k - length) / force, rel=1e-6)
