"""Programs made of pieces, so that a test knows which characters are numbers of targets."""

import re
from dataclasses import dataclass

import numpy as np
from hypothesis import settings
from hypothesis import strategies as st

from beamstiff.compensation.formats.program import Program
from beamstiff.compensation.path import ToolPath
from beamstiff.measure.orientation import KUKA
from beamstiff.se3 import Array

# programs take long to make; `--hypothesis-profile=thorough` makes more all the same
FEWER = settings(max_examples=(settings.default.max_examples if settings.default else 100) // 4)
NUMBER = rb"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?"


@dataclass(frozen=True)
class Pieces:
    """What stands between the numbers (n + 1), and the numbers as text (n)."""

    between: tuple[str, ...]
    numbers: tuple[str, ...]

    @property
    def text(self) -> str:
        """The program."""
        parts = [part for pair in zip(self.between, self.numbers, strict=False) for part in pair]
        return "".join([*parts, self.between[-1]])

    def pattern(self) -> re.Pattern[bytes]:
        """Return what matches the program with any numbers; blanks in front of a number may give way."""
        *heads, last = [piece.encode("latin-1") for piece in self.between]
        parts = [re.escape(head.rstrip(b" ")) + rb" *(" + NUMBER + b")" for head in heads]
        return re.compile(b"".join(parts) + re.escape(last))


def number_texts(size: float) -> st.SearchStrategy[str]:
    """Return numbers up to a size as people and programs write them."""
    value = st.floats(-size, size).filter(lambda number: abs(number) > 1e-3)
    forms = (
        lambda number: f"{number:.3f}",
        lambda number: f"{number:+.2f}",
        lambda number: f"{number:.8f}",
        lambda number: f"{number:.6E}",
        lambda number: f"{number:.4e}",
        lambda number: f"{round(number)}",
        lambda number: f"{round(number)}.",
    )
    return st.builds(lambda number, form: form(number), value, st.sampled_from(forms))


BLANKS = st.sampled_from(["", " ", "  ", "\t", " \t "])
GAPS = st.sampled_from([" ", "  ", "     ", "\t"])
ENDS = st.sampled_from(["\n", "\r\n", "\r"])
REMARKS = st.text(st.characters(codec="latin-1", exclude_categories=["Cc"]), max_size=20)


def joined(lines: list[list[str]], end: str) -> Pieces:
    """Return pieces of lines that alternate between text and number, each ending with text."""
    between, numbers = [""], []
    for line in lines:
        between[-1] += line[0]
        for at in range(1, len(line), 2):
            numbers.append(line[at])
            between.append(line[at + 1])
        between[-1] += end
    return Pieces(tuple(between), tuple(numbers))


def check_unmodified(program: Program, pieces: Pieces, count: int) -> None:
    """Assert that a program has its targets, and is the same byte for byte while they stay."""
    assert len(program.path) == count
    assert program.with_poses(program.path.poses) == pieces.text.encode("latin-1")


def check_moved(program: Program, pieces: Pieces, seed: int) -> tuple[Array, ToolPath]:
    """Assert that numbers alone change when targets are moved, and positions come back.

    Returns where the targets were moved to, (N, 4, 4), and the path that is read again.
    """
    random, count = np.random.default_rng(seed), len(program.path)
    poses = program.path.poses.copy()
    poses[:, :3, 3] += random.uniform(-2e-3, 2e-3, (count, 3))
    poses[:, :3, :3] = KUKA.rotations(random.uniform(-2e-3, 2e-3, (count, 3))) @ poses[:, :3, :3]
    content = program.with_poses(poses)
    assert pieces.pattern().fullmatch(content)
    again = program.read(content.decode("latin-1"), program.path.source).path
    np.testing.assert_allclose(again.poses[:, :3, 3], poses[:, :3, 3], rtol=0, atol=0.51e-6)
    return poses, again
