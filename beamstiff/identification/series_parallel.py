"""Springs identifiable only in combination: 1/k = sum of 1/k_i in series, k = sum of k_i in parallel."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

Kind = Literal["series", "parallel", "sum"]

INVERSE_UNITS = {"N/m": "m/N", "N*m/rad": "rad/(N*m)", "Pa": "1/Pa"}  # of the compliances


@dataclass(frozen=True)
class Spring:
    """A spring by itself: the stiffness parameter of this name."""

    name: str

    @property
    def members(self) -> tuple[str, ...]:
        """Names of the parameters in it."""
        return (self.name,)

    def stiffness(self, values: Mapping[str, float]) -> float:
        """Return its stiffness."""
        return values[self.name]

    def slopes(self, values: Mapping[str, float]) -> dict[str, float]:  # noqa: ARG002 (as of `Joined`)
        """Return the derivative of its stiffness by each member's."""
        return {self.name: 1.0}

    def text(self) -> str:
        """Return its stiffness as a formula."""
        return self.name


@dataclass(frozen=True)
class Joined:
    """Springs that act as one, in the units of the first.

    In series ``1/k = 1/k_1 + r_2/k_2 + ...``, in parallel ``k = k_1 + r_2 k_2 + ...``; the ratios are 1 where
    the springs carry the same load (have the same deformation), or squares of lever arms. A "sum" of
    compliances, whose ratios may be negative, is known though its terms are not.
    """

    kind: Kind
    parts: tuple[Spring | Joined, ...]
    ratios: tuple[float, ...]

    @property
    def members(self) -> tuple[str, ...]:
        """Names of the parameters in it."""
        return tuple(name for part in self.parts for name in part.members)

    @property
    def sums(self) -> tuple[Joined, ...]:
        """What is known of it: the sum itself."""
        return (self,)

    def value(self, values: Mapping[str, float]) -> float:
        """Return the sum that is known: of stiffness in parallel, else of compliances."""
        power = 1 if self.kind == "parallel" else -1
        return sum(r * p.stiffness(values) ** power for p, r in zip(self.parts, self.ratios, strict=True))

    def stiffness(self, values: Mapping[str, float]) -> float:
        """Return the stiffness of all of them together."""
        value = self.value(values)
        return value if self.kind == "parallel" else 1.0 / value

    def value_slopes(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return the derivative of the sum that is known by each member's stiffness."""
        result: dict[str, float] = {}
        for part, ratio in zip(self.parts, self.ratios, strict=True):
            outer = ratio if self.kind == "parallel" else -ratio / part.stiffness(values) ** 2
            result |= {name: outer * slope for name, slope in part.slopes(values).items()}
        return result

    def slopes(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return the derivative of the stiffness by each member's."""
        outer = 1.0 if self.kind == "parallel" else -(self.stiffness(values) ** 2)
        return {name: outer * slope for name, slope in self.value_slopes(values).items()}

    def text(self) -> str:
        """Return the sum that is known as a formula: ``1/J12.radial + 1/J33.radial``."""
        terms = []
        for part, ratio in zip(self.parts, self.ratios, strict=True):
            inner = f"({part.text()})" if isinstance(part, Joined) else part.text()
            if self.kind == "parallel":  # what is joined in it is in series: `join` makes one of like kinds
                inner = f"1/{inner}" if isinstance(part, Joined) else inner
                terms.append(inner if ratio == 1 else f"{ratio:.6g}*{inner}")
            else:
                terms.append(f"{ratio:.6g}/{inner}")
        return " + ".join(terms).replace("+ -", "- ")


def join(kind: Kind, a: Spring | Joined, b: Spring | Joined, ratio: float) -> Joined:
    """Return two as one, `b` counting `ratio` times; sums within sums of the same kind become one sum."""
    parts: list[Spring | Joined] = []
    ratios: list[float] = []
    for item, factor in ((a, 1.0), (b, ratio)):
        if isinstance(item, Joined) and item.kind == kind:
            parts += item.parts
            ratios += [factor * r for r in item.ratios]
        else:
            parts.append(item)
            ratios.append(factor)
    return Joined(kind, tuple(parts), tuple(ratios))
