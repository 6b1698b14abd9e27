"""Portal frames: Kleinlogel & Haselbach, Rigid Frame Formulas, frames with fixed and with hinged feet.

With k = (I_girder / I_column) (h / l), N1 = k + 2, N2 = 6 k + 1 for fixed feet and N = 2 k + 3 for hinged
ones. The formulas leave the members' extension out; so does a rigid strut beside each member.
"""

import numpy as np
import pytest

from beamstiff import Robot, Section
from beamstiff.fem.response import Response
from tests.fem.builders import FREE, RIGID, STEEL, frame, solve

WIDTH, HEIGHT = 3.2, 2.1
COLUMN = Section(A=4e-3, Iy=1.5e-5, Iz=6e-6, J=1e-5)
GIRDER = Section(A=5e-3, Iy=4.0e-5, Iz=9e-6, J=1e-5)
K = GIRDER.Iy / COLUMN.Iy * HEIGHT / WIDTH
FORCE = 5000.0
TOLERANCE = 1e-9


def portal(hinged: bool) -> Robot:
    """Return a portal in the x-z plane: feet n0, n3 on the ground n4, n5, corners n1, n2.

    All members bend about y with Iy: `up` is along y.
    """
    points = [(0, 0, 0), (0, 0, HEIGHT), (WIDTH, 0, HEIGHT), (WIDTH, 0, 0), (0, 0, 0), (WIDTH, 0, 0)]
    foot = (RIGID, RIGID, FREE if hinged else RIGID, RIGID)  # about y
    members = [(0, 1), (1, 2), (2, 3)]
    return frame(
        points,
        beams=members,
        struts=[(i, j, RIGID) for i, j in members],
        joints=[(4, 0, (0, 1, 0), foot), (5, 3, (0, 1, 0), foot)],
        fixed=(4, 5),
        tcp=1,
        section=[COLUMN, GIRDER, COLUMN],
        up=(0, 1, 0),
    )


def end_moments(response: Response) -> np.ndarray:
    """Return the moments at both ends of the three members about the axis across the frame (3, 2)."""
    # `up` along y makes that the local y axis of every member
    return response.beam_forces[0, :, :, 4]


def test_sway_of_the_portal_with_fixed_feet() -> None:
    """M_A = -(P h / 2)(3 k + 1) / N2, M_B = (P h / 2) 3 k / N2, and the sway that goes with it."""
    response = solve(portal(hinged=False), {"n1": [FORCE, 0, 0, 0, 0, 0]})
    N2 = 6 * K + 1
    sway = FORCE * HEIGHT**3 * (3 * K + 2) / (12 * STEEL.E * COLUMN.Iy * N2)
    assert response.displacement[0, [1, 2], 0] == pytest.approx(sway, rel=TOLERANCE)
    moments = np.abs(end_moments(response))
    feet, corners = FORCE * HEIGHT / 2 * (3 * K + 1) / N2, FORCE * HEIGHT / 2 * 3 * K / N2
    assert moments == pytest.approx(
        np.array([[feet, corners], [corners] * 2, [corners, feet]]), rel=TOLERANCE
    )


def test_sway_of_the_portal_with_hinged_feet() -> None:
    """M_B = P h / 2, nothing at the feet."""
    response = solve(portal(hinged=True), {"n1": [FORCE, 0, 0, 0, 0, 0]})
    sway = FORCE * HEIGHT**3 * (2 * K + 1) / (12 * STEEL.E * COLUMN.Iy * K)
    assert response.displacement[0, [1, 2], 0] == pytest.approx(sway, rel=TOLERANCE)
    corner = FORCE * HEIGHT / 2
    expected = np.array([[0, corner], [corner, corner], [corner, 0]])
    assert np.abs(end_moments(response)) == pytest.approx(expected, rel=TOLERANCE, abs=TOLERANCE * corner)


@pytest.mark.parametrize("hinged", [False, True])
def test_uniform_load_on_the_girder(hinged: bool) -> None:
    """Its weight. Fixed feet: M_A = q l^2 / 12 N1, M_B = -q l^2 / 6 N1; hinged: M_B = -q l^2 / 4 N."""
    response = solve(portal(hinged), {}, gravity=True)
    q = 9.81 * STEEL.density * GIRDER.A
    corner = q * WIDTH**2 / (4 * (2 * K + 3)) if hinged else q * WIDTH**2 / (6 * (K + 2))
    foot = 0.0 if hinged else corner / 2
    expected = np.array([[foot, corner], [corner, corner], [corner, foot]])
    assert np.abs(end_moments(response)) == pytest.approx(expected, rel=TOLERANCE, abs=TOLERANCE * corner)
    thrust = (foot + corner) / HEIGHT
    assert np.abs(response.beam_forces[0, 0, 0, 2]) == pytest.approx(thrust, rel=TOLERANCE)
