"""Call an identification on folders that the plants made, and hold what comes back against the truth.

    python -m benches.plants.judge out/plants/mujoco out/plants/mujoco_commands --product 'bha identify'

Printed, one line a folder: converged or not; over the truth, where the plant has such a truth, the mass, A/k, m g/k and
k_bend/k, how far the tip goes across for a pascal with its weight and without, the common times of lag and damping, and
the lag where the fit says that it is told; RMS error of the held-out logs across the arm (each of x and y) and along
it, mm; seconds. The command gets ``ARM LOG... --holdout LOG... --out FILE --json``; for logs of commands alone
``--pressures commanded`` too, or copies in which the commands are called pressures (``--rename-commands``) where there
is no such option.
"""

from __future__ import annotations

import argparse
import json
import math
import re
import shlex
import subprocess
import tempfile
import time
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from bha import Arm

GRAVITY = 9.81
#: Step of a pressure for a static response, Pa.
_PUSH = 100.0


@dataclass(frozen=True)
class Judged:
    """What an identification of one folder came to; ratios are over the truth, errors in m."""

    converged: bool | None
    ratios: dict[str, float]
    lateral: float
    axial: float
    seconds: float
    problem: str = ""


def ratios_of(section: dict[str, Any], truth: dict[str, Any]) -> dict[str, float]:
    """Numbers that logs can tell of one section with parallel chambers, over the true ones."""
    chambers = len(section.get("bellows", ())) or 3
    # An axial stiffness stands beside all chambers together.
    k = float(section["stiffness"][0]) + sum(map(float, section.get("axial_stiffness", [0.0])[:1])) / chambers
    found = {
        "mass": float(section["mass"]),
        "area_over_stiffness": float(section["terminal_area"]) / k,
        "weight_over_stiffness": float(section["mass"]) * GRAVITY / k,
        "bending_over_stiffness": float(section["bending_stiffness"][0]) / k,
    }
    true = {"mass": truth["arm"]["mass"], **{key: truth[key] for key in found if key in truth}}
    return {key: found[key] / value for key, value in true.items() if value}


def responses_of(arm: Arm, truth: dict[str, Any]) -> dict[str, float]:
    """How far the tip goes across for a pascal in one chamber at half the greatest pressure, over the truth.

    Once as it stands, and once without weight: a file that is right in both is right in another mounting.
    """
    found = {}
    for key, model in (("across_per_pascal", arm), ("weightless_per_pascal", arm.with_changes(gravity=(0.0,) * 3))):
        middle = np.full(len(arm.inputs), arm.parameters.ambient_pressure + 0.5 * truth["arm"]["highest_pressure"])
        first = middle + _PUSH * (np.arange(len(middle)) == 0)
        tips = [model.forward_kinematics(model.static_lengths(p))[0][-1] for p in (middle, first)]
        found[key] = math.hypot(*(tips[1] - tips[0])[:2]) / _PUSH / truth[key]
    return found


def times_of(times: list[dict[str, Any]], truth: dict[str, Any]) -> dict[str, float]:
    """Common times of lag and damping over the truth, and the lag alone where the fit says that it is told."""
    if not times or "time_across" not in truth:
        return {}
    found = {f"time_{way}": times[0][way] / (truth["lag"] + truth[f"time_{way}"]) for way in ("across", "along")}
    return found | ({"lag": times[0]["lag"] / truth["lag"]} if times[0].get("told") else {})


def errors_of(held_out: list[dict[str, Any]]) -> tuple[float, float]:
    """RMS over all held-out logs across the arm (each of x and y) and along it."""
    across, along = [], []
    for held in held_out:
        for channel, value in zip(held["channels"], held["rms_after"], strict=True):
            target = along if channel[0] == "z" else across
            target.append(math.inf if value is None else float(value) ** 2)
    return tuple(math.sqrt(sum(x) / len(x)) if x else math.nan for x in (across, along))  # type: ignore[return-value]


def _renamed(logs: list[Path], folder: Path) -> list[Path]:
    """Copies in which commanded pressures are called measured ones."""
    copies = []
    for path in logs:
        head, _, body = path.read_text(encoding="utf-8").partition("\n")
        copy = folder / path.name
        copy.write_text(re.sub(r"\bpc(?=\d)", "p", head) + "\n" + body, encoding="utf-8")
        copies.append(copy)
    return copies


def judge(folder: Path, product: str, *, rename: bool, timeout: float) -> Judged:
    """Call the product on one folder."""
    truth = json.loads((folder.with_name(folder.name + ".sealed") / "truth.json").read_text(encoding="utf-8"))
    train, held = (sorted(folder.glob(f"{sort}_*.csv")) for sort in ("train", "holdout"))
    with tempfile.TemporaryDirectory() as temporary:
        option: list[str] = []
        if truth["setup"]["commanded"]:
            if rename:
                train, held = _renamed(train, Path(temporary)), _renamed(held, Path(temporary))
            else:
                option = ["--pressures", "commanded"]
        out = Path(temporary) / "identified.toml"
        words = [*shlex.split(product), str(folder / "arm.toml"), *map(str, train)]
        words += [x for path in held for x in ("--holdout", str(path))] + [*option, "--out", str(out), "--json"]
        begin = time.perf_counter()
        try:
            done = subprocess.run(words, capture_output=True, text=True, timeout=timeout, check=False)
            data = json.loads(done.stdout)
            section = tomllib.loads(out.read_text(encoding="utf-8"))["section"][0]
            ratios = ratios_of(section, truth)
            if "across_per_pascal" in truth:
                ratios |= responses_of(Arm.load(out), truth)
        except (OSError, ValueError, subprocess.TimeoutExpired) as error:
            said = [] if isinstance(error, subprocess.TimeoutExpired) else done.stderr.strip().splitlines()
            text = said[-1] if said else str(error)
            return Judged(None, {}, math.nan, math.nan, time.perf_counter() - begin, text[:200])
        lateral, axial = errors_of(data["held_out"])
        seconds = time.perf_counter() - begin
        ratios |= times_of(data.get("common_times", []), truth)
        return Judged(bool(data["converged"]), ratios, lateral, axial, seconds)


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", nargs="+", type=Path)
    parser.add_argument("--product", default="bha identify")
    parser.add_argument("--rename-commands", action="store_true")
    parser.add_argument("--timeout", type=float, default=900.0, help="of one call [s]")
    arguments = parser.parse_args()
    for folder in arguments.folders:
        found = judge(folder, arguments.product, rename=arguments.rename_commands, timeout=arguments.timeout)
        state = {None: f"failed ({found.problem})", True: "converged", False: "not converged"}[found.converged]
        numbers = ", ".join(f"{key} {value:.3g}" for key, value in found.ratios.items())
        errors = f"lateral {1e3 * found.lateral:.3g} mm, axial {1e3 * found.axial:.3g} mm"
        print(f"{folder.name}: {state}; over the truth: {numbers}; {errors}; {found.seconds:.0f} s", flush=True)


if __name__ == "__main__":
    main()
