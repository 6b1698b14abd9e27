"""How likely each cause is before the data, after what real robots showed.

`EXPECTED` is how often a place of a machine (a joint, a link, the tool) has an effect above its noise: set by
hand after what measurements of some nine robots showed (`docs/diagnosis_method.md`): drives and gears come
first, the direction of approach and the target next; links, bearings, base and couplings seldom.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

EXPECTED: Mapping[str, float] = {
    "joint-compliance": 0.15,
    "angle-curve": 0.15,
    "approach-direction": 0.08,
    "backlash": 0.05,
    "hardening": 0.05,
    "hysteresis": 0.05,
    "target-slip": 0.1,
    "thermal-drift": 0.2,
    "payload-error": 0.2,
    "tool-compliance": 0.1,
    "base-compliance": 0.1,
    "load-error": 0.1,
    "joint-coupling": 0.007,  # once in 15 pairs of joints and ten machines
}
# All drives at once, no place of one: every rigid drive is compliant, whether that shows is all that is open.
# Lost motion of all joints showed on four of some ten robots: IRB 120, Stäubli TX2-90L, Meca500, Rokae.
ALL_DRIVES: Mapping[str, float] = {"joint-compliance": 0.9, "approach-direction": 0.4}
SELDOM = 0.015  # at a joint or link, of any other effect: once in six places and ten machines

# The criterion takes the forms for exact. Forms of other authors leave a part of what they should explain, so
# that a difference of BIC says less than it seems: a quarter, the order of what was found for single causes
# (log odds by 1 + E / 60 at E of some hundred).
TEMPERING = 4.0
# What forms leave grows with what they explain: against another cause E over this is added, E half the fall
# of the criterion by the cause. Of 60, 120 and 240 the one whose probabilities held best on 115 simulated
# machines (seed 31003).
RELATIVE = 120.0


@dataclass(frozen=True)
class Prior:
    """Which causes are candidates, and how likely each is before the data.

    `without`: effects, or ``effect:component``, that are no candidates.
    `given`: how many of a cause are expected at a component, by ``effect:component``, or by effect at each of
        its components; what is not named keeps its default.
    `measured`: the same by ``effect:component`` after other readings than positions, which count in its
        place.

    >>> prior = Prior(given={"backlash": 0.2, "backlash:q2": 0.6})
    >>> prior.expected("backlash", "q1"), prior.expected("backlash", "q2"), prior.expected("hardening", "q1")
    (0.2, 0.6, 0.05)
    """

    without: tuple[str, ...] = ()
    given: Mapping[str, float] = field(default_factory=dict)
    measured: Mapping[str, float] = field(default_factory=dict)

    def expected(self, effect: str, component: str | None) -> float:
        """Return how many causes of an effect are expected at a component."""
        default = default_expected(effect, component)
        if component is not None or effect not in ALL_DRIVES:
            default = self.given.get(effect, default)
        key = key_of(effect, component)
        return self.measured.get(key, self.given.get(key, default))

    def ratio(self, effect: str, component: str | None) -> float:
        """Return how many times likelier than by default a cause is."""
        return self.expected(effect, component) / default_expected(effect, component)


DEFAULT = Prior()


def default_expected(effect: str, component: str | None) -> float:
    """Return how many causes of an effect are expected at a component of any machine.

    >>> default_expected("joint-compliance", "q2"), default_expected("joint-compliance", None)
    (0.15, 0.9)
    """
    every = ALL_DRIVES if component is None else EXPECTED
    return every.get(effect, EXPECTED.get(effect, SELDOM))


def key_of(effect: str, component: str | None) -> str:
    """Return ``effect:component``, a missing component written ``null``."""
    return f"{effect}:{'null' if component is None else component}"
