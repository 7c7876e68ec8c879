"""The arms that come with the package, as parameter files: ``bha.robots.load("bha_nominal")``."""

from __future__ import annotations

from importlib import resources

from bha.arm import Arm
from bha.errors import ParameterError
from bha.parameters import ArmParameters
from bha.parameters.base import nearest


def names() -> tuple[str, ...]:
    """Names of the arms that come with the package, in alphabetical order."""
    files = (entry.name for entry in resources.files(__name__).iterdir())
    return tuple(sorted(name.removesuffix(".toml") for name in files if name.endswith(".toml")))


def parameters(name: str) -> ArmParameters:
    """Parameters of an arm that comes with the package.

    Raises:
        ParameterError: there is no arm of that name; the text names the nearest.
    """
    if name not in names():
        raise ParameterError(f"no arm {name!r} comes with this package{nearest(name, names())}")
    text = resources.files(__name__).joinpath(f"{name}.toml").read_text(encoding="utf-8")
    return ArmParameters.from_toml(text, origin=f"bha.robots/{name}.toml")


def load(name: str) -> Arm:
    """An arm that comes with the package.

    Raises:
        ParameterError: there is no arm of that name; the text names the nearest.
    """
    return Arm.from_parameters(parameters(name))
