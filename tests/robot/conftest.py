"""What the tests of robot files share: a robot with every key, and what is said of one that is wrong."""

from collections.abc import Callable
from pathlib import Path

import pytest

from beamstiff.errors import BeamstiffError
from beamstiff.robot.reader import load_robot


@pytest.fixture(scope="session")
def everything() -> str:
    """Return the text of a robot that uses every key."""
    return (Path(__file__).parent / "everything.yaml").read_text(encoding="utf-8")


@pytest.fixture
def message_for(tmp_path: Path) -> Callable[[str | bytes], str]:
    """Return a function: the text of a file, to what `load_robot` says of it, without the file's name."""

    def message_for(text: str | bytes) -> str:
        path = tmp_path / "robot.yaml"
        path.write_bytes(text.encode() if isinstance(text, str) else text)
        with pytest.raises(BeamstiffError) as error:
            load_robot(path)
        message = str(error.value)
        assert message.startswith(f"{path}:")
        assert message.isprintable(), "one line, fit for a terminal"
        assert len(message) < 600
        assert error.value.__suppress_context__ or error.value.__context__ is None
        return message.removeprefix(f"{path}:")

    return message_for
