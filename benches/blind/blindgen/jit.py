"""One typed door to numba, so that the rest of the package stays readable to type checkers."""

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba

Function = TypeVar("Function", bound=Callable[..., Any])


def compiled(function: Function) -> Function:
    """Compile with numba and keep the machine code on disk.

    Products and sums may be contracted and reordered; NaN and infinity keep their meaning, because the integrator's
    guard against divergence relies on them.
    """
    decorate = numba.njit(cache=True, fastmath={"contract", "reassoc", "nsz", "arcp"}, error_model="numpy")
    return cast(Function, decorate(function))
