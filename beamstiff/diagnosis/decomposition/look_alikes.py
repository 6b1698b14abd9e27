"""How sure a cause is: what the fit would be with another in its place, and without it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from beamstiff.diagnosis.decomposition.selection import Choice, HeldOut, Step, fit_step, gain, with_each
from beamstiff.robot.description import Robot

# The criterion takes the forms for exact. Forms of other authors leave a part of what they should explain, so
# that a difference of BIC says less than it seems. To be fitted on an exam of crowded machines; until then a
# quarter, the order of what was found for single causes (log odds by 1 + E / 60 at E of some hundred).
TEMPERING = 4.0
TOOL = "tool-compliance:null"
MOST_RIVALS = 12  # that are looked at: the best by the criterion
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


def rival_of(
    choice: Choice, step: Step, cause: tuple[int, ...], robot: Robot, held_out: HeldOut | None = None
) -> Rival:
    """Return how sure a cause of a fit is.

    Parameters
    ----------
    choice : Choice
    step : Step
    cause : tuple of int
        Its forms.
    robot : Robot
    held_out : function, optional
        Forms of others count only where they help on held-out postures. Without it all count.
    """
    own = choice.forms[cause[0]].key
    others = tuple(number for number in step.chosen if number not in cause)
    taken = {choice.forms[number].key for number in others}
    without = fit_step(choice, others)
    best: dict[str, float] = {own: step.bic, "none:null": without.bic}
    after = with_each(choice, without)
    before = None if held_out is None else held_out(without)
    for number in np.argsort(after, kind="stable").tolist():
        key = choice.forms[number].key
        if after[number] > without.bic or len(best) > MOST_RIVALS:
            break
        if key in best:
            continue
        other = fit_step(choice, (*others, number))
        if held_out is None or before is None or gain(before, held_out(other)) > 0.0:
            best[key] = other.bic
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
    named = sum(value for key, value in weight.items() if key == own or (own in same and key in same))
    return Rival(named / total, 1.0 - weight["none:null"] / total, tuple(alike))


def with_usual_name(choice: Choice, step: Step, robot: Robot) -> Step:
    """Return a fit in which what is one mechanics with a compliant tool is called so, where it fits as well.

    Adapters, force sensors and grippers are more compliant than the last bearing and link usually.
    """
    same = at_the_end(robot)
    for number in step.chosen:
        keys = {choice.forms[k].key for k in step.chosen}
        if choice.forms[number].key not in same or TOOL in keys:
            continue
        others = tuple(k for k in step.chosen if k != number)
        tools = [at for at, form in enumerate(choice.forms) if form.key == TOOL]
        named = min((fit_step(choice, (*others, at)) for at in tools), key=lambda fit: fit.bic, default=step)
        if named.bic <= step.bic - 2.0 * TEMPERING * np.log(PLAUSIBLE):
            return named
    return step


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
    return (TOOL, f"bearing-tilt:{last.variable or last.name}", *links)
