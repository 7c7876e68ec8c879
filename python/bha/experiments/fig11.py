"""Fig. 11: translational energy against the upper bound (57) of the rotational energy, during the swing of Fig. 10."""

from __future__ import annotations

import numpy as np

from bha.experiments.figures import energy_figure
from bha.experiments.laboratory import Laboratory
from bha.experiments.measured import swing_from_release, with_sections
from bha.experiments.outcome import Claim, Outcome
from bha.parameters import SectionParameters
from bha.support.extras import import_extra

#: Window of the differentiating filter, samples; a fifth of the swing's period.
WINDOW = 101


def run(lab: Laboratory) -> Outcome:
    """Energies from measured lengths and their filtered derivatives."""
    signal = import_extra("scipy.signal", extra="identify", purpose="Differentiating measured lengths")
    release, log = lab.swing
    _, free = swing_from_release(lab.identified, log, release)
    time = free.time - free.time[0]
    dt = float(time[1])
    # The release is a corner: the filter must not look across it, so it fits its polynomial to what follows.
    lengths = signal.savgol_filter(free.lengths, WINDOW, 3, axis=0)
    velocities = signal.savgol_filter(free.lengths, WINDOW, 3, deriv=1, delta=dt, axis=0)
    hollow = [{"inertia": upper_bound(s)} for s in lab.design.parameters.sections]
    bound = with_sections(lab.identified, hollow, "upper bound")
    energies = [bound.energy(q, qd) for q, qd in zip(lengths, velocities, strict=True)]
    translational = np.array([e.translational for e in energies])
    rotational = np.array([e.rotational for e in energies])
    share = float(rotational.max() / translational.max())
    mean = float(rotational.mean() / translational.mean())
    return Outcome(
        "fig11",
        "Fig. 11: rotational energy",
        "The swing of Fig. 10 has the greatest rotational velocities of all experiments. Its energies follow from "
        "the measured lengths and their derivatives (a Savitzky-Golay filter), the rotational one with the moments "
        "of inertia (57) of hollow cylinders of greatest length, an upper bound.",
        [
            Claim(
                "the upper bound of the rotational energy is significantly lower than the translational energy",
                f"greatest values {rotational.max():.3f} J and {translational.max():.2f} J, {100 * share:.0f} %; "
                f"{100 * mean:.0f} % on average",
                share < 0.25,
            )
        ],
        {
            "fig11": (
                energy_figure(time, translational, rotational),
                "Measured translational energy and upper bound of the rotational energy after the release.",
            )
        },
        numbers={"share": share, "mean_share": mean},
    )


def upper_bound(section: SectionParameters) -> list[float]:
    """Equation (57): moments of inertia of a hollow cylinder of the section's size and greatest length, kg m^2."""
    assert section.bellows_outer_radius is not None
    square = (section.bellows_radius + section.bellows_outer_radius) ** 2
    lateral = section.mass * (square / 2 + section.length_range[1] ** 2 / 12)
    return [lateral, lateral, section.mass * square]
