"""Displacements that linear statics fits better than the equilibrium under load: calculated ones."""

from beamstiff.diagnosis.inference.search import UNKNOWN
from beamstiff.diagnosis.residual.baseline import Baseline, linear_gap
from beamstiff.diagnosis.result import Diagnosis
from beamstiff.identification.whitening import whitening
from beamstiff.se3 import Array

BETTER = 10.0  # of chi^2, at as many values: very strong (Kass and Raftery, JASA 90 (1995) 773)


def linear_statics(found: Diagnosis) -> str:
    """Return, in words, that linear statics explains what no cause does; mostly empty."""
    fit = found.baseline
    if fit.absolute or not fit.fitted or found.verdict.key != UNKNOWN:
        return ""
    linear = linear_gap(fit)
    squares = [_squares(fit, gap) for gap in (linear, fit.gap)]
    if squares[1] - squares[0] < BETTER:
        return ""
    left = [1e3 * float((gap[:, :3] ** 2).sum(axis=1).mean() ** 0.5) for gap in (linear, fit.gap)]
    return (
        f"linear statics leaves {left[0]:.2g} mm of the fitted rows, the equilibrium of the loaded machine, "
        f"which is counted with here, {left[1]:.2g} mm: did a program calculate the readings, on the "
        "undeformed machine? `beamstiff identify` counts as it does"
    )


def _squares(fit: Baseline, gap: Array) -> float:
    left = whitening(fit.sigma, fit.used, fit.sharing) @ gap[fit.used]
    return float(left @ left)
