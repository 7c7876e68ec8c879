"""Blind test data for the diagnosis workflow: an arm simulator of its own, hidden effects, sealed answers.

Written apart from the product: nothing here imports ``bha``. See ``benches/blind/README.md``.
"""

from typing import Any

__all__ = ["make_case"]


def make_case(*args: Any, **kwargs: Any) -> Any:
    """Write one case; see :func:`blindgen.cases.make_case` (imported late: it needs numba)."""
    from .cases import make_case as implementation  # noqa: PLC0415

    return implementation(*args, **kwargs)
