"""Optional dependencies: imported when first used, with an error that says what to install."""

from __future__ import annotations

import importlib
from typing import Any

from bha.errors import MissingExtraError


def import_extra(module: str, *, extra: str, purpose: str) -> Any:
    """Import a module that belongs to an optional extra of this package.

    Args:
        module: dotted name, for example ``"pyarrow.parquet"``.
        extra: name of the extra in ``pyproject.toml`` that brings it, for example ``"parquet"``.
        purpose: what it is needed for, the start of the error's sentence: ``"Writing Parquet files"``.

    Raises:
        MissingExtraError: the package is not installed. One that is there but broken raises its own error.
    """
    package = module.partition(".")[0]
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        if error.name is None or error.name.partition(".")[0] != package:
            raise
        raise MissingExtraError(
            f"{purpose} needs {package}, which is not installed. Install it with: pip install 'bha[{extra}]'"
        ) from error
