"""Print how many structures of unlike parts are answered: `python -m benchmarks.stiffness_spread [SHARE]`.

600 chains and 300 structures with loops, the softest and the stiffest part 1e4 to 1e20 apart, and nearly
stretched ties; the truth is worked out in 120 digits. SHARE (default 1) of them are tried.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable, Iterable

from tests.fem.random_frames import RandomFrame
from tests.fem.stiffness_spreads import chain, outcome, stretched_tie, with_loops

POWERS = (4, 8, 12, 16, 18, 20)
GAPS = (0.0, 1e-16, 1e-14, 1e-12, 1e-10, 1e-9, 1e-8, 1e-6, 1e-4)
KINDS = ("right", "refused", "mechanism", "wrong")
SEEDS = 1000  # of one spread: no two share one


def counted(structures: Iterable[RandomFrame]) -> Counter[str]:
    """Return how many structures come to what, see `outcome`."""
    return Counter(outcome(made)[0] for made in structures)


def spread(make: Callable[[int, float], RandomFrame], count: int, powers: int) -> Counter[str]:
    """Return the same of structures drawn at random."""
    return counted(make(SEEDS * powers + seed, powers) for seed in range(count))


def main() -> None:
    """Print the table."""
    share = float(sys.argv[1]) if len(sys.argv) > 1 else 1.0
    rows = []
    for name, make, count in (("chain", chain, 600), ("with loops", with_loops, 300)):
        each = max(1, round(share * count / len(POWERS)))
        rows += [(name, f"1e{powers}", spread(make, each, powers)) for powers in POWERS]
    ties = max(1, round(20 * share))
    rows += [
        ("stretched tie", f"gap {gap:g} m", counted(stretched_tie(gap, seed) for seed in range(ties)))
        for gap in GAPS
    ]
    print("| structure | spread | right | refused | is a mechanism, refused | wrong |")
    print("| --- | --- | --- | --- | --- | --- |")
    for name, what, found in rows:
        print("|", " | ".join([name, what, *(str(found[kind]) for kind in KINDS)]), "|", flush=True)
    if wrong := sum(found["wrong"] for *_, found in rows):
        sys.exit(f"{wrong} wrong answers, expected none")


if __name__ == "__main__":
    main()
