"""How sure a cause is: what the fit would be with another in its place, and without it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from beamstiff.diagnosis.decomposition.selection import Choice, Step, fit_step, with_each
from beamstiff.robot.description import Robot

# The criterion takes the forms for exact. Forms of other authors leave a part of what they should explain, so
# that a difference of BIC says less than it seems. To be fitted on an exam of crowded machines; until then a
# quarter, the order of what was found for single causes (log odds by 1 + E / 60 at E of some hundred).
TEMPERING = 4.0
PLAUSIBLE = 0.05  # of the likeliest: less is told from it


@dataclass(frozen=True)
class Rival:
    """How sure a cause is.

    Attributes
    ----------
    probability : float
        Of this cause, against others in its place and against none.
    present : float
        Of any cause in its place.
    indistinguishable : tuple of str
        Causes that explain the rows nearly as well in its place.
    """

    probability: float
    present: float
    indistinguishable: tuple[str, ...]


def rival_of(choice: Choice, step: Step, cause: tuple[int, ...], robot: Robot) -> Rival:
    """Return how sure a cause of a fit is; `cause` is its forms."""
    own = choice.forms[cause[0]].key
    others = tuple(number for number in step.chosen if number not in cause)
    taken = {choice.forms[number].key for number in others}
    without = fit_step(choice, others)
    best: dict[str, float] = {own: step.bic, "none:null": without.bic}
    for form, value in zip(choice.forms, with_each(choice, without).tolist(), strict=True):
        if form.key != own:
            best[form.key] = min(value, best.get(form.key, np.inf))
    least = min(best.values())
    weight = {key: float(np.exp(-(value - least) / (2.0 * TEMPERING))) for key, value in best.items()}
    alike = [
        key
        for key in sorted(weight, key=lambda key: -weight[key])
        if key not in (own, "none:null") and weight[key] >= PLAUSIBLE * weight[own]
    ]
    same = at_the_end(robot)
    if own in same:  # whatever the forms of the model say: the flange is where the maker says
        alike += [key for key in same if key != own and key not in alike and key not in taken]
    total = sum(weight.values())
    return Rival(weight[own] / total, 1.0 - weight["none:null"] / total, tuple(alike))


def at_the_end(robot: Robot) -> tuple[str, ...]:
    """Return the causes that are one mechanics: behind the last joint everything turns with the tool.

    The last bearing, a link or stalk behind it and the tool itself bend alike for every point behind them;
    only a reflector on either side distinguishes them.
    """
    last = robot.joints[-1] if robot.joints else None
    if last is None:
        return ()
    parts = [(part.name, set(part.nodes)) for part in robot.rigids]
    parts += [(part.name, set(part.nodes)) for part in robot.beams]

    def joined(node: str) -> list[str]:
        """Return the parts that hang together with a node, no joint between."""
        nodes, names = {node}, []
        for _ in parts:
            for name, ends in parts:
                if name not in names and ends & nodes:
                    names.append(name)
                    nodes |= ends
        return names

    links = [f"link-bending:{name}" for node in last.nodes[::-1] for name in joined(node)]
    return ("tool-compliance:null", f"bearing-tilt:{last.variable or last.name}", *links)
