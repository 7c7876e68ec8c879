"""The case plan: which effects, where, how strong, how noisy; some seeds to tune on, others to report on.

The report set is drawn from other seeds than the tuning set and is not to be looked at while rules are still being
changed. Order and names of the cases tell nothing: they are shuffled, and named by their number.
"""

from typing import Any

import numpy as np

from .cases import DISTRIBUTED, CaseSpec, WantedEffect
from .effects import EFFECTS
from .lookalikes import look_alike

# Gap of the refitted plain model on the training logs over the noise; on held-out logs it is about one to three times
# as large.
GAPS = {
    ("standard", "mild"): (3.0, 6.0),
    ("standard", "strong"): (8.0, 25.0),
    ("hard", "mild"): (3.0, 4.0),
    ("hard", "strong"): (4.0, 8.0),
}
# Singles of one kind in a set, in this order: noise and strength.
ROUNDS = (
    ("standard", "strong"),
    ("standard", "mild"),
    ("hard", "strong"),
    ("standard", "strong"),
    ("standard", "mild"),
)
COUNTS = {
    "tune": {"rounds": 2, "pair": 12, "null": 12, "unknown": 9, "clutter": 8, "unknown_clutter": 4},
    "report": {"rounds": 4, "pair": 36, "null": 100, "unknown": 30, "clutter": 24, "unknown_clutter": 12},
}
SEED_BASE = {"tune": 10_000_000, "report": 20_000_000}
CLUTTER_SCALE, DOMINANT_SCALE = 1.0 / 12.0, 0.5


def _gap(rng: np.random.Generator, noise: str, strength: str) -> float:
    low, high = GAPS[noise, strength]
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _known(heads: bool) -> list[str]:
    """Kinds that mix with others; those that need head positions only come alone."""
    return [k for k, kind in EFFECTS.items() if kind.known and (heads or not kind.needs_heads)]


def _distinct(rng: np.random.Generator, count: int, first: str | None = None) -> list[str]:
    """Kinds no two of which look alike."""
    names: list[str] = [first] if first else []
    pool = [k for k in _known(heads=False) if k != "work_conjugate" or not first]
    while len(names) < count:
        name = pool[int(rng.integers(len(pool)))]
        if name not in names and not any(look_alike(name, other) for other in names):
            names.append(name)
    return names


def _add(
    drafts: list[dict[str, Any]],
    rng: np.random.Generator,
    group: str,
    effects: tuple[WantedEffect, ...],
    noise: str,
    **extra: object,
) -> None:
    """One more case; one in five measures head positions, one in three is built on the other force model."""
    drafts.append(
        {
            "group": group,
            "effects": effects,
            "noise": noise,
            "heads": bool(rng.random() < 0.2),
            "force_model": "end_force" if rng.random() < 2 / 3 else "work_conjugate",
            **extra,
        }
    )


def build_plan(seed: int, subsets: tuple[str, ...] = ("tune", "report")) -> list[CaseSpec]:
    """All cases of the plan, shuffled within each subset."""
    plan: list[CaseSpec] = []
    for subset in subsets:
        rng = np.random.default_rng([seed, SEED_BASE[subset]])
        counts = COUNTS[subset]
        drafts: list[dict[str, Any]] = []
        for name in _known(heads=True):
            for noise, strength in ROUNDS[: counts["rounds"]]:
                _add(drafts, rng, "single", (WantedEffect(name, gap=_gap(rng, noise, strength)),), noise)
        for _ in range(counts["pair"]):
            wanted = tuple(
                WantedEffect(k, gap=float(np.exp(rng.uniform(np.log(5), np.log(20))))) for k in _distinct(rng, 2)
            )
            _add(drafts, rng, "pair", wanted, "standard")
        for k in range(counts["null"]):
            noise = "hard" if k % 5 == 4 else "standard"
            _add(
                drafts,
                rng,
                "null",
                (),
                noise,
                distributed=DISTRIBUTED if k % 2 else 0.0,
                hardening=k % 10 == 8,
                coloured=k % 7 == 6,
            )
        outside = [k for k, kind in EFFECTS.items() if not kind.known]
        for k in range(counts["unknown"]):
            strength = "mild" if k % 3 == 2 else "strong"
            _add(
                drafts, rng, "unknown", (WantedEffect(outside[k % 3], gap=_gap(rng, "standard", strength)),), "standard"
            )
        for group in ("clutter", "unknown_clutter"):
            for k in range(counts[group]):
                first = outside[k % 3] if group == "unknown_clutter" else None
                names = _distinct(rng, 5, first)
                wanted = tuple(
                    WantedEffect(
                        name,
                        gap=float(np.exp(rng.uniform(np.log(12), np.log(30)))),
                        scale=DOMINANT_SCALE if m == 0 else CLUTTER_SCALE,
                    )
                    for m, name in enumerate(names)
                )
                _add(drafts, rng, group, wanted, "standard", distributed=DISTRIBUTED, coloured=True)
        order = rng.permutation(len(drafts))
        for number, k in enumerate(order):
            name = f"{subset}_{number:04d}"
            plan.append(
                CaseSpec(case=name, seed=SEED_BASE[subset] + 1000 * seed + number, subset=subset, **drafts[int(k)])
            )
    return plan
