"""What is true of a crowded machine, what was said of it, and both together once the label is open."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, Literal

from beamstiff.exam.names import effect_of
from beamstiff.exam.record import sha256

Kind = Literal["crowded", "outside", "geometry", "clean"]
EXAMINED = "diagnosis"  # its name among those who reply; the others are the controls
OF_GEOMETRY = ("geometry-error", "tool-offset")  # no frame is bent or moved: to name one is false
LEAST = 0.1  # share of the gap from which a cause has to be found


@dataclass(frozen=True)
class TrueCause:
    """An effect at work, by what it does to the rows; causes are in the order in which most is closed."""

    key: str  # ``effect:component``
    form: str  # constitutive form
    author: int  # who wrote the form
    accept: tuple[str, ...]  # names that mean the same in these data
    outside: bool  # whether no library has it
    contribution_mm: float  # RMS of what leaving it out changes in the positions, after a refit
    closes: float  # share of the gap that it closes after those before it
    hidden: bool  # so small that it is neither asked for nor false


@dataclass(frozen=True)
class CrowdedLabel:
    """What is true in a case; the diagnosis never sees it.

    `kind`: "crowded", "outside", "geometry" or "clean"; ``outside``: the largest effect is in nobody's
        library; ``geometry``: nothing is off but the geometry.
    """

    case: int
    kind: Kind
    robot: str  # its name
    data: str  # ``absolute`` or ``displacement``
    poses: int
    rows: int
    causes: tuple[TrueCause, ...]  # in the order of what they close
    noise_mm: float  # RMS of the position noise' norm
    gap_mm: float  # RMS of what the best geometry and compliances leave without noise
    remainder_mm: float  # RMS of that which all effects of the library together cannot take

    def digest(self) -> str:
        """Return the SHA-256 of the label, which seals it."""
        return sha256(asdict(self))

    @property
    def library(self) -> tuple[TrueCause, ...]:
        """The causes that a library could name."""
        return tuple(cause for cause in self.causes if not cause.outside)

    @property
    def asked(self) -> tuple[TrueCause, ...]:
        """The causes that have to be found."""
        return tuple(cause for cause in self.library if not cause.hidden and cause.closes >= LEAST)

    def named_by(self, key: str) -> TrueCause | None:
        """Return the cause that a name means; None where no such effect is at work.

        ``joint-compliance:null``, all drives together, means one of several compliant joints.
        """
        joints = [one for one in self.library if effect_of(one.key) == "joint-compliance"]
        if key == "joint-compliance:null" and len(joints) > 1:
            return joints[0]
        exact = (cause for cause in self.library if cause.key == key)
        return next(exact, None) or next((one for one in self.library if key in one.accept), None)

    def is_real(self, key: str) -> bool:
        """Tell whether a name means an effect at work, or a geometry that is off indeed."""
        off = self.data == "absolute" and self.kind != "clean" and effect_of(key) in OF_GEOMETRY
        return off or self.named_by(key) is not None


@dataclass(frozen=True)
class Reply:
    """What somebody said of a case, and how that did on fresh poses."""

    verdict: str  # ``effect:component``, ``none:null``, ``unknown:null``, ``failed:null`` where it broke off
    named: tuple[str, ...] = ()  # the causes in order
    alike: tuple[str, ...] = ()  # what cannot be told from the first cause, or from the verdict
    promised: float = 0.0  # share of the gap that all causes, undecided ones too, are said to close
    said_mm: float | None = None  # the remainder as said, RMS, noise included
    least_mm: float | None = None  # the same as below with hidden causes taken up besides
    left_mm: float | None = None  # what the named causes that are real leave after a refit, noise included
    closing: float | None = None  # share of the gap closed on fresh poses, without noise; None: none named
    seconds: float = 0.0
    error: str | None = None  # why it broke off, or why it could not predict the fresh poses


@dataclass(frozen=True)
class CrowdedRecord:
    """A case, answered and opened."""

    label: CrowdedLabel
    replies: Mapping[str, Reply]  # of the diagnosis that is examined (`EXAMINED`) and of each control
    label_sha256: str  # seal of the label, before the diagnosis
    report_sha256: str  # seal of the reports, before the label was opened

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for one line of JSON."""
        return asdict(self)
