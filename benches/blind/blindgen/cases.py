"""One case from a specification: the arm, its hidden effects, five logs, the product's parameter file, and the
sealed answer.
"""

import json
import shutil
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .armfile import ArmFile, build_plant, format_arm, parse_arm, perturb_arm, read_arm
from .calibrate import COARSE, LOG_GAP_TIME, GapMeter, calibrate, scaled, shorten
from .effects import EFFECTS, HiddenEffect, draw_effect, install
from .excitation import DURATION, LOG_NAMES, make_excitation
from .integrate import DivergedError
from .plant import P_HARDENING, P_STIFFNESS
from .sealing import seal, write_whole
from .sensors import NOISE, MeasuredLog, measure, write_log
from .truth import CleanLog, Excitation, Truth, plain_truth, replay, simulate_log

Array = NDArray[np.float64]

FILES = {"steps": "train_steps.csv", "multisine": "train_multisine.csv", "release": "train_release.csv"}
CALIBRATION_TIME = {"steps": 9.0, "multisine": 7.0, "release": 7.0}
DISTRIBUTED = 0.06
# Exponential hardening of the springs in some null cases: a cubic refit has to absorb it.
HARDENING_SHARE, HARDENING_LENGTH = 0.04, 0.06
FLOOR_COARSE = 4


@dataclass(frozen=True)
class WantedEffect:
    """An effect to be drawn: place (None: drawn), wanted gap (None: ``strength`` times the typical amplitude), and
    a final scale.
    """

    kind: str
    where: str | None = None
    gap: float | None = None
    strength: float = 1.0
    scale: float = 1.0


@dataclass(frozen=True)
class CaseSpec:
    """What a case is to contain; the seed decides the rest."""

    case: str
    seed: int
    group: str  # single, pair, null, unknown, clutter, unknown_clutter
    subset: str  # tune or report
    effects: tuple[WantedEffect, ...] = ()
    noise: str = "standard"
    distributed: float = 0.0
    hardening: bool = False
    coloured: bool = False
    heads: bool = False
    force_model: str = "end_force"


def default_arm() -> ArmFile:
    """The nominal arm that comes with the generator."""
    return read_arm(Path(__file__).with_name("nominal.toml"))


def _make_excitations(
    arm: ArmFile, rng: np.random.Generator, durations: Mapping[str, float]
) -> tuple[dict[str, Excitation], dict[str, dict[str, object]]]:
    made, notes = {}, {}
    for name in LOG_NAMES:
        made[name], notes[name] = make_excitation(arm, rng, name, durations.get(name))
    return made, notes


def _build(
    spec: CaseSpec, arm: ArmFile, meter: GapMeter, rng: np.random.Generator, heads: Array
) -> tuple[Truth, list[tuple[HiddenEffect, float | None]]]:
    """Draw, calibrate and install the effects one by one; with the gap each was calibrated to on its own."""
    truth = meter.plain
    made: list[tuple[HiddenEffect, float | None]] = []
    for wanted in spec.effects:
        effect = draw_effect(wanted.kind, wanted.where, rng, heads)
        gap: float | None = None
        if wanted.gap is None:
            low, high = EFFECTS[wanted.kind].limits
            effect = replace(effect, amplitude=float(np.clip(effect.amplitude * wanted.strength, low, high)))
        else:
            effect, gap = calibrate(meter, effect, wanted.gap), wanted.gap
        if wanted.scale != 1.0 and EFFECTS[wanted.kind].limits[0] != EFFECTS[wanted.kind].limits[1]:
            effect = replace(effect, amplitude=wanted.scale * effect.amplitude)
            gap = None if gap is None else wanted.scale * gap
        truth, filled = install(truth, effect)
        made.append((filled, gap))
    return truth, made


def _rms(a: Array) -> float:
    return float(np.sqrt(np.mean(np.square(a))))


def _describe(spec: CaseSpec, effect: HiddenEffect, gap: float | None, dominant: bool) -> dict[str, Any]:
    kind = EFFECTS[effect.kind]
    return {
        "kind": effect.kind,
        "where": effect.where,
        "known": kind.known,
        "dominant": dominant,
        "amplitude": effect.amplitude,
        "amplitude_unit": kind.unit,
        "parameters": {**effect.shape, **effect.parameters},
        "comparable": {key: effect.parameters[key] for key in kind.comparable},
        "gap_wanted_alone": gap,
    }


def build_case(
    spec: CaseSpec, base: ArmFile, durations: Mapping[str, float] | None = None, *, estimate_gap: bool = True
) -> tuple[dict[str, MeasuredLog], ArmFile, dict[str, Any]]:
    """Logs, the product's parameter file, and the answer. Raises DivergedError when the arm cannot carry the
    wanted effects.
    """
    root = np.random.SeedSequence([spec.seed, 20150612])
    arm_rng, input_rng, effect_rng, noise_rng = (np.random.default_rng(s) for s in root.spawn(4))
    true_arm = replace(perturb_arm(base, arm_rng, 0.0, 0.10), force_model=spec.force_model)
    product_arm = perturb_arm(true_arm, arm_rng)
    product_arm = replace(product_arm, name="arm")
    plant = build_plant(true_arm, distributed=spec.distributed)
    if spec.hardening:
        plant.sections[:, P_HARDENING] = HARDENING_SHARE * plant.sections[:, P_STIFFNESS]
        plant.sections[:, P_HARDENING + 1] = HARDENING_LENGTH
    noise = NOISE[spec.noise]
    heads_measured = spec.heads or any(EFFECTS[e.kind].needs_heads for e in spec.effects)
    excitations, notes = _make_excitations(true_arm, input_rng, durations or {})

    # The meter's plain model is the one a product fits: lumped masses, polynomial springs.
    lumped = plain_truth(build_plant(true_arm), np.array(true_arm.gravity))
    short = [shorten(excitations[name], CALIBRATION_TIME[name]) for name in FILES]
    meter = GapMeter(lumped, short, noise, heads=heads_measured)
    preview = simulate_log(lumped, short[0])
    heads = preview.heads.reshape(preview.heads.shape[0], -1, 3)
    truth, made = _build(spec, true_arm, meter, effect_rng, heads)
    truth.plant = plant._replace(work_conjugate=truth.plant.work_conjugate)

    logs: dict[str, MeasuredLog] = {}
    clean: dict[str, CleanLog] = {}
    floor: dict[str, float] = {}
    for index, name in enumerate(LOG_NAMES):
        clean[name] = simulate_log(truth, excitations[name], index * LOG_GAP_TIME)
        log = measure(clean[name], noise, noise_rng, heads=heads_measured, coloured=spec.coloured)
        logs[name] = log
        force = np.zeros_like(clean[name].force) if log.force is None else log.force
        coarse = excitations[name].coarse(FLOOR_COARSE)
        lengths, positions = replay(truth, coarse, log.pressure, force, clean[name].start, index * LOG_GAP_TIME)
        best = [lengths - log.lengths] if log.heads is None else [lengths - log.lengths, positions - log.heads]
        floor[name] = _rms(np.concatenate(best, axis=1))

    gap: dict[str, Any] = {"train": None, "holdout": None}
    if estimate_gap:
        gap["train"], relative = meter.gap(truth)
        held = [excitations[name].coarse(COARSE) for name in ("holdout_1", "holdout_2")]
        gap["refit"] = relative.tolist()
        try:
            before = meter.outputs(scaled(meter.plain, relative), held)
            gap["holdout"] = _rms(meter.outputs(truth, held) - before)
        except DivergedError:
            gap["holdout"] = None
    answer = {
        "case": spec.case,
        "spec": asdict(spec),
        "effects": [_describe(spec, e, g, k == 0) for k, (e, g) in enumerate(made)],
        "noise": asdict(noise),
        "noise_floor_rms": floor,
        "gap_over_noise": gap,
        "starts": notes,
        "lengths_range": [
            float(min(c.lengths.min() for c in clean.values())),
            float(max(c.lengths.max() for c in clean.values())),
        ],
        "true_arm": format_arm(true_arm),
        "truth_force_model": "work_conjugate" if truth.plant.work_conjugate else "end_force",
    }
    return logs, product_arm, answer


def write_case(
    spec: CaseSpec,
    out: Path,
    sealed: Path,
    commitments: Path,
    base: ArmFile | None = None,
    durations: Mapping[str, float] | None = None,
    *,
    estimate_gap: bool = True,
) -> dict[str, Any]:
    """Build a case, publish its commitment, seal its answer, then write ``arm.toml`` and the five logs to ``out``.

    The folder ``out`` appears whole or not at all.
    """
    logs, arm, answer = build_case(spec, base or default_arm(), durations, estimate_gap=estimate_gap)
    seal(answer, spec.case, sealed, commitments)
    temporary = out.with_name(out.name + ".part")
    shutil.rmtree(temporary, ignore_errors=True)
    temporary.mkdir(parents=True)
    write_whole(temporary / "arm.toml", format_arm(arm))
    for name, log in logs.items():
        write_log(log, temporary / FILES.get(name, f"{name}.csv"))
    shutil.rmtree(out, ignore_errors=True)
    temporary.rename(out)
    return answer


def make_case(
    seed: int,
    kind: str,
    where: str | None,
    strength: float,
    noise: str,
    out_dir: str | Path,
    *,
    sealed_dir: str | Path | None = None,
    target_gap: float | None = None,
    duration_factor: float = 1.0,
    force_model: str = "end_force",
    heads: bool = False,
    estimate_gap: bool = False,
    arm: str | Path | None = None,
) -> dict[str, Any]:
    """Write a single-effect case for a demonstration and return its answer.

    Parameters
    ----------
    seed, kind, where, strength, noise
        ``kind`` as in the catalogue, or ``"null"``; ``where`` None draws the place; ``strength`` multiplies the
        typical amplitude of the kind (1 gives a gap of some 5 to 30 times the standard noise), unless ``target_gap``
        asks for a calibration, which takes some 10 s more. ``noise`` is ``"standard"`` or ``"hard"``.
    out_dir, sealed_dir
        Logs and ``arm.toml`` go to ``out_dir``; the answer and its commitment to ``sealed_dir`` (default: a sibling
        ``<out_dir>.sealed``).
    duration_factor
        Scales the five logs; below 0.4 the steps become too few to tell much.

    Raises
    ------
    ValueError
        Unknown kind or a place the kind cannot have.
    DivergedError
        The arm cannot carry an effect of this strength.
    """
    if not 0.1 <= duration_factor <= 10.0:
        raise ValueError(f"duration_factor must be between 0.1 and 10, got {duration_factor}")
    if noise not in NOISE:
        raise ValueError(f"unknown noise set {noise!r}; allowed: {', '.join(NOISE)}")
    out = Path(out_dir)
    if kind != "null" and kind not in EFFECTS:
        raise ValueError(f"unknown effect kind {kind!r}; known are null, {', '.join(sorted(EFFECTS))}")
    effects = () if kind == "null" else (WantedEffect(kind, where, target_gap, strength),)
    group = "null" if not effects else ("single" if EFFECTS[kind].known else "unknown")
    spec = CaseSpec(out.name, seed, group, "demo", effects, noise=noise, heads=heads, force_model=force_model)
    durations = {name: round(duration_factor * value, 2) for name, value in DURATION.items()}
    hidden = Path(sealed_dir) if sealed_dir is not None else out.with_name(out.name + ".sealed")
    base = default_arm() if arm is None else parse_arm(Path(arm).read_text(encoding="utf-8"))
    return write_case(spec, out, hidden, hidden / "commitments", base, durations, estimate_gap=estimate_gap)


def read_specs(path: Path) -> list[CaseSpec]:
    """Read a plan written by :func:`write_specs`."""
    rows = json.loads(path.read_text(encoding="utf-8"))
    return [CaseSpec(**{**row, "effects": tuple(WantedEffect(**e) for e in row["effects"])}) for row in rows]


def write_specs(specs: list[CaseSpec], path: Path) -> None:
    """Write a plan; it names the hidden effects, so it belongs to the sealed side."""
    write_whole(path, json.dumps([asdict(s) for s in specs], indent=1) + "\n")
