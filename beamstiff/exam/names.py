"""Names of effects and places as the exam compares them, and the families they belong to."""

NONE, UNKNOWN, FAILED = "none", "unknown", "failed"

FAMILIES: dict[str, tuple[str, ...]] = {
    "structure": ("link-bending", "bearing-tilt", "base-compliance", "tool-compliance", "joint-compliance"),
    "drive": (
        "actuator-lever",
        "backlash",
        "hardening",
        "hysteresis",
        "joint-coupling",
        "gravity-compensator",
    ),
    "geometry": ("geometry-error", "tool-offset"),
    "measurement": ("load-error", "frame-misalignment", "payload-error", "thermal-drift", "outliers"),
}

# in the table since the exam of crowded machines, which alone draws them: others keep their cases
LATER = ("angle-curve", "approach-direction", "target-slip")
EFFECTS = tuple(effect for effects in FAMILIES.values() for effect in effects)


def family(effect: str) -> str:
    """Return the family of an effect; a name that the table does not hold is a family of its own.

    >>> family("backlash"), family("none")
    ('drive', 'none')
    """
    return next((name for name, effects in FAMILIES.items() if effect in effects), effect)


def key_of(effect: str, component: str | None) -> str:
    """Return ``effect:component``; null for no component, the two of a pair in the order of the alphabet.

    >>> key_of("base-compliance", None), key_of("joint-coupling", "q6+q5")
    ('base-compliance:null', 'joint-coupling:q5+q6')
    """
    place = "null" if component is None else component
    return f"{effect}:{'+'.join(sorted(place.split('+')))}"


def normal(key: str) -> str:
    """Return a text ``effect:component`` as `key_of` writes it; ``none`` and ``unknown`` need no component.

    >>> normal("joint-coupling:q6+q5"), normal("none")
    ('joint-coupling:q5+q6', 'none:null')
    """
    effect, _, component = key.partition(":")
    return key_of(effect, component or None)


def effect_of(key: str) -> str:
    """Return the effect of a text ``effect:component``."""
    return key.partition(":")[0]


def place_of(key: str) -> str:
    """Return the component of a text ``effect:component``."""
    return key.partition(":")[2]


def is_named(key: str) -> bool:
    """Tell whether a verdict names an effect: it is neither none nor unknown, and there is one."""
    return effect_of(key) not in (NONE, UNKNOWN, FAILED)
