"""What long work is at, for whoever listens: a terminal shows it."""

from collections.abc import Callable
from contextvars import ContextVar

LISTENER: ContextVar[Callable[[str], None] | None] = ContextVar("LISTENER", default=None)


def stage(name: str) -> None:
    """Say what begins now, such as "calibrating"; nothing happens where nobody listens."""
    if (listener := LISTENER.get()) is not None:
        listener(name)
