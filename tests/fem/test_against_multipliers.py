"""Random structures against a dense formulation with Lagrange multipliers, `reference_frame`.

Rigids, joints with directions rigid, finite and free, struts, loops of them and redundant loops.
"""

import numpy as np
import pytest
from hypothesis import assume, event, given
from hypothesis import strategies as st

from beamstiff.errors import BeamstiffError
from beamstiff.fem.constraints import has_constraints
from tests.fem.builders import RIGID, SECTION, STEEL, frame, relative_error, solve
from tests.fem.random_frames import RandomFrame, beam_frame, machine_frame

TOLERANCE = 1e-9
FIRM = 1e-5  # the smallest scaled stiffness with which 1e-9 can be expected of double precision
seeds = st.integers(0, 2**32 - 1)


def disagreement(made: RandomFrame) -> float:
    """Return the largest error of all nodes' displacement under random wrenches."""
    loads = np.random.default_rng(len(made.points)).normal(size=(len(made.points), 6)) * 100
    loads[sorted(set(range(len(made.points))) - set(made.turning())), 3:] = 0.0
    response = solve(made.robot(), {f"n{at}": load for at, load in enumerate(loads)})
    event(f"constraints: {has_constraints(response.structure)}")
    return relative_error(response.displacement[0], made.reference().displacement(loads))


@given(seed=seeds, more=st.integers(1, 8), loops=st.integers(0, 4))
def test_beam_frames(seed: int, more: int, loops: int) -> None:
    made = beam_frame(seed, more, loops)
    assume(made.reference().softness() > FIRM)
    assert disagreement(made) <= TOLERANCE


@given(seed=seeds, more=st.integers(1, 8), loops=st.integers(0, 4), rigid=st.sampled_from([0.0, 0.4, 0.9]))
def test_machines_without_loops_of_rigid_parts(seed: int, more: int, loops: int, rigid: float) -> None:
    made = machine_frame(seed, more, loops, rigid=rigid, free=0.1, rigid_loops=False)
    assume(made.reference().softness() > FIRM)
    assert disagreement(made) <= TOLERANCE


@given(seed=seeds, more=st.integers(2, 8), loops=st.integers(1, 5), rigid=st.sampled_from([0.2, 0.6, 1.0]))
def test_machines_with_loops_of_rigid_parts(seed: int, more: int, loops: int, rigid: float) -> None:
    made = machine_frame(seed, more, loops, rigid=rigid, free=0.1)
    assume(made.reference().softness() > FIRM)
    assert disagreement(made) <= TOLERANCE


@given(seed=seeds, more=st.integers(1, 8), loops=st.integers(0, 4))
def test_what_moves_freely_there_is_refused_here(seed: int, more: int, loops: int) -> None:
    """Many free directions: what the reference finds to be a mechanism is refused, and nothing else is."""
    made = machine_frame(seed, more, loops, rigid=0.4, free=0.5)
    softness = made.reference().softness()
    assume(softness > FIRM or softness < 1e-13)
    event(f"mechanism: {softness < 1e-13}")
    if softness < 1e-13:
        with pytest.raises(BeamstiffError, match="is a mechanism: node"):
            disagreement(made)
    else:
        assert disagreement(made) <= TOLERANCE


def test_the_reference_knows_the_cantilever() -> None:
    """That the second formulation is right too: P L^3 / 3 E I."""
    made = RandomFrame(np.random.default_rng(0))
    made.beam(0, made.node(np.array([2.0, 0, 0])))
    made.sections, made.materials, made.ups, made.beams = (
        [SECTION],
        [STEEL],
        [np.array([0, 1.0, 0])],
        [(0, 1)],
    )
    loads = np.zeros((2, 6))
    loads[1, 1] = 10.0
    expected = 10 * 2**3 / (3 * STEEL.E * SECTION.Iz)
    assert abs(made.reference().displacement(loads)[1, 1] / expected - 1) < 1e-12


def test_a_rigid_strut_beside_a_beam_takes_its_stretch_only() -> None:
    robot = frame([(0, 0, 0), (1, 0, 0)], beams=[(0, 1)], struts=[(0, 1, RIGID)], up=(0, 1, 0))
    found = solve(robot, {"n1": [1e6, 10, 0, 0, 0, 0]}).displacement[0, 1]
    assert abs(found[0]) < 1e-18
    assert abs(found[1] / (10 / (3 * STEEL.E * SECTION.Iz)) - 1) < TOLERANCE
