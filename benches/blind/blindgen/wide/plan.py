"""The plan of the wide world: what each case is made of, balanced over the set; some seeds to tune on, others to
report.

Every property runs through its values in shuffled order, so that a small set too has each of them in its due share. The
report set is drawn from other seeds than the tuning set and is not to be looked at while rules are still being changed.
Names of cases are numbers in a shuffled order and tell nothing.
"""

import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np

from ..lookalikes import look_alike
from ..sealing import write_whole
from . import faults, hidden
from .arms import MOUNTINGS, REGIMES
from .datasheets import QUALITIES
from .disturbances import SORTS as DISTURBANCES
from .pressures import SORTS as PRESSURES
from .programmes import PROGRAMMES
from .sensors import RATES
from .sensors import SORTS as SENSORS

Item = TypeVar("Item")

# ``quick`` is for tuning as well: its logs add up to at most a minute.
SUBSETS = {"tune": 30_000_000, "report": 40_000_000, "quick": 50_000_000}
SIZE = {"tune": 300, "report": 300, "quick": 40}
SHORTEST, QUICK = 45.0, 60.0
# Shares of 40 cases.
GROUPS = {
    "null": 10,
    "single": 11,
    "pair": 4,
    "clutter": 4,
    "refused": 4,
    "setup": 5,
    "setup_effect": 2,
}
# Gap of the refitted plain model over the floor of the true one.
STRENGTHS = {"weak": (0.7, 1.5), "medium": (1.5, 4.0), "strong": (4.0, 15.0)}
CLUTTER = 1.0 / 12.0
LONGEST = 120.0
# One case in ten is longer than that.
LONG = (130.0, 240.0)


@dataclass(frozen=True)
class WideSpec:
    """What a case is made of; the seed decides the rest."""

    case: str
    seed: int
    subset: str
    group: str
    kinds: tuple[str, ...]
    strengths: tuple[float, ...]  # wanted gap over the floor, one a kind
    fault: str
    sections: int
    layout: tuple[int, bool, bool]  # bellows a section, inputs shared, turned
    regime: str
    mounting: str
    quality: str
    sensors: str
    rate: str
    noise: float
    coloured: bool
    pressures: str
    disturbance: str
    programme: str
    logs: int
    total: float


class Balanced:
    """Draws through decks of values, each deck in shuffled order."""

    def __init__(self, rng: np.random.Generator) -> None:
        """Begin with empty decks."""
        self.rng = rng
        self.decks: dict[str, list[int]] = {}

    def draw(self, name: str, values: Sequence[Item], shares: Sequence[int] | None = None) -> Item:
        """The next value of a deck that holds each value as often as its share says."""
        deck = self.decks.setdefault(name, [])
        if not deck:
            full = [k for k, count in enumerate(shares or [1] * len(values)) for _ in range(count)]
            deck += [int(full[i]) for i in self.rng.permutation(len(full))]
        return values[deck.pop()]


def _kinds(
    rng: np.random.Generator, used: Counter[str], count: int, refused: bool, possible: Sequence[str]
) -> tuple[str, ...]:
    """Kinds that were used least so far, no two of which look alike."""
    chosen: list[str] = []
    pool = [k for k in possible if hidden.KINDS[k].refused == refused]
    while len(chosen) < count:
        open_ = [k for k in pool if k not in chosen and not any(look_alike(k, c) for c in chosen)]
        if not open_:
            break
        fewest = min(used[k] for k in open_)
        name = str(rng.choice([k for k in open_ if used[k] == fewest]))
        used[name] += 1
        chosen.append(name)
    return tuple(chosen)


def _possible(draft: dict[str, object]) -> list[str]:
    """Kinds that such a case can show."""
    paper = draft["mounting"] == "hanging" and draft["regime"] == "ringing"
    sections, sensors = int(str(draft["sections"])), str(draft["sensors"])
    kinds = [k for k, kind in hidden.KINDS.items() if hidden.feasible(kind, sections, sensors, paper)]
    # Under commands alone the lag and the dead time of the valves are there anyway, and no effect.
    return [k for k in kinds if draft["pressures"] != "commanded" or k not in ("pressure_lag", "delay")]


def build_plan(seed: int, subset: str, size: int | None = None) -> list[WideSpec]:
    """The cases of one subset; the first ones of a long plan are a plan of their own."""
    rng = np.random.default_rng([seed, SUBSETS[subset]])
    deck = Balanced(rng)
    used: Counter[str] = Counter()
    fault_uses: Counter[str] = Counter()
    plan = []
    for number in range(SIZE[subset] if size is None else size):
        draft: dict[str, object] = {
            "sections": deck.draw("sections", (1, 2, 3), (3, 4, 3)),
            "regime": deck.draw("regime", REGIMES),
            "mounting": deck.draw("mounting", MOUNTINGS, (5, 3, 2)),
            "quality": deck.draw("quality", QUALITIES),
            "sensors": deck.draw("sensors", SENSORS, (3, 2, 3, 2)),
            "coloured": deck.draw("coloured", (True, False), (1, 2)),
            "pressures": deck.draw("pressures", PRESSURES, (3, 2)),
            "disturbance": deck.draw("disturbance", DISTURBANCES, (4, 1, 2, 1)),
            "programme": deck.draw("programme", PROGRAMMES, (5, 2, 1, 2)),
        }
        count = deck.draw("bellows", (3, 4, 5), (5, 3, 2))
        turned = deck.draw("turned", (True, False))
        draft["layout"] = (count, bool(rng.random() < 0.5), turned)
        rate = deck.draw("rate", tuple(RATES), (2, 1, 2, 2, 2, 1))
        long_ = deck.draw("long", (True, False), (1, 9))
        longest = QUICK if subset == "quick" else LONGEST
        total = float(round(rng.uniform(*LONG) if long_ and subset != "quick" else rng.uniform(SHORTEST, longest)))
        if rate == "1000":
            total = SHORTEST
        logs = int(min(deck.draw("logs", (2, 3, 4, 5)), total // 20))
        draft |= {
            "rate": rate,
            "total": total,
            "logs": logs,
            "noise": float(np.exp(rng.uniform(*np.log([5e-5, 1e-3])))),
        }
        group = deck.draw("group", tuple(GROUPS), tuple(GROUPS.values()))
        amount = {"single": 1, "pair": 2, "clutter": 5, "refused": 1, "setup_effect": 1}.get(group, 0)
        kinds = _kinds(rng, used, amount, group == "refused", _possible(draft))
        strengths = []
        for k in range(len(kinds)):
            low, high = STRENGTHS[deck.draw("strength", tuple(STRENGTHS))]
            wanted = float(np.exp(rng.uniform(np.log(low), np.log(high))))
            strengths.append(max(wanted, 1.5) if group == "clutter" and k == 0 else wanted)
        if group == "clutter":
            strengths = [strengths[0], *(CLUTTER * strengths[0] for _ in strengths[1:])]
        fault = ""
        if group.startswith("setup"):
            sections, sensors = int(str(draft["sections"])), str(draft["sensors"])
            possible = [k for k in faults.KINDS if faults.feasible(k, sections, sensors)]
            fewest = min(fault_uses[k] for k in possible)
            fault = str(rng.choice([k for k in possible if fault_uses[k] == fewest]))
            fault_uses[fault] += 1
        plan.append(
            WideSpec(
                case=f"{subset}_{number:04d}",
                seed=SUBSETS[subset] + 1000 * seed + number,
                subset=subset,
                group=group,
                kinds=kinds,
                strengths=tuple(strengths),
                fault=fault,
                **draft,  # type: ignore[arg-type]
            )
        )
    return plan


def write_plan(plan: Sequence[WideSpec], path: Path) -> None:
    """Write a plan; it names what is hidden, so it belongs to the sealed side."""
    write_whole(path, json.dumps([asdict(s) for s in plan], indent=1) + "\n")


def read_plan(path: Path) -> list[WideSpec]:
    """Read a plan written by :func:`write_plan`."""
    rows = json.loads(path.read_text(encoding="utf-8"))
    return [WideSpec(**{k: tuple(v) if isinstance(v, list) else v for k, v in row.items()}) for row in rows]
