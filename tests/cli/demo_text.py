"""What the demo prints, for its page; `make readme` writes it there."""

import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[2]


def demo_text(folder: Path) -> str:
    """Return what the demo prints, 80 columns wide; it draws into a folder, named as by default."""
    printed = subprocess.run(
        [
            sys.executable,
            str(REPOSITORY / "examples" / "demo.py"),
            str(folder / "ir663_identification.png"),
        ],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,  # of which there is none
        encoding="utf-8",
        check=True,
        env=os.environ | {"COLUMNS": "80", "NO_COLOR": "1"},
    ).stdout
    return as_shown(printed, folder)


def as_shown(printed: str, folder: Path) -> str:
    """Return what was printed as it is where the figures are drawn to where they are by default."""
    shown = printed.replace(f"{folder}{os.sep}", "examples/output/")
    return "".join(f"{line.rstrip()}\n" for line in shown.splitlines())


def main() -> None:
    page = REPOSITORY / "docs" / "demo.md"
    with tempfile.TemporaryDirectory() as folder:
        text = demo_text(Path(folder))
    before = page.read_text(encoding="utf-8")
    after = re.sub(
        r"(?s)(<!-- demo -->\n```\w*\n).*?(```)", lambda found: found[1] + text + found[2], before, count=1
    )
    page.write_text(after, encoding="utf-8")


if __name__ == "__main__":
    main()
