"""How likely each cause is before the data, after what real robots showed.

`EXPECTED` is how often a place of a machine (a joint, a link, the tool) has an effect above its noise: set by
hand after what measurements of some nine robots showed (`docs/diagnosis.md`): drives and gears come first,
the direction of approach and the target next; links, bearings, base and couplings seldom.
"""

from __future__ import annotations

from collections.abc import Mapping

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
ALL_DRIVES = 0.9  # all rigid drives at once: every drive is compliant, whether that shows is all that is open
SELDOM = 0.015  # at a joint or link, of any other effect: once in six places and ten machines

# The criterion takes the forms for exact. Forms of other authors leave a part of what they should explain, so
# that a difference of BIC says less than it seems: a quarter, the order of what was found for single causes
# (log odds by 1 + E / 60 at E of some hundred).
TEMPERING = 4.0


def expected(effect: str, component: str | None) -> float:
    """Return how many causes of an effect are expected at a component.

    Examples
    --------
    >>> expected("joint-compliance", "q2"), expected("joint-compliance", None)
    (0.15, 0.9)
    """
    if (effect, component) == ("joint-compliance", None):
        return ALL_DRIVES
    return EXPECTED.get(effect, SELDOM)
