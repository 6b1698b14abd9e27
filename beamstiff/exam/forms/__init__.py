"""Effects as the simulated machines have them, in the forms of several authors, a folder each.

The authors of `author2`, `author3` and `author4` have not read the diagnosis. Who writes the diagnosis must
not read their forms: what its shapes miss can only show on forms that they do not know.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from beamstiff.errors import BeamstiffError, suggest
from beamstiff.exam.campaign import SimulatedCampaign, Truth
from beamstiff.exam.effect import Effect, Reality
from beamstiff.exam.forms import author1, author2, author3, author4
from beamstiff.exam.forms.author1 import tool
from beamstiff.exam.forms.author4 import geometry
from beamstiff.exam.names import EFFECTS as NAMED
from beamstiff.exam.names import LATER
from beamstiff.exam.parameters import DrawRequest
from beamstiff.robot.description import Robot

AUTHORS = (author1, author2, author3, author4)
EFFECTS = {
    name: Effect(name, places, tuple(tuple(f for f in some.FORMS if f.effect == name) for some in AUTHORS))
    for author in AUTHORS
    for name, places in author.PLACES.items()
}
INSIDE = tuple(EFFECTS[name] for name in NAMED)
OUTSIDE = tuple(effect for name, effect in EFFECTS.items() if name not in (*NAMED, *LATER))


def components(robot: Robot, effect: str) -> list[str | None]:
    """Return the components that an effect can sit at on a robot; empty where it cannot."""
    return list(_known(effect).places(robot))


def draw_truth(
    rng: np.random.Generator,
    robot: Robot,
    effect: str,
    size: float | None = None,
    component: str | None = None,
    form: str | None = None,
    authors: Sequence[int] = (),
) -> Truth:
    """Return an effect drawn at random: its component, form (of these authors) and parameters.

    `size`: from 0, hardly to be seen, to 1, the largest realistic one; drawn evenly by default.

    Raises BeamstiffError when the effect is unknown, or cannot sit on this robot or at this component.
    """
    known = _known(effect)
    possible = list(known.places(robot))
    if not possible or (component is not None and component not in possible):
        where = f"at {component!r}" if component else "anywhere"
        raise BeamstiffError(f"robot {robot.name!r} cannot have the effect {effect!r} {where}")
    place = possible[int(rng.integers(len(possible)))] if component is None else component
    kind = known.draw_form(rng, authors) if form is None else form
    if kind not in known.forms:
        raise BeamstiffError(
            f"effect {effect!r}: found the form {kind!r}, expected one of {tuple(known.forms)}"
        )
    measure = float(rng.uniform()) if size is None else size
    return Truth(effect, place, kind, known.forms[kind].draw(DrawRequest(rng, robot, place, kind, measure)))


def resized(truth: Truth, robot: Robot, size: float, seed: int) -> Truth:
    """Return an effect of another size at the same component and of the same form.

    What else it has is drawn anew from the seed: with the same seed only the size differs.
    """
    request = DrawRequest(np.random.default_rng(seed), robot, truth.component, truth.form, size)
    return replace(truth, parameters=_known(truth.effect).forms[truth.form].draw(request))


def author_of(truth: Truth) -> int:
    """Return who wrote the form of an effect: 1 for who writes the diagnosis; the others have not read it."""
    return _known(truth.effect).author_of(truth.form)


def came_to_rest(truth: Truth, campaign: SimulatedCampaign) -> Truth:
    """Return a target's slip as it is after a campaign, for one measured later: constant from its first row.

    Raises BeamstiffError when the effect is no slip.
    """
    if truth.effect != "target-slip":
        raise BeamstiffError(f"effect {truth.effect!r}, form {truth.form!r}: cannot come to rest")
    return tool.came_to_rest(truth) if author_of(truth) == 1 else geometry.came_to_rest(truth, len(campaign))


def imposed(truth: Truth, reality: Reality) -> Reality:
    """Return a reality with one more effect."""
    return _known(truth.effect).forms[truth.form].impose(truth, reality)


def _known(effect: str) -> Effect:
    if effect not in EFFECTS:
        raise BeamstiffError(f"unknown effect {effect!r}{suggest(effect, EFFECTS)}")
    return EFFECTS[effect]
