"""How often the 95 % intervals of a named effect hold, where the model has the arm's form and where it has not.

``python -m benches.effect_intervals --repeats 8``: one-section arms, their plain parameters 15 % off, three logs of
12 s and one held out, with one hidden effect of the catalogue. In half of the arms another, smaller effect acts beside
it, whose kind is not sought: then the model has not the arm's form. Counted are all numbers of effects that are named
in their place.
"""

from __future__ import annotations

import argparse
import warnings
from typing import Any

import numpy as np

import bha

from .identify_recovery.logs import Condition, arm_of, start_of, synthetic_log

#: Kind, place and numbers; every number is drawn within a fifth of its logarithm.
HIDDEN: tuple[tuple[str, str, dict[str, float]], ...] = (
    ("creep", "bellows 12", {"stiffness": 150.0, "tau": 0.6}),
    ("pressure_offset", "input p12", {"offset": 4000.0}),
    ("pressure_gain", "input p11", {"gain": 0.1}),
    ("pressure_lag", "all", {"fill": 0.06, "vent": 0.1}),
    ("hysteresis", "all", {"amplitude": 6.0, "yield": 0.004}),
    ("weak_bellows", "bellows 13", {"change": -0.15}),
)
#: Kinds that are sought, but that of what acts beside.
SOUGHT = (
    *(kind for kind, _, _ in HIDDEN),
    *("friction", "quadratic_damping", "effective_area", "bending_nonlinear", "length_offset", "length_gain", "delay"),
)
#: What acts beside it, unsought, where the form is another.
BESIDE: tuple[tuple[str, str, dict[str, float]], ...] = (
    ("creep", "all", {"stiffness": 60.0, "tau": 3.0}),
    ("quadratic_damping", "all", {"damping": 60.0}),
    ("friction", "all", {"coulomb_force": 1.5}),
)
FREE = ("section.1.mass", "section.1.damping", "section.1.rest_length", "section.1.bending_stiffness.1")


def drawn(effect: tuple[str, str, dict[str, float]], rng: np.random.Generator) -> dict[str, Any]:
    """The table of an effect, its numbers drawn."""
    kind, where, numbers = effect
    return {
        "kind": kind,
        "where": where,
        **{k: v * float(np.exp(0.2 * rng.standard_normal())) for k, v in numbers.items()},
    }


def case(seed: int, other_form: bool) -> tuple[str, bool, list[bool], list[float]]:
    """Kind; whether it was named in its place; of each number whether its interval holds, and its width over it."""
    rng = np.random.default_rng([seed, 31])
    hidden = drawn(HIDDEN[seed % len(HIDDEN)], rng)
    beside = drawn(BESIDE[(seed // len(HIDDEN)) % len(BESIDE)], rng)
    others = [beside] if other_form and beside["kind"] != hidden["kind"] else []
    plain = arm_of(1)
    arm = plain.with_effects([hidden, *others])
    condition = Condition("usual", duration=12.0)
    logs = [synthetic_log(arm, condition, 10 * seed + k) for k in range(4)]
    kinds = [kind for kind in SOUGHT if kind not in {e["kind"] for e in others}]
    found = bha.diagnose(start_of(plain, FREE, seed), logs[:3], logs[3:], kinds=kinds, threads=1)
    effect = next((e for e in found.effects if (e.kind, e.where) == (hidden["kind"], hidden["where"])), None)
    if effect is None:
        return hidden["kind"], False, [], []
    holds, widths = [], []
    for name, number in effect.parameters.items():
        if name in hidden and number.ci95 is not None:
            low, high = number.ci95
            holds.append(low <= hidden[name] <= high)
            widths.append((high - low) / abs(hidden[name]))
    return hidden["kind"], True, holds, widths


def main() -> None:
    """Read the command line, print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=8, help="arms of each kind and form")
    parser.add_argument("--first-seed", type=int, default=0)
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    print("| form | kind | named in its place | intervals that hold | width over value, median |")
    print("|---|---|---|---|---|")
    for other_form in (False, True):
        rows: dict[str, list[tuple[bool, list[bool], list[float]]]] = {}
        for seed in range(options.first_seed, options.first_seed + options.repeats * len(HIDDEN)):
            kind, *rest = case(seed, other_form)
            rows.setdefault(kind, []).append((rest[0], rest[1], rest[2]))
        rows["together"] = [row for kind in list(rows) for row in rows[kind]]
        for kind, cases in rows.items():
            holds = [h for _, own, _ in cases for h in own]
            widths = [w for _, _, own in cases for w in own]
            print(
                f"| {'another' if other_form else 'the same'} | {kind} | {sum(n for n, _, _ in cases)} of {len(cases)} "
                f"| {sum(holds)} of {len(holds)} | {np.median(widths) if widths else np.nan:.3g} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
