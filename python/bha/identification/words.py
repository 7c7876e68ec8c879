"""Names of parameters as one says them: ``section.3.mass`` is the mass of section 3."""

from __future__ import annotations

from bha.parameters import paths
from bha.parameters.tables import AXES

_POWERS = {"1": "linear", "2": "quadratic", "3": "cubic"}
#: Of the odd powers of a bending moment.
_ODD_POWERS = {"1": "", "2": "cubic ", "3": "quintic "}


def spoken(path: str) -> str:
    """A parameter in words."""
    steps = path.split(".")
    key = paths.key_of(path) if not paths.is_group(path) else next(s for s in reversed(steps) if s != "*")
    words = "all numbers" if steps[0] == "effect" and key == steps[1] else key.replace("_", " ")
    last = steps[-1]
    if key in ("stiffness", "axial_stiffness") and last.isdigit():
        words = f"{_POWERS.get(last, f'power {last}')} {words}"
    elif key in ("bending_stiffness", "cross_bending_stiffness") and last.isdigit():
        words = f"{_ODD_POWERS.get(last, '')}{words}"
    elif last in AXES:
        words += f" along {last}"
    if steps[0] == "section":
        place = "all sections" if steps[1] == "*" else f"section {steps[1]}"
        if len(steps) > 3 and steps[2] == "bellows":
            place = ("all bellows of " if steps[3] == "*" else f"bellows {steps[3]} of ") + place
        words += f" of {place}"
    elif steps[0] == "length_sensor":
        words += f" of length sensor {steps[1]}"
    elif steps[0] == "effect":
        words += f" of effect {steps[1]}"
    return words


def joined(items: list[str]) -> str:
    """``a``, ``a and b``, ``a, b and c``."""
    return items[0] if len(items) == 1 else f"{', '.join(items[:-1])} and {items[-1]}"
