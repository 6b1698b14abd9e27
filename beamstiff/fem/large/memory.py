"""How much memory there is, and refusing beforehand what does not fit."""

import os
from pathlib import Path

from beamstiff.errors import BeamstiffError

SHARE = 0.9  # of what is free
GROWTH = 4 / 3  # of a factor with the unknowns, in a cube: the worst


def free_bytes() -> float:
    """Return how much memory is free, B; infinite where the system does not say."""
    found = [float("inf")]
    information = Path("/proc/meminfo")
    if information.exists():
        for line in information.read_text().splitlines():
            if line.startswith("MemAvailable"):
                found.append(1024.0 * float(line.split()[1]))
    elif hasattr(os, "sysconf") and "SC_AVPHYS_PAGES" in os.sysconf_names:
        found.append(float(os.sysconf("SC_AVPHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")))
    limit, used = (Path("/sys/fs/cgroup") / name for name in ("memory.max", "memory.current"))
    if limit.exists() and used.exists() and (text := limit.read_text().strip()).isdigit():  # a container's
        found.append(float(text) - float(used.read_text()))
    return max(0.0, min(found))


def refuse_unless_fits(what: str, needed: float, unknowns: int, instead: str = "") -> None:
    """Refuse work that needs more memory than is free."""
    free = SHARE * free_bytes()
    if needed <= free:
        return
    fitting = int(unknowns * (free / needed) ** (1 / GROWTH))
    raise BeamstiffError(
        f"{what} of {unknowns} unknowns needs {needed / 1e9:.2g} GB of memory, {free / 1e9:.2g} GB are free: "
        f"about {float(f'{fitting:.1g}'):.0f} unknowns would fit{instead}"
    )
