"""Free parameters on the command line: ``--free section.1.mass=0.7:0.5:0.9``."""

from __future__ import annotations

from bha.errors import InputError
from bha.estimation.free import FreeParameter


def free_parameter(text: str) -> FreeParameter:
    """The free parameter that a text names, with its start and bounds."""
    path, _, rest = text.partition("=")
    if not rest:
        return FreeParameter(path)
    try:
        numbers = [float(part) for part in rest.split(":")]
    except ValueError as error:
        raise InputError(f"--free {text}: numbers are needed after '=', as in section.1.mass=0.7:0.5:0.9") from error
    if len(numbers) not in (1, 3):
        raise InputError(f"--free {text}: a start, or start:low:high, is needed after '='")
    start, low, high = (*numbers, None, None)[:3]
    return FreeParameter(path, start=start, lower=low, upper=high)
