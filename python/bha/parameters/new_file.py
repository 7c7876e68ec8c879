"""The commented parameter file of a new arm, from what a tape measure and a scale tell; and copies of other files.

``tape_measure.py`` has the measures, ``guesses.py`` the rules. The text is written line by line and then read like any
other file, so that what is written here can be read.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import tomlkit

from bha.errors import ParameterWarning
from bha.names import pressure_name
from bha.parameters import guesses as rules
from bha.parameters import tape_measure
from bha.parameters.arm import SCHEMA, ArmParameters
from bha.parameters.guesses import GuessedSection
from bha.parameters.tape_measure import MeasuredArm, MeasuredSection

_MOUNTED = {
    "hanging": "hanging: z points down along the straight arm",
    "lying": "lying: the straight arm is level along z, x points down",
    "upright": "upright: z points up along the straight arm",
}


@dataclass
class _Table:
    """The lines of one table; their comments stand in one column."""

    header: str = ""
    rows: list[tuple[str, str]] = field(default_factory=list)

    def add(self, key: str, value: str, comment: str = "") -> None:
        self.rows.append((f"{key} = {value}", comment))

    def lines(self) -> list[str]:
        width = max((len(text) for text, comment in self.rows if comment), default=0)
        listed = [f"{text:<{width}}  # {comment}" if comment else text for text, comment in self.rows]
        return [self.header, *listed] if self.header else listed


def new_arm(measured: MeasuredArm) -> str:
    """The text of a commented parameter file of an arm that has been measured.

    What is guessed is marked as assumed, with its rule. The straight arm of the file has the lengths that were
    measured, without pressure and with the greatest in all bellows.

    Args:
        measured: what tape measure and scale tell.

    Raises:
        ParameterError: measures that cannot be: not positive, longest below length, a weight that the bellows cannot
            bear; all that are wrong are named.

    Warns:
        ParameterWarning: measures that can be but that no arm has, such as a length of 0.4 mm, and what follows from
            them: an upright arm that falls over, sections that bend round in a circle.
    """
    tape_measure.check(measured)
    _warn(measured, tape_measure.doubts(measured))
    guessed = rules.guesses(measured)
    _warn(measured, rules.doubts(measured, guessed))
    blocks = [_opening(measured), _whole(measured).lines(), _origins_of_whole(measured).lines()]
    for number, (section, guess) in enumerate(zip(measured.sections, guessed, strict=True), start=1):
        blocks += [table.lines() for table in _section(number, measured, section, guess)]
    text = "\n\n".join("\n".join(block) for block in blocks) + "\n"
    ArmParameters.from_toml(text, origin=measured.name)
    return text


def _warn(measured: MeasuredArm, doubts: Sequence[str]) -> None:
    for text in doubts:
        warnings.warn(f"{measured.name}: {text}", ParameterWarning, stacklevel=3)


def renamed(text: str, name: str, source: str) -> str:
    """The text of a parameter file under another name of the arm, with a line that says what it was made from.

    Args:
        text: of a parameter file; comments and layout stay.
        name: the new name.
        source: what it was made from, for the comment.

    Raises:
        ParameterError: the text is no parameter file, or the name is none.
    """
    parameters = ArmParameters.from_toml(text, origin=source).updated({"name": name})
    return f"# {name}: begun by bha new from {source}; what follows is said of {source}.\n{parameters.to_toml()}"


def _opening(measured: MeasuredArm) -> list[str]:
    file = f"{measured.name}.toml"
    return [
        f"# {measured.name}: made by bha new from what a tape measure and a scale tell. All numbers are in SI units.",
        "# The tables of provenance say which numbers were measured and which are guessed (assumed), and by what rule.",
        "# Guesses are right to a factor of a few: enough to begin with, not to predict. What to do with them:",
        f"#   bha info {file}                       what follows from these numbers",
        f"#   bha check {file} run.csv              whether a log belongs to this arm: tubes, signs, units",
        f"#   bha excite {file} --out excite.csv    pressures that tell the guessed numbers",
        f"#   bha identify {file} run.csv --out ..  fits stiffness, damping, bending stiffness and mass to logs",
        "# Frame: origin in the middle of the base, z along the straight arm, x the direction from which the angles of",
        "# bellows are counted, towards y. A bellows with more pressure than the others bends its section away.",
    ]


def _whole(measured: MeasuredArm) -> _Table:
    table = _Table()
    table.add("schema", f'"{SCHEMA}"')
    table.add("name", tomlkit.item(measured.name).as_string())
    table.add("gravity", _list(measured.gravity), f"m/s^2, {_MOUNTED[measured.mounting]}")
    table.add("ambient_pressure", _number(measured.ambient_pressure), "Pa, absolute; gauge pressures of logs add to it")
    table.add("force_model", '"work_conjugate"', '"end_force" is that of the paper, see docs/explanation/model.md')
    return table


def _origins_of_whole(measured: MeasuredArm) -> _Table:
    table = _Table("[provenance]")
    table.add("gravity", _origin("measured", f"{measured.mounting}, to the degree"))
    standard = measured.ambient_pressure == tape_measure.STANDARD_ATMOSPHERE
    table.add("ambient_pressure", _origin("assumed", "standard atmosphere") if standard else '"measured"')
    return table


def _section(number: int, measured: MeasuredArm, section: MeasuredSection, guess: GuessedSection) -> list[_Table]:
    ambient = measured.ambient_pressure
    pressures = (ambient + measured.pressure_min, ambient + measured.pressure_max)
    table = _Table("[[section]]")
    table.add("mass", _number(section.mass), "kg, thought of as one piece at the head")
    table.add("bellows_radius", _number(section.radius), "m, from the centre line to the middle of a bellows")
    table.add("bellows_outer_radius", _number(section.diameter / 2.0), "m, of one bellows; gives the inertia")
    area = _guess(guess.terminal_area) if section.area is None else _number(section.area)
    table.add("terminal_area", area, "m^2, that the pressure in a bellows pushes on")
    table.add("rest_length", _guess(guess.rest_length), "m, of a bellows without pressure and weight")
    table.add("stiffness", _list([guess.stiffness], _guess), "N/m, of one bellows; fitted by bha identify")
    table.add("damping", _guess(guess.damping), "N s/m, of one bellows; fitted by bha identify")
    bending = _list([guess.bending_stiffness], _guess)
    table.add("bending_stiffness", bending, "N m, beside the springs; fitted by bha identify")
    table.add("length_range", _list(guess.length_range, _guess), "m, beyond it bha warns")
    table.add("pressure_range", _list(pressures), "Pa, absolute; beyond it bha warns")
    if section.base_offset:
        table.add("base_offset", _number(section.base_offset), "m, stiff piece before the bellows")
    if section.head_offset:
        table.add("head_offset", _number(section.head_offset), "m, stiff piece after the bellows")
    return [table, _origins(measured, section), *_bellows(number, section)]


def _origins(measured: MeasuredArm, section: MeasuredSection) -> _Table:
    table = _Table("[section.provenance]")
    taped = ["mass", "bellows_radius", "bellows_outer_radius", "pressure_range"]
    taped += [key for key in ("base_offset", "head_offset") if getattr(section, key)]
    for key in taped:
        table.add(key, '"measured"')
    longest = "the longest length measured"
    if section.longest is None:
        longest = f"a longest length of {tape_measure.USUAL_STRETCH:g} times that without pressure"
    assumed = {
        "rest_length": {
            "hanging": "measured length, less what the weight stretches",
            "lying": "measured length",
            "upright": "measured length, and what the weight compresses",
        }[measured.mounting],
        "stiffness": f"area times greatest pressure, over what it lengthens a bellows by; {longest}",
        "damping": f"{rules.DAMPING_RATIO:g} of critical damping of the mass that the section carries on its springs",
        "bending_stiffness": "springs spread over the circle of a bellows' mean diameter",
        "length_range": f"{rules.USUAL_COMPRESSION:g} of the length, to the longest and a tenth of the travel more",
    }
    if section.area is None:
        ratio = f"{rules.AREA_RATIO:g} of the circle of the outer diameter"
        table.add("terminal_area", _origin("assumed", f"{ratio}: that of the mean diameter of a bellows"))
    else:
        table.add("terminal_area", '"measured"')
    for key, rule in assumed.items():
        table.add(key, _origin("assumed", rule))
    return table


def _bellows(number: int, section: MeasuredSection) -> list[_Table]:
    tables = []
    for place, angle in enumerate(section.angles_deg, start=1):
        table = _Table("[[section.bellows]]")
        name = pressure_name(number, place)
        table.add("angle_deg", _number(angle), "degrees about z, from x towards y" if place == 1 else "")
        tube = "the tube that feeds it; several bellows may name the same" if place == 1 else ""
        table.add("input", f'"{name}"', tube)
        tables.append(table)
    return tables


def _origin(status: str, source: str) -> str:
    entry: Mapping[str, str] = {"status": status, "source": source}
    return "{ " + ", ".join(f"{key} = {tomlkit.item(text).as_string()}" for key, text in entry.items()) + " }"


def _number(value: float, digits: int = 9) -> str:
    """A float of TOML; ``digits`` are as many as a tape measure could have."""
    text = re.sub(r"e([+-])0*(\d)", lambda m: f"e{m[1].lstrip('+')}{m[2]}", f"{value:.{digits}g}")
    return text if any(mark in text for mark in ".e") else f"{text}.0"


def _guess(value: float) -> str:
    """A guessed number, with more digits than it deserves and fewer than look like a measurement."""
    return _number(value, 4)


def _list(values: Sequence[float], written: Callable[[float], str] = _number) -> str:
    return f"[{', '.join(map(written, values))}]"
