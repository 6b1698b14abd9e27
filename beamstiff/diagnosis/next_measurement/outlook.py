"""What proposed states are expected to settle, and whether to stop.

For the likeliest cause against its rivals, the log odds that new rows add are about normal, with mean
``+-d^2/2`` and variance ``d^2`` (Wald, Sequential Analysis, 1947); ``d^2 / 8`` is by how much the rows lower
the logarithm of the probability of erring between them (`test_plan`). A diagnosis divides log odds by a
number that grows with what its cause explains, and so with the rows (`decision.verdict`). So follows how
probable it is that the rows settle the matter, and that they turn it.

A cause of the library may fit what another, outside it, does in the rows that it was found with. Rows that it
was not found with check that, and so it is decided only where it led before the last batch, too.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import expit, logit
from scipy.stats import norm

from beamstiff.diagnosis.decision.tempering import divisor_of
from beamstiff.diagnosis.result import Diagnosis
from beamstiff.se3 import Array

DECIDED = 0.9  # probability of the likeliest cause, from which it is decided
TURNS = 0.05  # probability that the proposal would turn it, up to which it is
SETTLES = 0.05  # probability that `MANY` such proposals settle it, below which nothing more can be decided
MANY = 10
# log odds of a cause outside the library fall by so much with twice the rows, give or take: of simulated
# campaigns whose seeds are not reported
EASES, SPREAD = 0.4, 0.7
SHOWS = 100.0  # values less fitted ones, of which most causes would show; likewise
NODES = norm.ppf((np.arange(41) + 0.5) / 41)  # of a normal distribution, equally likely
NOTHING = ("none", "unknown")  # that names no cause
NONE_FOR = 4  # times the proposal's rows: so many must have named nothing


@dataclass(frozen=True)
class Outlook:
    """What a proposal is expected to settle.

    `leading`: the likeliest cause, `none` or `unknown`.
    `probability`: of it.
    `separates`: causes that the proposal tells apart; of none it bounds the parameters.
    `settles`: probability that after the proposal one cause has a probability of 0.9 at least.
    `turns`: probability that another one leads then.
    `ever`: probability that `MANY` such proposals settle it.
    `enough`: whether rows enough were read to say that nothing shows, or nothing known.
    `stands`: whether it led without the last batch, too.
    """

    leading: str
    probability: float
    separates: tuple[str, ...]
    settles: float
    turns: float
    ever: float
    enough: bool
    stands: bool = True

    @property
    def decided(self) -> bool:
        """Whether a cause is decided, and the proposal would hardly change it."""
        sure = self.probability >= DECIDED and self.turns <= TURNS and self.leading not in NOTHING
        return sure and self.stands

    @property
    def undecidable(self) -> bool:
        """Whether nothing more can be decided with this instrument: its noise hides what there may be."""
        if self.leading in NOTHING:
            return self.probability >= DECIDED and self.enough
        return not self.decided and self.ever < SETTLES and self.enough


def outlook(result: Diagnosis) -> Outlook:
    """Return what the proposal of a diagnosis is expected to settle."""
    leading, probability = result.verdict.key, result.verdict.probability
    if result.verdict.effect in NOTHING:
        leading = result.verdict.effect
    separates = tuple(result.next[0]["separates"]) if result.next else ()
    told = sum(one["discrimination"] for one in result.next)
    # where nothing is to be distinguished, information in nats: at most so far apart
    square = (8.0 if separates else 2.0) * told
    rows, evidence = len(result.baseline.rows), max(-result.features.get("unknown", 0.0), 0.0)
    freedom = int(result.baseline.used.sum()) - result.baseline.tangent.shape[2]
    # what a cause outside the library does nobody foretells: its share is about what it is, rather less
    unknown = sum(one.probability for one in result.candidates if one.effect == "unknown")
    outside = float(np.clip(unknown, 1e-9, 1.0 - 1e-9))
    first = max((one.probability for one in result.candidates if one.effect != "unknown"), default=0.0)
    # of few values nothing shows because nothing could
    shows = 1.0 - float(np.exp(-max(freedom, 1) / SHOWS)) if leading == "none" else 1.0
    tempered = "unknown" in result.features and leading != "none"

    def divisor(grown: float) -> float:
        return divisor_of(grown * evidence, round(grown * freedom)) if tempered else 1.0

    def after(times: int) -> tuple[float, float]:
        grown = 1.0 + times * len(result.next) / rows
        eased = expit(logit(outside) - EASES * np.log2(grown))
        return chances(first / (1.0 - outside), times * square, divisor(1.0), divisor(grown), float(eased))

    settles, turns = after(1)
    enough = rows >= NONE_FOR * max(len(result.next), 1)
    return Outlook(leading, probability, separates, shows * settles, turns, after(MANY)[0], enough)


def chances(
    probability: float, square: float, divided: float = 1.0, then: float = 1.0, outside: float = 0.0
) -> tuple[float, float]:
    """Return how probable it is that new rows settle which of two causes it is, and that they turn it.

    `probability`: of the leading one of them now. `square`: expected square of how far apart they foretell
    the rows. `divided`, `then`: by what log odds are divided now, and with the rows. `outside`: probability
    that it will be neither, give or take `SPREAD` of its log odds.

    >>> settles, turns = chances(0.6, 25.0)
    >>> round(settles, 2), round(turns, 2)
    (0.98, 0.4)
    >>> chances(0.6, 0.0)
    (0.0, 0.0)
    """
    p = float(np.clip(probability, 1e-6, 1.0 - 1e-6))
    spread = float(np.sqrt(max(square, 0.0)))
    left = expit(logit(outside) + SPREAD * NODES)
    needed = np.minimum(DECIDED / (1.0 - left), 1.0)
    with np.errstate(divide="ignore"):
        wanted, now = logit(needed) * then, float(logit(p)) * divided

    def below(level: Array, mean: float) -> Array:
        off = level - now - mean
        return np.asarray(norm.cdf(off / spread) if spread > 1e-9 else off > 0.0, dtype=np.float64)

    settles = turns = 0.0
    # log odds gained where the leading cause is right, or is not
    for share, mean in ((p, 0.5 * square), (1.0 - p, -0.5 * square)):
        settles += share * float((1.0 - below(wanted, mean) + below(-wanted, mean)).mean())
        turns += share * float(below(np.zeros(1), mean)[0])
    return settles, turns
