"""Large frames: against the closed form, dense matrices, and what must be refused."""

import dataclasses

import numpy as np
import pytest
from scipy import sparse
from scipy.spatial.transform import Rotation

from beamstiff import BeamstiffError, compile_structure
from beamstiff.fem.condensation import tcp_compliance
from beamstiff.fem.large import dissection, memory, solvers
from beamstiff.fem.large.dissection import dissect
from beamstiff.fem.large.frame import Frame, frame_stiffness, nodal_forces
from beamstiff.fem.large.multifrontal import Softness, factorise, make_plan
from beamstiff.fem.large.solvers import frame_plan, interface_compliance, solve_frame
from beamstiff.se3 import displacement_transport
from benchmarks.lattice import cube, lattice, slender, tip
from tests.fem.builders import at_rest, robot_of
from tests.fem.random_frames import beam_frame
from tests.fem.reference_frame import flexibility


def unit_loads(frame: Frame, node: int) -> np.ndarray:
    loads = np.zeros((len(frame.points), 6, 6))
    loads[node] = np.eye(6)
    return loads


def chain(beams: int, length: float = 0.1) -> Frame:
    properties = {"E": 2e11, "G": 8e10, "A": 1e-4, "Iy": 2e-9, "Iz": 1e-9, "J": 3e-9, "Ay": 5e-5, "Az": 8e-5}
    return Frame(
        points=np.arange(beams + 1)[:, None] * np.array([length, 0.0, 0.0]),
        beams=np.stack([np.arange(beams), np.arange(1, beams + 1)], axis=1),
        properties={name: np.full(beams, value) for name, value in properties.items()},
        up=np.broadcast_to([0.0, 1.0, 0.0], (beams, 3)),
        fixed=np.arange(beams + 1) == 0,
    )


def tip_of_cantilever(frame: Frame) -> np.ndarray:
    """Return the compliance of a straight cantilever (Timoshenko), closed form."""
    return flexibility(frame.points[-1, 0], **{name: value[0] for name, value in frame.properties.items()})


def test_a_chain_of_two_thousand_beams_is_the_cantilever_to_the_last_digits() -> None:
    """Its condition is 1e14: what is solved without refinement has lost nearly all digits."""
    frame = chain(2000)
    found = solve_frame(frame, unit_loads(frame, 2000))
    expected = tip_of_cantilever(frame)
    error = np.abs(found.displacement[-1] - expected)[expected != 0] / np.abs(expected[expected != 0])
    assert error.max() <= 1e-11
    assert found.quality.error <= 1e-10
    assert found.quality.first_error > 1e-7


@pytest.mark.parametrize("make", [slender, cube])
def test_the_solution_is_that_of_the_dense_matrix(make) -> None:
    frame = make(900)
    loads = np.random.default_rng(1).normal(size=(len(frame.points), 6, 3))
    K = frame_stiffness(frame).toarray()
    free = frame.unknowns.ravel() >= 0
    expected = np.zeros((free.size, 3))
    expected[free] = np.linalg.solve(K, loads.reshape(-1, 3)[free])
    found = solve_frame(frame, loads)
    assert np.abs(found.displacement.reshape(-1, 3) - expected).max() <= 1e-8 * np.abs(expected).max()
    assert found.quality.residual <= 1e-12


@pytest.mark.parametrize("kept", [True, False])
def test_interface_compliance_inverts_a_schur_complement(kept: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    frame = lattice((5, 2, 3))
    nodes = np.array([tip(frame), 20, 33])
    assert not frame.fixed[nodes].any()
    K = frame_stiffness(frame).toarray()
    i = frame.unknowns[nodes].ravel()
    r = np.setdiff1d(np.arange(len(K)), i)
    schur = K[np.ix_(i, i)] - K[np.ix_(i, r)] @ np.linalg.solve(K[np.ix_(r, r)], K[np.ix_(r, i)])
    if not kept:
        monkeypatch.setattr(solvers, "free_bytes", lambda: 0.0)
    found, error = interface_compliance(frame, nodes)
    assert np.abs(found - np.linalg.inv(schur)).max() <= 1e-10 * np.abs(found).max()
    assert error <= 1e-11
    assert (found == found.T).all()


def test_condensation_without_a_factor_tells_what_it_has_lost(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(solvers, "free_bytes", lambda: 0.0)
    for beams, much in ((30, False), (2000, True)):
        frame = chain(beams)
        if much:
            with pytest.raises(BeamstiffError, match=r"is known to .* of itself"):
                interface_compliance(frame, np.array([beams]))
            continue
        found, error = interface_compliance(frame, np.array([beams]))
        expected = tip_of_cantilever(frame)
        scale = np.sqrt(np.diag(expected))
        off = (np.abs(found - expected) / np.outer(scale, scale)).max()
        assert 1e-14 < error < 1e-8
        assert off <= 30 * error


@pytest.mark.parametrize("seed", range(8))
def test_random_frames_as_robots_have_them(seed: int) -> None:
    """The same frame as a robot's description: sections, `up` and all."""
    made = beam_frame(seed, 7, 4)
    robot = made.robot()
    frame = Frame(
        points=np.array(made.points),
        beams=np.array([pair[:2] for pair in made.beams]),
        properties={
            name: np.array([getattr(item, name) or np.inf for item in items])
            for items, names in ((made.sections, ("A", "Iy", "Iz", "J", "Ay", "Az")), (made.materials, "EG"))
            for name in names
        },
        up=np.array(made.ups),
        fixed=np.isin(np.arange(len(made.points)), made.fixed),
    )
    structure = compile_structure(robot)
    expected = tcp_compliance(structure, at_rest(structure))[0]
    tcp = structure.kinematics.node_index[robot.tcp]
    found = solve_frame(frame, unit_loads(frame, tcp)).displacement[tcp]
    assert np.abs(found - expected).max() <= 1e-9 * np.abs(expected).max()


def test_elements_and_the_assembled_matrix_meet_the_same_forces() -> None:
    frame = lattice((4, 3, 2))
    free = ~frame.fixed
    u = np.random.default_rng(3).normal(size=(len(frame.points), 6, 2)) * free[:, None, None]
    found = nodal_forces(frame, u)[free].reshape(-1, 2).astype(float)
    expected = frame_stiffness(frame) @ u[free].reshape(-1, 2)
    assert np.abs(found - expected).max() <= 1e-13 * np.abs(expected).max()
    loose = dataclasses.replace(frame, fixed=np.zeros_like(frame.fixed))
    held = np.abs(nodal_forces(loose, displacement_transport(frame.points))).max()
    assert held <= 1e-13 * np.abs(frame_stiffness(loose)).max()


@pytest.mark.parametrize("cells", [(6, 5, 4), (9, 8, 7)])  # straight cuts alone, diagonal ones too
def test_a_dissection_is_an_order_in_which_groups_meet_only_later_ones(cells: tuple[int, int, int]) -> None:
    frame = lattice(cells)
    a, b = frame.beams.T
    n = len(frame.points)
    graph = sparse.coo_array((np.ones(2 * len(a)), (np.r_[a, b], np.r_[b, a])), shape=(n, n)).tocsr()
    order, groups = dissect(graph, frame.points, np.array([17, 4]))
    assert sorted(order) == list(range(n))
    assert order[-2:].tolist() == [17, 4]
    assert [group.start for group in groups] == [0, *(group.stop for group in groups[:-1])]
    filled = np.zeros((n, n), dtype=bool)  # what elimination in this order fills in
    filled[np.ix_(range(n), range(n))] = graph.toarray()[np.ix_(order, order)] != 0
    for k in range(n):
        met = k + 1 + np.flatnonzero(filled[k, k + 1 :])
        filled[np.ix_(met, met)] = True
    for group in groups:
        met = group.stop + np.flatnonzero(filled[group.start : group.stop, group.stop :].any(axis=0))
        assert set(met) <= set(group.boundary.tolist())


def test_diagonal_cuts_save_work_in_a_cube_wherever_it_stands(monkeypatch: pytest.MonkeyPatch) -> None:
    """Half of it at 2e4 unknowns, three fifths at 1e5."""
    frame = cube(2e4)
    turn = Rotation.from_euler("xyz", (0.3, 0.5, 0.7)).as_matrix()
    flops = frame_plan(frame).flops
    for points in (frame.points @ turn.T, frame.points * [1.0, 3.0, 0.2]):
        assert frame_plan(dataclasses.replace(frame, points=points)).flops == pytest.approx(flops, rel=0.02)
    monkeypatch.setattr(dissection, "MANY", np.inf)
    assert flops <= 0.55 * frame_plan(frame).flops


def test_nodes_with_unlike_numbers_of_unknowns() -> None:
    rng = np.random.default_rng(5)
    first = np.array([0, 3, 3, 9, 10, 16])
    graph = sparse.csr_array(np.ones((5, 5)) - np.eye(5))
    K = rng.normal(size=(16, 16))
    K = K @ K.T + np.eye(16)
    plan = make_plan(graph, rng.normal(size=(5, 3)), np.array([2]), first)
    assert plan.kept == 6
    b = rng.normal(size=(16, 2))
    assert np.abs(factorise(sparse.csc_array(K), plan).solve(b) - np.linalg.solve(K, b)).max() <= 1e-10


def loose() -> Frame:
    """Return a lattice with one beam beside it that nothing holds."""
    frame = lattice((4, 2, 2))
    n = len(frame.points)
    return dataclasses.replace(
        frame,
        points=np.concatenate([frame.points, [[5.0, 0, 0], [6.0, 0, 0]]]),
        beams=np.concatenate([frame.beams, [[n, n + 1]]]),
        properties={name: np.append(value, value[0]) for name, value in frame.properties.items()},
        up=np.concatenate([frame.up, [[0.0, 0, 1]]]),
        fixed=np.append(frame.fixed, [False, False]),
    )


def test_a_mechanism_is_refused() -> None:
    frame = loose()
    with pytest.raises(BeamstiffError, match="mechanism"):
        solve_frame(frame, unit_loads(frame, tip(frame)))


def test_the_multifrontal_solver_says_which_node_is_loose() -> None:
    frame = loose()
    n = len(frame.points)
    with pytest.raises(BeamstiffError, match=rf"nothing resists node ({n - 2}|{n - 1}) "):
        interface_compliance(frame, np.array([40]))
    with pytest.raises(Softness):
        factorise(frame_stiffness(frame), frame_plan(frame))


def test_bad_frames_are_refused() -> None:
    frame = lattice((2, 1, 1))
    loads = unit_loads(frame, tip(frame))
    twins = frame.points.copy()
    twins[frame.beams[3, 0]] = twins[frame.beams[3, 1]]
    stiff = {**frame.properties, "Iy": np.where(np.arange(len(frame.beams)) == 5, np.nan, 1e-8)}
    for change, message in (
        ({"points": twins}, "beam 3: found a length of 0 m"),
        ({"properties": stiff}, "beam 5: its stiffness is not finite"),
        ({"fixed": np.ones_like(frame.fixed)}, "all nodes of the frame are fixed"),
    ):
        with pytest.raises(BeamstiffError, match=message):
            solve_frame(dataclasses.replace(frame, **change), loads)
    with pytest.raises(BeamstiffError, match="expected finite numbers of shape"):
        solve_frame(frame, np.full_like(loads, np.nan))
    with pytest.raises(BeamstiffError, match="node 0 is fixed"):
        interface_compliance(frame, np.array([0]))


def test_what_does_not_fit_into_memory_is_refused_beforehand(monkeypatch: pytest.MonkeyPatch) -> None:
    frame = cube(2000)
    monkeypatch.setattr(memory, "free_bytes", lambda: 2e5)
    monkeypatch.setattr(solvers, "free_bytes", lambda: 2e5)
    with pytest.raises(
        BeamstiffError, match=r"needs .* GB of memory, .* are free: about \d+ unknowns would fit"
    ):
        solve_frame(frame, unit_loads(frame, tip(frame)))
    with pytest.raises(BeamstiffError, match="the condensation of"):
        interface_compliance(frame, np.array([tip(frame)]))


def test_a_robot_frame_and_a_lattice_are_alike() -> None:
    """The generator of the benchmarks makes the frame that a description of it makes."""
    frame = lattice((1, 1, 1))
    structure = compile_structure(robot_of(frame))
    expected = tcp_compliance(structure, at_rest(structure))[0]
    found = solve_frame(frame, unit_loads(frame, tip(frame))).displacement[tip(frame)]
    assert np.abs(found - expected).max() <= 1e-10 * np.abs(expected).max()
