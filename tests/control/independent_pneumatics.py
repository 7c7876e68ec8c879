"""Full pneumatics a second time, in plain Python from the documents alone: no code in common with the core.

Sources: ISO 6358-1:2013 (flow), ``docs/guides/control.md`` (chamber, spool, pressure controller). One input; its
volume over time is given. Integrated by scipy to tight tolerances, or by explicit Runge-Kutta steps for comparison.
Units: SI, pressures absolute.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
GAS_CONSTANT = 287.05


class OneInput:
    """Mass, spool position and integral of the controller of one input."""

    def __init__(self, table: dict[str, Any], ambient: float, middle_volume: float) -> None:
        """``table``: the parameter file's; ``middle_volume``: bellows of the input at mid-range, m^3."""
        self.k = table
        self.ambient = ambient
        self.density = ambient / (GAS_CONSTANT * table["air_temperature"])
        self.middle_volume = middle_volume + table["dead_volume"]

    def flow(self, upstream: float, downstream: float) -> float:
        """ISO 6358 from one pressure to the other, kg/s; linear where the pressures are equal to a thousandth."""
        if upstream < downstream:
            return -self.flow(downstream, upstream)
        b, ratio = self.k["critical_pressure_ratio"], downstream / upstream
        psi = 1.0 if ratio <= b else np.sqrt(max(0.0, 1.0 - ((min(ratio, 0.999) - b) / (1.0 - b)) ** 2))
        if ratio > 0.999:
            psi *= (1.0 - ratio) / 0.001
        choked = self.k["sonic_conductance"] * 1.185 * np.sqrt(293.15 / self.k["air_temperature"])
        return float(choked * upstream * psi)

    def pressure(self, mass: float, volume: float) -> float:
        """p (V / m)^n = const through ambient air."""
        return float(self.ambient * (mass / (volume * self.density)) ** self.k["polytropic_exponent"])

    def mass(self, pressure: float, volume: float) -> float:
        """The same turned round."""
        return float(volume * self.density * (pressure / self.ambient) ** (1.0 / self.k["polytropic_exponent"]))

    def rates(self, state: Floats, volume: float, reference: float) -> Floats:
        """Derivatives of (mass, spool, integral) under a constant reference."""
        k, (mass, spool, integral) = self.k, state
        p = self.pressure(mass, volume)
        fill, vent = self.flow(k["supply_pressure"], p), min(0.0, self.flow(k["exhaust_pressure"], p))
        if "vacuum_pressure" in k:
            vent += self.flow(k["vacuum_pressure"], p)
        error = reference - p
        wanted = k["proportional_gain"] * error + integral
        wanted_flow = wanted * self.middle_volume * self.density / (k["polytropic_exponent"] * self.ambient)
        least = 1e-3 * k["sonic_conductance"] * 1.185 * np.sqrt(293.15 / k["air_temperature"]) * k["supply_pressure"]
        opening = wanted_flow / max(fill if wanted_flow > 0 else -vent, least)
        limited = float(np.clip(opening, -1.0, 1.0))
        band = k["spool_dead_band"]
        wanted_spool = limited * (1.0 - band) + band * float(np.clip(limited / 0.01, -1.0, 1.0))
        resting = abs(error) <= 20.0 or (opening - limited) * error > 0.0
        beyond = max(0.0, abs(spool) - band) / (1.0 - band)
        return np.array(
            [
                beyond * (fill if spool > 0 else vent),
                (wanted_spool - spool) / k["spool_time"],
                0.0 if resting else k["integral_gain"] * error,
            ]
        )

    def pressures(self, times: Floats, volume: Callable[[float], float], references: Floats, start: float) -> Floats:
        """Pressures at ``times``, where the reference is held between them, by LSODA."""
        from scipy.integrate import solve_ivp  # noqa: PLC0415  (only where it is asked for)

        state = np.array([self.mass(start, volume(times[0])), 0.0, 0.0])
        found = [start]
        for t0, t1, reference in zip(times, times[1:], references, strict=False):
            run = solve_ivp(
                lambda t, y, r=reference: self.rates(y, volume(t), r), (t0, t1), state, method="LSODA",
                rtol=1e-8, atol=[1e-12, 1e-8, 1e-3],
            )  # fmt: skip
            state = run.y[:, -1]
            found.append(self.pressure(state[0], volume(t1)))
        return np.array(found)

    def explicit_pressures(
        self, times: Floats, volume: Callable[[float], float], references: Floats, start: float, steps: int = 1
    ) -> Floats:
        """The same by ``steps`` explicit Runge-Kutta steps of fourth order between two times; NaN once it fails."""
        state = np.array([self.mass(start, volume(times[0])), 0.0, 0.0])
        found = [start]
        for t0, t1, reference in zip(times, times[1:], references, strict=False):
            h = (t1 - t0) / steps
            for j in range(steps):
                t = t0 + j * h
                with np.errstate(all="ignore"):
                    k1 = self.rates(state, volume(t), reference)
                    k2 = self.rates(state + 0.5 * h * k1, volume(t + 0.5 * h), reference)
                    k3 = self.rates(state + 0.5 * h * k2, volume(t + 0.5 * h), reference)
                    k4 = self.rates(state + h * k3, volume(t + h), reference)
                    state = state + h / 6 * (k1 + 2 * (k2 + k3) + k4)
                if not np.all(np.isfinite(state)) or state[0] <= 0:
                    return np.pad(np.array(found), (0, len(times) - len(found)), constant_values=np.nan)
            found.append(self.pressure(state[0], volume(t1)))
        return np.array(found)
