"""What holds for every linear structure, on random ones.

Sources: Felippa, Introduction to Finite Element Methods, ch. 20 (rigid-body modes, patch test); Timoshenko &
Young, Theory of Structures, ch. 7 (Clapeyron).
"""

import numpy as np
from hypothesis import assume, given
from hypothesis import strategies as st

from beamstiff.fem.assembly import (
    dense_stiffness,
    element_blocks,
    gather,
    node_map,
    scatter,
    sparse_stiffness,
)
from beamstiff.fem.loads import gravity_wrenches, total_mass
from beamstiff.fem.placed_structure import place
from beamstiff.fem.static_response import Response, nodal_loads, respond
from beamstiff.fem.structure import Structure, compile_structure
from beamstiff.robot.description import Robot
from tests.fem.builders import at_rest, frame, relative_error, screw, solve, some_rotation, turned
from tests.fem.random_frames import RandomFrame, beam_frame, machine_frame

TOLERANCE = 1e-9
FIRM = 1e-5  # the smallest scaled stiffness with which 1e-9 can be expected of double precision
seeds = st.integers(0, 2**32 - 1)
sizes = st.integers(1, 7)
closing = st.integers(0, 4)


def machine(seed: int, more: int, loops: int) -> RandomFrame:
    made = machine_frame(seed, more, loops, free=0.1)
    assume(made.reference().softness() > FIRM)
    return made


def random_loads(made: RandomFrame, seed: int) -> np.ndarray:
    """Return wrenches (1, N, 6), without moments where struts alone hold."""
    loads = np.random.default_rng(seed).normal(size=(1, len(made.points), 6)) * 100
    loads[:, sorted(set(range(len(made.points))) - set(made.turning())), 3:] = 0.0
    return loads


def answer(robot: Robot, loads: np.ndarray, gravity: bool = False) -> Response:
    structure = compile_structure(robot)
    return respond(structure, at_rest(structure), loads, gravity)


def unsupported_stiffness(structure: Structure) -> np.ndarray:
    """Return the stiffness (6N, 6N) of all elements between their nodes, nothing fixed, nothing rigid."""
    blocks = element_blocks(structure, place(structure, at_rest(structure)))[0]
    count = len(structure.robot.nodes)
    K = np.zeros((count, 6, count, 6))
    for (i, j), block in zip(structure.elements, blocks, strict=True):
        for a, row in enumerate((i, j)):
            for b, column in enumerate((i, j)):
                K[row, :, column] += block[a, b]
    return K.reshape(6 * count, 6 * count)


def rigid_motions(points: np.ndarray) -> np.ndarray:
    """Return the six motions of all nodes as one body, (6N, 6)."""
    motion = np.zeros((len(points), 6, 6))
    motion[:, :3, :3] = motion[:, 3:, 3:] = np.eye(3)
    for axis in range(3):
        motion[:, :3, 3 + axis] = np.cross(np.eye(3)[axis], points)
    return motion.reshape(-1, 6)


@given(seed=seeds, more=sizes, loops=closing)
def test_an_unsupported_frame_has_six_motions_without_energy(seed: int, more: int, loops: int) -> None:
    made = beam_frame(seed, more, loops)
    K = unsupported_stiffness(compile_structure(made.robot()))
    assert np.abs(K - K.T).max() <= 1e-14 * np.abs(K).max()
    assert np.abs(K @ rigid_motions(np.array(made.points))).max() <= 1e-13 * np.abs(K).max()
    scale = 1 / np.sqrt(np.diag(K))
    eigenvalues = np.linalg.eigvalsh(scale[:, None] * K * scale)
    assert np.abs(eigenvalues[:6]).max() < 1e-12
    assert eigenvalues[6] > 1e-9


@given(seed=seeds, more=sizes, loops=closing)
def test_joints_struts_and_shear_beams_resist_no_rigid_motion(seed: int, more: int, loops: int) -> None:
    made = machine_frame(seed, more, loops)
    K = unsupported_stiffness(compile_structure(made.robot()))
    assert np.abs(K @ rigid_motions(np.array(made.points))).max() <= 1e-13 * max(np.abs(K).max(), 1e-300)


@given(seed=seeds, more=sizes, loops=closing)
def test_the_reduced_stiffness_is_symmetric_and_positive_definite(seed: int, more: int, loops: int) -> None:
    structure = compile_structure(beam_frame(seed, more, loops).robot())
    geometry = place(structure, at_rest(structure))
    K = dense_stiffness(structure, geometry)[0]
    assert np.abs(K - K.T).max() <= 1e-14 * np.abs(K).max()
    scale = 1 / np.sqrt(np.diag(K))
    assert np.linalg.eigvalsh(scale[:, None] * K * scale)[0] > 0
    assert (sparse_stiffness(structure, geometry).toarray() == K).all()


PATCH = ["stretch", "twist", "y", "z"]


def patch(seed: int, elements: int, load: str) -> tuple[float, float]:
    """Return the errors of displacements and of members' forces in a row of unequal elements.

    Under stretch, twist and pure bending every node lies on the exact field.
    """
    rng = np.random.default_rng(seed)
    at = np.concatenate([[0.0], np.cumsum(rng.uniform(0.05, 1.0, elements))])
    made = frame([(x, 0, 0) for x in at], beams=[(k, k + 1) for k in range(elements)], up=(0, 1, 0))
    section, material = made.sections["s0"], made.materials["m0"]
    size, exact, wrench = float(rng.uniform(10, 1000)), np.zeros((elements + 1, 6)), np.zeros(6)
    if load == "stretch":
        wrench[0], exact[:, 0] = size, size / (material.E * section.A) * at
    elif load == "twist":
        wrench[3], exact[:, 3] = size, size / (material.G * section.J) * at
    elif load == "y":
        curvature = size / (material.E * section.Iy)
        wrench[4], exact[:, 4], exact[:, 2] = size, curvature * at, -curvature * at**2 / 2
    else:
        curvature = size / (material.E * section.Iz)
        wrench[5], exact[:, 5], exact[:, 1] = size, curvature * at, curvature * at**2 / 2
    rotation = some_rotation(seed)
    robot = turned(made, rotation, shift=(1, 2, 3))
    response = solve(robot, {f"n{elements}": screw(rotation) @ wrench})
    forces = np.abs(response.beam_forces[0] - np.stack([-wrench, wrench])).max() / size
    return relative_error(response.displacement[0] @ screw(rotation), exact), float(forces)


@given(seed=seeds, elements=st.integers(1, 6), load=st.sampled_from(PATCH))
def test_patch_of_unequal_elements_shows_constant_strain(seed: int, elements: int, load: str) -> None:
    assert max(patch(seed, elements, load)) <= TOLERANCE


@given(seed=seeds, more=sizes, loops=closing)
def test_clapeyron_the_loads_do_twice_the_strain_energy(seed: int, more: int, loops: int) -> None:
    made = machine(seed, more, loops)
    loads = random_loads(made, seed)
    response = answer(made.robot(), loads)
    work = float((loads * response.displacement).sum())
    energy = float(response.element_energy.sum() + response.spring_energy.sum())
    assert abs(2 * energy - work) <= TOLERANCE * abs(work)
    shares = response.energy_shares()
    if work > 1e-12:
        assert abs(sum(share[0] for share in shares.values()) - 1) <= 1e-12
        assert min(share[0] for share in shares.values()) >= -1e-14


@given(seed=seeds, more=sizes, loops=closing)
def test_turning_and_shifting_the_whole_machine(seed: int, more: int, loops: int) -> None:
    made = machine(seed, more, loops)
    robot, loads, rotation = made.robot(), random_loads(made, seed), some_rotation(seed)
    expected = answer(robot, loads, gravity=True)
    found = answer(turned(robot, rotation, (0.5, -0.3, 0.8)), loads @ screw(rotation).T, gravity=True)
    assert relative_error(found.displacement, expected.displacement @ screw(rotation).T) <= TOLERANCE
    local = expected.beam_forces
    assert np.abs(found.beam_forces - local).max(initial=0) <= 1e-7 * np.abs(local).max(initial=1.0)


@given(seed=seeds, more=sizes, loops=closing)
def test_the_order_of_nodes_and_parts_does_not_matter(seed: int, more: int, loops: int) -> None:
    made = machine(seed, more, loops)
    robot, loads = made.robot(), random_loads(made, seed)
    rng = np.random.default_rng(seed)
    order = rng.permutation(len(robot.nodes))
    mixed = {"nodes": tuple(robot.nodes[at] for at in order)}
    for kind in ("beams", "rigids", "joints", "struts", "fixed"):
        items = getattr(robot, kind)
        mixed[kind] = tuple(items[at] for at in rng.permutation(len(items)))
    found = answer(robot.model_copy(update=mixed), loads[:, order], gravity=True)
    expected = answer(robot, loads, gravity=True)
    assert relative_error(found.displacement, expected.displacement[:, order]) <= TOLERANCE
    ours, theirs = expected.energy_shares(), found.energy_shares()
    # who closes a loop may change, what each part contributes does not
    assert ours.keys() == theirs.keys()
    assert max((abs(ours[name][0] - theirs[name][0]) for name in ours), default=0) <= TOLERANCE


@given(seed=seeds, more=sizes, loops=closing)
def test_names_do_not_matter_even_when_nodes_and_joints_share_them(seed: int, more: int, loops: int) -> None:
    made = machine(seed, more, loops)
    assume(made.joints)
    robot, loads = made.robot(), random_loads(made, seed)
    renamed = tuple(joint.model_copy(update={"name": f"n{at}"}) for at, joint in enumerate(robot.joints))
    found = answer(robot.model_copy(update={"joints": renamed}), loads)
    assert (found.displacement == answer(robot, loads).displacement).all()


@given(seed=seeds, more=sizes, loops=closing)
def test_weight_is_mass_times_gravity_and_acts_at_the_centre(seed: int, more: int, loops: int) -> None:
    made = beam_frame(seed, more, loops)
    rng = np.random.default_rng(seed)
    lumps = [(int(at), float(rng.uniform(1, 9)), rng.normal(size=3)) for at in range(len(made.points))]
    robot = frame(
        made.points,
        beams=made.beams,
        section=made.sections,
        material=made.materials,
        up=made.ups,
        masses=lumps,
        gravity=(1.0, -2.0, -9.0),
    )
    structure = compile_structure(robot)
    geometry = place(structure, at_rest(structure))
    weight = gravity_wrenches(structure, geometry)[0]
    by_hand = [(mass, made.points[at] + offset) for at, mass, offset in lumps]
    for (i, j), section, material in zip(made.beams, made.sections, made.materials, strict=True):
        length = float(np.linalg.norm(made.points[j] - made.points[i]))
        by_hand.append((material.density * section.A * length, (made.points[i] + made.points[j]) / 2))
    total = sum(mass for mass, _ in by_hand)
    assert abs(total_mass(structure, geometry)[0] / total - 1) <= 1e-12
    g = np.array(robot.gravity)
    assert np.abs(weight[:, :3].sum(axis=0) / (total * g) - 1).max() <= 1e-12
    moment = weight[:, 3:].sum(axis=0) + np.cross(made.points, weight[:, :3]).sum(axis=0)
    expected = sum(np.cross(at, mass * g) for mass, at in by_hand)
    assert np.abs(moment - expected).max() <= 1e-12 * total * np.linalg.norm(g)


@given(seed=seeds, more=sizes, loops=closing)
def test_generalised_forces_do_the_work_of_the_wrenches(seed: int, more: int, loops: int) -> None:
    """f . z = w . u with u = T z and f = T^T w, for any unknowns."""
    structure = compile_structure(machine_frame(seed, more, loops).robot())
    geometry = place(structure, at_rest(structure))
    rng = np.random.default_rng(seed)
    z, w = rng.normal(size=(1, structure.unknowns.count)), rng.normal(size=(1, len(structure.robot.nodes), 6))
    u = gather(structure, geometry, z)
    assert abs((scatter(structure, geometry, w) * z).sum() - (w * u).sum()) <= 1e-12 * np.abs(w * u).sum()
    for node in range(len(structure.robot.nodes)):
        assert np.abs(node_map(structure, geometry, node)[0] @ z[0] - u[0, node]).max() <= 1e-13


def test_loads_by_node_name() -> None:
    robot = frame([(0, 0, 0), (1, 0, 0)], beams=[(0, 1)], joints=[], struts=[])
    loads = nodal_loads(compile_structure(robot), 2, {"n1": np.arange(12.0).reshape(2, 6)})
    assert loads.shape == (2, 2, 6)
    assert (loads[:, 1] == np.arange(12.0).reshape(2, 6)).all()
    assert not loads[:, 0].any()
