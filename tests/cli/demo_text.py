"""What the demo prints, for its page; `make readme` writes it there."""

import os
import re
import subprocess
import sys
import tempfile
import textwrap
from pathlib import Path

PAGE = Path(__file__).resolve().parents[2] / "docs" / "demo.md"
BLOCK = re.compile(r"(?s)(<!-- demo -->\n```\w*\n)(.*?)(```)")


def demo_text(folder: Path) -> str:
    """Return what `beamstiff demo` prints in a folder, lines wrapped at 80 columns."""
    printed = subprocess.run(
        [sys.executable, "-m", "beamstiff", "demo"],
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,  # of which there is none
        encoding="utf-8",
        check=True,
        env=os.environ | {"NO_COLOR": "1"},
    ).stdout
    lines = (part for line in printed.splitlines() for part in textwrap.wrap(line, 80) or [""])
    return "\n".join(lines) + "\n"


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        text = demo_text(Path(folder))
    before = PAGE.read_text(encoding="utf-8")
    PAGE.write_text(BLOCK.sub(lambda found: found[1] + text + found[3], before, count=1), encoding="utf-8")


if __name__ == "__main__":
    main()
