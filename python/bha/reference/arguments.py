"""Checks of the arrays that the public functions take: shape and finiteness, with an error that says what was found.

Complex values pass as they are: derivatives by the complex step (Squire & Trapp, SIAM Review 40(1), 1998) are exact to
rounding, which differences are not.
"""

from __future__ import annotations

import numpy as np

from bha.errors import InputError
from bha.reference.homogeneous import Array
from bha.reference.parameters import Arm


def vector(arm: Arm, name: str, values: Array) -> Array:
    """Return ``values`` as a vector of 3n finite numbers, or raise InputError that says what was found."""
    return _checked(name, values, (3 * arm.section_count,))


def external(arm: Arm, f_ext: Array | None) -> Array | None:
    """Return ``f_ext`` as an array (n, 3) of finite numbers, or None; InputError otherwise."""
    return None if f_ext is None else _checked("f_ext", f_ext, (arm.section_count, 3))


def _checked(name: str, values: Array, shape: tuple[int, ...]) -> Array:
    array = np.asarray(values, dtype=complex if np.iscomplexobj(values) else float)
    if array.shape != shape:
        raise InputError(f"{name}: found shape {array.shape}, needed is {shape}")
    if not np.isfinite(array).all():
        raise InputError(f"{name}: found values that are not finite: {array}")
    return array
