"""`link-bending`: a link bends, stretches and twists that the model holds rigid, or stiffer than it is.

Flexibility at the end of a cantilever whose flexibility ``1/EI`` varies along it (Gere & Timoshenko,
Mechanics of Materials, the
unit-load method): under end force F and moment M, at s from the root, the section carries
``M + (L - s) F``, and the end turns by the integral of its flexibility times that.
"""

from dataclasses import replace

import numpy as np

from beamstiff.diagnosis.effects.effect import Effect, Quantity, Shape, Term, named
from beamstiff.diagnosis.effects.torque_laws import any_symmetric, counted, softness
from beamstiff.diagnosis.residual.baseline import Baseline
from beamstiff.diagnosis.residual.place import Place
from beamstiff.se3 import Array

EI = 1e7  # N m^2, a middling link
TWIST = 1.3  # EI / GJ of a closed steel section, nearly
STRETCH = 5e-10  # 1/N
SEAM = 1e-7  # rad/(N m), of a weak section
SECTIONS = (0.0, 0.5, 1.0)  # of the length, where a link may be weak
COUPLED = 0.5  # of the mean of two compliances, what couples them round a corner
SPREAD, REALISTIC = 30.0, 10.0  # from castings of a small arm to those of a press; and of most
PAIRS = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
# flexibility, at length 1, that couples both planes: principal axes turned against the local ones
SKEW = np.zeros((6, 6))
SKEW[1, 2], SKEW[1, 4], SKEW[2, 5], SKEW[4, 5] = 1.0 / 3.0, -0.5, 0.5, -1.0
SKEW += SKEW.T
GAUSS, WEIGHTS = np.polynomial.legendre.leggauss(6)


def _components(baseline: Baseline) -> list[str | None]:
    return list(baseline.places.links)


def flexibility(bending: Array, plane: str) -> Array:
    """Return the flexibility (6, 6) at the end of a link of length 1 for ``1/EI`` times a weight along it.

    `bending`: (6,) array; weight at the Gauss points of the link.
    """
    w = 0.5 * WEIGHTS * bending
    arm = 1.0 - 0.5 * (GAUSS + 1)
    result = np.zeros((6, 6))
    if plane == "twist":
        result[3, 3] = w.sum()
        return result
    u, r, sign = (1, 5, 1.0) if plane == "xy" else (2, 4, -1.0)
    result[u, u], result[r, r] = w @ arm**2, w.sum()
    result[u, r] = result[r, u] = sign * (w @ arm)
    return result


def _column(baseline: Baseline, place: Place, matrix: Array, throughout: bool = True) -> Array:
    """Return the displacement (N, 6) of a link by its flexibility (6, 6) at length 1.

    Across it a force has the length for a lever, and so has a turn; `throughout` it gives, not at a section.
    """
    passed = counted(baseline, place)
    lever = np.ones_like(passed)
    lever[:, 1:3] = place.length[:, None]
    given = lever * ((lever * passed) @ matrix)
    if throughout:
        given *= place.length[:, None]
    return np.asarray((place.shift @ given[..., None])[..., 0])


def _shapes(baseline: Baseline, component: str | None) -> list[Shape]:
    place = baseline.places.links[str(component)]
    even = np.ones(GAUSS.size)
    along = 0.5 * (GAUSS + 1)
    root, tip = 3 * (1 - along) ** 2, 3 * along**2

    def both(weight: Array) -> Array:
        return flexibility(weight, "xy") + flexibility(weight, "xz")

    twist = flexibility(even, "twist")
    stretch = np.zeros((6, 6))
    stretch[0, 0] = 1.0
    soft = softness(baseline)

    def bending(weight: Array, name: str, size: float) -> Term:
        quantity = Quantity(f"bending_flexibility{name}", "1/(N*m^2)", size * soft / EI, positive=True)
        return _column(baseline, place, weight), (quantity,)

    uniform = bending(both(even) + TWIST * twist, "", 1.0)
    tapered = [bending(both(root), "_root", 0.7), bending(both(tip), "_tip", 0.7)]
    y, z = bending(flexibility(even, "xy"), "_y", 1.0), bending(flexibility(even, "xz"), "_z", 1.0)
    within = ("bending_flexibility_y", "bending_flexibility_z")
    yz = Quantity("bending_flexibility_yz", "1/(N*m^2)", 0.3 * soft / EI, within=within)
    skew = (_column(baseline, place, SKEW), (yz,))
    turn = Quantity("torsion_flexibility", "1/(N*m^2)", soft * TWIST / EI, positive=True)
    turned = (_column(baseline, place, twist), (turn,))
    sheer = Quantity("stretch_flexibility", "1/N", soft * STRETCH, positive=True)
    stretched = (_column(baseline, place, stretch), (sheer,))
    weak = [_weak(baseline, place, at, soft * SEAM) for at in SECTIONS]
    several = [
        (columns, tuple(replace(one, name=f"{one.name}_at_{at:g}") for one in quantities))
        for at, (columns, quantities) in zip(SECTIONS, weak, strict=True)
    ]
    found = [
        Shape.of("uniform", uniform),
        Shape.of("tapered", *tapered, turned),
        Shape.of("by plane", y, z, skew, turned, stretched),
        Shape.of("weak at its root", weak[0], weight=0.5),
        Shape.of("weak at several sections", *several, weight=0.5),
        any_symmetric(baseline, place, _sizes(float(place.length.mean()), soft), "any, as round a corner"),
    ]
    return [replace(one, prior_factor=SPREAD, realistic=REALISTIC) for one in found]


def _weak(baseline: Baseline, place: Place, at: float, size: float) -> Term:
    """Return any symmetric compliance against turning of a section, at a share of the link's length."""
    columns = [_column(baseline, place, _section(1.0 - at, *pair), throughout=False) for pair in PAIRS]
    own = named("section_compliance", "rad/(N*m)", size, ("xx", "yy", "zz"), positive=True)
    skew = [
        Quantity(
            f"section_compliance_{'xyz'[a]}{'xyz'[b]}",
            own[a].unit,
            0.3 * size,
            within=(own[a].name, own[b].name),
        )
        for a, b in PAIRS[3:]
    ]
    return np.stack(columns, -1), (*own, *skew)


def _section(arm: float, a: int, b: int) -> Array:
    """Return the flexibility (6, 6) at the end of a section, an arm before it, that turns about two axes."""
    moment = np.zeros((3, 6))  # at the section, of a wrench at the end
    moment[:, 3:] = np.eye(3)
    moment[1, 2], moment[2, 1] = -arm, arm
    turn = np.zeros((3, 3))
    turn[a, b] = turn[b, a] = 1.0
    return moment.T @ turn @ moment


def _sizes(length: float, soft: float) -> Array:
    """Return realistic sizes (6, 6) of the compliance at the end of a link."""
    slide, turn = soft * length**3 / (3 * EI), soft * length / EI
    own = np.array([slide, slide, slide, turn, turn, turn])
    sizes: Array = COUPLED * np.sqrt(np.outer(own, own))
    np.fill_diagonal(sizes, own)
    return sizes


EFFECT = Effect(
    name="link-bending",
    family="structure",
    meaning="The link bends, stretches and twists more than the model says.",
    components=_components,
    shapes=_shapes,
    separation="put a reflector at either end of the link",
    look_alikes=("bearing-tilt",),
    sources="of a heavy robot EI 3e6 to 3e7 N m^2, engineering estimate",
)
