"""A diagnosis in plain words: what a named effect means for the arm, in a sentence a mechanic would say.

A sentence a kind of effect, from its place and its numbers. A kind without one of its own falls back to the summary
that the core's registry has of it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from bha.parameters import EFFECT_KINDS, Place

if TYPE_CHECKING:
    from bha.diagnosis.result import Alternative, Diagnosis, Effect, Gap, NextExperiment, SlowSection

Numbers = Mapping[str, float]

#: What a verdict is called.
VERDICTS = {
    "named": "A missing effect is named",
    "one_of": "A missing effect is found, one of a few that these logs cannot tell apart",
    "equivalent": "Equivalent: no gap that matters",
    "unexplained": "A gap that nothing known explains",
    "setup": "The setup comes first",
}
#: Below this an angle, rad, or a length, m, is not worth its number.
_NO_ANGLE, _NO_LENGTH = 1e-4, 1e-5
#: Times of filling and venting that differ by less than this part are said as one.
_ALIKE = 0.05
#: Ratio of the two from which one way is the slower one.
_UNLIKE = 1.2


@dataclass(frozen=True)
class Subject:
    """Where an effect sits, as the subject of a sentence."""

    text: str
    plural: bool = False

    def verb(self, singular: str, plural: str) -> str:
        """The subject with the form of a verb that suits it."""
        return f"{self.text} {plural if self.plural else singular}"


def bellows_of(place: Place) -> Subject:
    """Bellows, as a subject."""
    match place.sort:
        case "bellows":
            return Subject(f"bellows {place.bellows} of section {place.section}")
        case "section":
            return Subject(f"the bellows of section {place.section}", plural=True)
    return Subject("all bellows", plural=True)


def section_of(place: Place) -> Subject:
    """A section, as a subject."""
    return Subject(f"section {place.section}" if place.section is not None else "every section")


def pressure_of(place: Place) -> Subject:
    """Pressures, as a subject."""
    match place.sort:
        case "input":
            return Subject(f"the pressure of input {place.input}")
        case "section":
            return Subject(f"the pressures of section {place.section}", plural=True)
        case "bellows":
            return Subject(f"the pressure of bellows {place.bellows} of section {place.section}")
    return Subject("all pressures", plural=True)


def pressure_sensor_of(place: Place) -> Subject:
    """Sensors of pressures, as a subject."""
    if place.sort == "input":
        return Subject(f"the pressure sensor of input {place.input}")
    return Subject("all pressure sensors", plural=True)


def length_sensor_of(place: Place) -> Subject:
    """Sensors of lengths, as a subject."""
    match place.sort:
        case "bellows":
            return Subject(f"the length sensor of bellows {place.bellows} of section {place.section}")
        case "section":
            return Subject(f"the length sensors of section {place.section}", plural=True)
    return Subject("all length sensors", plural=True)


def number(value: float, unit: str) -> str:
    """A number with three digits in the unit that people would say: mm, ms, kPa, degrees, percent."""
    scaled, said = value, unit
    match unit:
        case "m" if abs(value) < 0.5:
            scaled, said = 1e3 * value, "mm"
        case "s" if abs(value) < 0.2:
            scaled, said = 1e3 * value, "ms"
        case "Pa" if abs(value) >= 1e3:
            scaled, said = 1e-3 * value, "kPa"
        case "kg" if abs(value) < 0.5:
            scaled, said = 1e3 * value, "g"
        case "rad":
            scaled, said = math.degrees(value), "degrees"
        case "" | "1":
            scaled, said = 100.0 * value, "%"
    text = f"{scaled:.3g}"
    # Three digits of whole numbers and no power of ten.
    if "e" in text and 1e-4 < abs(scaled) < 1e6:
        text = f"{scaled:.0f}"
    return f"{text} {said}".strip()


def _share(value: float, more: str, less: str) -> str:
    return f"{number(abs(value), '')} {more if value > 0.0 else less}"


def _creep(place: Place, n: Numbers) -> str:
    return (
        f"{bellows_of(place).verb('creeps', 'creep')}: after a change of length a spring of "
        f"{number(n['stiffness'], 'N/m')} gives way within {number(n['tau'], 's')}"
    )


def _hysteresis(place: Place, n: Numbers) -> str:
    return (
        f"{bellows_of(place).verb('has', 'have')} hysteresis: up to {number(n['amplitude'], 'N')} depend on where it "
        f"came from, and turn round within {number(n['yield'], 'm')}"
    )


def _friction(place: Place, n: Numbers) -> str:
    return f"{bellows_of(place).verb('rubs', 'rub')} with {number(n['coulomb_force'], 'N')} of dry friction"


def _quadratic_damping(place: Place, n: Numbers) -> str:
    return (
        f"{bellows_of(place).verb('is', 'are')} damped by {number(n['damping'], 'N s^2/m^2')} times the square of "
        "speed, beside the damping of the file"
    )


def _bending_damping(place: Place, n: Numbers) -> str:
    return f"{section_of(place).verb('has', 'have')} {number(n['damping'], 'N m s/rad')} of damping against bending"


def _bending_nonlinear(place: Place, n: Numbers) -> str:
    cubic, quintic = n["cubic_stiffness"], n.get("quintic_stiffness", 0.0)
    # At a radian both parts count alike.
    change = "grows" if cubic + quintic > 0.0 else "falls"
    parts = f"cubic part {number(cubic, 'N m/rad^3')}"
    if quintic:
        parts += f", quintic {number(quintic, 'N m/rad^5')}"
    return f"the bending stiffness of {section_of(place).text} {change} with the bend ({parts})"


def _bending_anisotropy(place: Place, n: Numbers) -> str:
    return (
        f"{section_of(place).verb('is', 'are')} stiffer by {number(n['stiffness'], 'N m/rad')} against bending in the "
        f"plane at {number(n['angle'], 'rad')} about its axis"
    )


def _section_coupling(place: Place, n: Numbers) -> str:
    first = place.section
    pair = f"sections {first} and {first + 1}" if first is not None else "neighbouring sections"
    return f"the bending of {pair} is coupled by a spring of {number(n['stiffness'], 'N m/rad')}"


def _effective_area(place: Place, n: Numbers) -> str:
    parts = []
    if n.get("by_pressure"):
        parts.append(f"{number(1e5 * n['by_pressure'], '')} for each bar")
    if n.get("by_length"):
        parts.append(f"{number(1e-2 * n['by_length'], '')} for each centimetre of length")
    return f"the effective area of {bellows_of(place).text} changes by {' and '.join(parts) or 'nothing'}"


def _pressure_stiffness(place: Place, n: Numbers) -> str:
    change = 1e5 * (n["bending"] or n["axial"])
    what = "resist bending" if n["bending"] else "resist stretching"
    return f"{bellows_of(place).text} {what} {_share(change, 'more', 'less')} for each bar"


def _weak_bellows(place: Place, n: Numbers) -> str:
    return f"{bellows_of(place).verb('is', 'are')} {_share(n['change'], 'stiffer', 'softer')} than the file says"


def _payload(place: Place, n: Numbers) -> str:
    mass = n["mass"]
    more = "more" if mass > 0.0 else "less"
    text = f"the head of section {place.section} carries {number(abs(mass), 'kg')} {more} than the file says"
    away = math.sqrt(sum(n.get(axis, 0.0) ** 2 for axis in "xyz"))
    return f"{text}, {number(away, 'm')} from its middle" if away > _NO_LENGTH else text


def _preload(place: Place, n: Numbers) -> str:
    where = "each section" if place.section is None else f"section {place.section}"
    torque = number(math.hypot(n["to_x"], n["to_y"]), "N m")
    return f"{where} is held by a constant force of {number(n['along'], 'N')} along it and a torque of {torque}"


def _base_tilt(place: Place, n: Numbers) -> str:
    del place
    turns = [f"{number(n[f'about_{a}'], 'rad')} about {a}" for a in "xy" if abs(n.get(f"about_{a}", 0.0)) > _NO_ANGLE]
    return f"the base stands askew by {' and '.join(turns) or 'nothing'}"


def _tool_drag(place: Place, n: Numbers) -> str:
    parts = [
        number(n[key], unit)
        for key, unit in (("stiffness", "N/m"), ("damping", "N s/m"), ("drag", "N s^2/m^2"))
        if n.get(key)
    ]
    return f"a hose or tool pulls at the head of section {place.section} ({', '.join(parts)})"


def _contact(place: Place, n: Numbers) -> str:
    head = f"the head of section {place.section}" if place.section is not None else "a head"
    return f"{head} runs against something with a stiffness of {number(n['stiffness'], 'N/m')}"


def _pressure_lag(place: Place, n: Numbers) -> str:
    subject = pressure_of(place)
    if math.isclose(n["fill"], n["vent"], rel_tol=1e-3):
        return f"{subject.verb('lags', 'lag')} by {number(n['fill'], 's')}"
    return (
        f"{subject.verb('lags', 'lag')}: by {number(n['fill'], 's')} when filling, by {number(n['vent'], 's')} when "
        "venting"
    )


def _delay(place: Place, n: Numbers) -> str:
    if place.sort == "sensors":
        return f"the sensors are read {number(n['time'], 's')} late"
    if place.sort == "heads":
        return f"the heads are seen {number(n['time'], 's')} late"
    subject = pressure_of(place)
    return f"{subject.verb('acts', 'act')} {number(n['time'], 's')} late"


def _valve_dead_band(place: Place, n: Numbers) -> str:
    return f"{pressure_of(place).verb('follows', 'follow')} only beyond a band of {number(n['band'], 'Pa')}"


def _pressure_offset(place: Place, n: Numbers) -> str:
    # What acts is what is read and the offset.
    low = "too low" if n["offset"] > 0.0 else "too high"
    return f"{pressure_sensor_of(place).verb('reads', 'read')} {number(abs(n['offset']), 'Pa')} {low}"


def _pressure_gain(place: Place, n: Numbers) -> str:
    few = "too little" if n["gain"] > 0.0 else "too much"
    return f"{pressure_sensor_of(place).verb('reads', 'read')} {number(abs(n['gain']), '')} {few} above ambient"


def _leak(place: Place, n: Numbers) -> str:
    return f"{pressure_of(place).verb('leaks', 'leak')}: at 1 bar {number(n['drop'], 'Pa')} less arrive"


def _supply_sag(place: Place, n: Numbers) -> str:
    del place
    return (
        f"the supply sags while chambers fill: its way has {n['share']:.3g} times the resistance of one chamber's, "
        f"which fills within {number(n['tau'], 's')}"
    )


def _wire_backlash(place: Place, n: Numbers) -> str:
    return f"{length_sensor_of(place).verb('has', 'have')} {number(n['play'], 'm')} of play to either side"


def _marker_offset(place: Place, n: Numbers) -> str:
    away = math.sqrt(sum(n[axis] ** 2 for axis in "xyz"))
    return f"the marker on the head of {section_of(place).text} stands {number(away, 'm')} beside the head's origin"


def _length_offset(place: Place, n: Numbers) -> str:
    long = "too long" if n["offset"] > 0.0 else "too short"
    return f"{length_sensor_of(place).verb('reads', 'read')} {number(abs(n['offset']), 'm')} {long}"


def _length_gain(place: Place, n: Numbers) -> str:
    much = "too much" if n["gain"] > 0.0 else "too little"
    return f"{length_sensor_of(place).verb('reads', 'read')} {number(abs(n['gain']), '')} {much}"


def _work_conjugate(place: Place, n: Numbers) -> str:
    del place, n
    return "the arm follows the other of the two force models (force_model in the file)"


def _torsion(place: Place, n: Numbers) -> str:
    if "twist_per_length" in n:
        turn = number(n["twist_per_length"], "rad")
        return f"{section_of(place).verb('twists', 'twist')} by {turn} for each metre of stretch"
    return f"{section_of(place).verb('twists', 'twist')} under load, with {number(n['stiffness'], 'N m/rad')}"


def _taper(place: Place, n: Numbers) -> str:
    falls = "falls" if n["change"] > 0.0 else "grows"
    return f"the curvature of {section_of(place).text} {falls} along it by {number(abs(n['change']), '')}"


def _distributed_mass(place: Place, n: Numbers) -> str:
    return f"{number(n['share'], '')} of the mass of {section_of(place).text} lie along it instead of at its head"


_SENTENCES: dict[str, Callable[[Place, Numbers], str]] = {
    "creep": _creep,
    "hysteresis": _hysteresis,
    "friction": _friction,
    "quadratic_damping": _quadratic_damping,
    "bending_damping": _bending_damping,
    "bending_nonlinear": _bending_nonlinear,
    "bending_anisotropy": _bending_anisotropy,
    "section_coupling": _section_coupling,
    "effective_area": _effective_area,
    "pressure_stiffness": _pressure_stiffness,
    "weak_bellows": _weak_bellows,
    "payload": _payload,
    "preload": _preload,
    "base_tilt": _base_tilt,
    "tool_drag": _tool_drag,
    "contact": _contact,
    "pressure_lag": _pressure_lag,
    "delay": _delay,
    "valve_dead_band": _valve_dead_band,
    "pressure_offset": _pressure_offset,
    "pressure_gain": _pressure_gain,
    "leak": _leak,
    "supply_sag": _supply_sag,
    "wire_backlash": _wire_backlash,
    "marker_offset": _marker_offset,
    "length_offset": _length_offset,
    "length_gain": _length_gain,
    "work_conjugate": _work_conjugate,
    "torsion": _torsion,
    "taper": _taper,
    "distributed_mass": _distributed_mass,
}


def effect_in_words(kind: str, where: str, numbers: Numbers) -> str:
    """What an effect means for the arm, a sentence without its full stop.

    Args:
        kind: as in a parameter file.
        where: its place, as in a parameter file.
        numbers: its numbers in SI units.
    """
    place, sentence = Place.read(where), _SENTENCES.get(kind)
    if place is None or sentence is None:
        summary = EFFECT_KINDS[kind].summary if kind in EFFECT_KINDS else kind
        return f"{where}: {summary}"
    # What a table leaves out has the registry's default.
    known = {p.name: p.default for p in EFFECT_KINDS[kind].parameters if p.default is not None}
    return sentence(place, {**known, **numbers})


def headline(found: Diagnosis) -> str:
    """The verdict in one line: what is named, in words, with the class where it is one; or the verdict's own name.

    A class of what commands pass through comes before a gap that nothing explains: it is what was found.
    """
    sentences = [class_in_words(effect) for effect in found.missing] or [VERDICTS[found.verdict]]
    commands = commands_in_words(found)
    if leads(found):
        gap = VERDICTS[found.verdict]
        sentences, commands = commands, [f"beside it {gap[0].lower()}{gap[1:]}"]
    text = "; ".join([*sentences, *commands])
    return text[0].upper() + text[1:]


def leads(found: Diagnosis) -> bool:
    """Whether lag or damping, which the plain model holds, is all that was found: nothing explains what it leaves."""
    return found.verdict == "unexplained" and not found.missing and any(effect.slow for effect in found.of_commands)


def commands_in_words(found: Diagnosis) -> list[str]:
    """How commands reach the bellows: a sentence, none where nothing lies between that shows."""
    own = {effect.kind: effect for effect in found.of_commands}
    parts = []
    if lag := own.get("pressure_lag"):
        fill, vent = (lag.parameters[name].value for name in ("fill", "vent"))
        alike = math.isclose(fill, vent, rel_tol=_ALIKE)
        parts.append(
            f"a lag of {number(0.5 * (fill + vent), 's')}"
            if alike
            else f"a lag of {number(fill, 's')} when filling and {number(vent, 's')} when venting"
        )
    if late := own.get("delay"):
        parts.append(f"a dead time of {number(late.parameters['time'].value, 's')}")
    if lag is not None and lag.slow:
        return [f"{class_in_words(lag)}; as this fit divides it {' and '.join(parts)}"]
    return [f"commands reach the bellows through {' and '.join(parts)}"] if parts else []


def in_words(effect: Effect | Alternative) -> str:
    """:func:`effect_in_words` of an effect; by its name alone where its numbers are not known."""
    if not effect.parameters and any(p.default is None for p in EFFECT_KINDS[effect.kind].parameters):
        return f"{effect.kind} at {effect.where}"
    return effect_in_words(effect.kind, effect.where, {name: n.value for name, n in effect.parameters.items()})


def class_in_words(effect: Effect, most: int = 2) -> str:
    """An effect with what it cannot be told from, the likeliest ones: "either ... or ..."."""
    if effect.slow:
        return f"{slow_in_words(effect.slow)}{_slower_way(effect)}"
    if not effect.one_of:
        return in_words(effect)
    shown = [in_words(effect), *map(in_words, effect.one_of[:most])]
    more = len(effect.one_of) - most
    return f"either {', or '.join(shown)}" + (f", or {more} more" if more > 0 else "")


def _slower_way(effect: Effect) -> str:
    """Which way a lag is the slower one; empty where it is much the same both ways, or no lag was found."""
    if effect.kind != "pressure_lag":
        return ""
    fill, vent = (effect.parameters[name].value for name in ("fill", "vent"))
    way = "venting" if vent > fill else "filling"
    return f", slower when {way}" if max(fill, vent) > _UNLIKE * min(fill, vent) else ""


def slow_in_words(slow: Sequence[SlowSection]) -> str:
    """Lag of the pressures or damping, with the times that are told."""
    times = "; ".join(
        f"section {s.section}: together {number(s.across, 's')} across its axis, {number(s.along, 's')} along it"
        for s in slow
    )
    return f"lag of the pressures or damping ({times})"


def alike_in_words(effect: Effect) -> str:
    """What a named effect cannot be told from, by their names, and what would tell; empty where nothing is as good."""
    if effect.slow:
        return f"commands do not tell lag from damping on an arm that does not swing; what would: {effect.experiment}"
    if not effect.one_of:
        return ""
    names = [f"{other.kind} at {other.where}" for other in effect.one_of]
    text = f"these logs cannot tell it from {', '.join(names)}"
    return text + (f"; what would: {effect.experiment}" if effect.experiment else "")


def experiment_in_words(experiment: NextExperiment) -> str:
    """Whether pressures alone split the class, and which."""
    members = " or ".join(experiment.members)
    if not experiment.splits:
        return (
            f"no pressures that were tried would tell {members}: at the most {experiment.distance:.2g} standard "
            "deviations apart"
        )
    where = f": run {experiment.file} and diagnose with its log too" if experiment.file else ""
    return f"pressures would tell {members} ({experiment.distance:.3g} standard deviations apart){where}"


def errors_in_words(gap: Gap, *, named: bool) -> str:
    """Errors on the held-out logs in their order: before, after, noise."""
    after = f" -> {1e3 * gap.after:.3g} mm with it" if named else ""
    return (
        f"error on {_joined(gap.holdout)}, open loop: {1e3 * gap.before:.3g} mm{after}; "
        f"noise alone makes {1e3 * gap.noise:.3g} mm"
    )


def _joined(names: Sequence[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
