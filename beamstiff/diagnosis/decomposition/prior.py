"""How likely each cause is before the data: counts of what real robots showed.

`EXPECTED` is how many places of a machine have an effect above its noise, as counted on measurements of nine
robots (`docs/diagnosis.md`): drives and gears come first, the direction of approach and the target next;
links, bearings, base and couplings seldom. Each place of an effect has an equal part of it.
"""

from __future__ import annotations

from collections.abc import Mapping

EXPECTED: Mapping[str, float] = {
    "joint-compliance": 1.0,
    "angle-curve": 1.0,
    "approach-direction": 0.5,
    "backlash": 0.3,
    "hardening": 0.3,
    "hysteresis": 0.3,
    "target-slip": 0.3,
    "thermal-drift": 0.2,
    "payload-error": 0.2,
}
SELDOM = 0.1  # expected of any other effect: once at most on the nine robots

# The criterion takes the forms for exact. Forms of other authors leave a part of what they should explain, so
# that a difference of BIC says less than it seems: a quarter, the order of what was found for single causes
# (log odds by 1 + E / 60 at E of some hundred).
TEMPERING = 4.0


def expected(effect: str, places: int) -> float:
    """Return how many causes are expected at one of the places of an effect.

    Examples
    --------
    >>> round(expected("angle-curve", 6), 2)  # one joint in six
    0.17
    """
    return EXPECTED.get(effect, SELDOM) / places
