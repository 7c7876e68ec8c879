"""``bha identify --procedure``: section IV of the paper, one procedure a call."""

from __future__ import annotations

from pathlib import Path

import click
from click.core import ParameterSource

from bha.cli.common import console, print_json, say, table
from bha.errors import InputError
from bha.identification.procedures import Procedure

#: Options of ``bha identify`` that belong to the joint fit, and those that belong to a procedure.
OF_THE_FIT = (
    "holdouts", "free", "withs", "sessions", "per_session", "windows", "step", "max_iterations", "seed",
)  # fmt: skip
OF_A_PROCEDURE = ("chosen", "order")


def check_options(context: click.Context, name: str | None) -> None:
    """Refuse options that say nothing here.

    Raises:
        InputError: options of the joint fit beside a procedure, or the other way round.
    """
    options = {option.name: option.opts[0] for option in context.command.params}
    wrong = [
        options[key]
        for key in (OF_A_PROCEDURE if name is None else OF_THE_FIT)
        if context.get_parameter_source(key) is not ParameterSource.DEFAULT
    ]
    if wrong and name is None:
        raise InputError(f"{', '.join(wrong)}: only with --procedure; the joint fit takes all sections at once")
    if wrong:
        raise InputError(
            f"{', '.join(wrong)}: not with --procedure {name}, which fits one law; left out, the joint fit is made"
        )


def show_procedure(found: Procedure) -> None:
    """Print what a procedure found."""
    numbers = table("parameter", "unit", "before", "found", "std. error")
    for entry in found.summary()["parameters"]:
        before = found.before(entry["path"])
        numbers.add_row(
            entry["path"], entry["unit"], "" if before is None else f"{before:.4g}", f"{entry['value']:.4g}",
            f"{entry['standard_error']:.2g}",
        )  # fmt: skip
    console().print(numbers)
    for law in found.laws:
        unit = "N" if law.law == "longitudinal" else "N m"
        left, span = float((law.residual**2).mean() ** 0.5), float(law.ordinate.max() - law.ordinate.min())
        say(
            f"section {law.section}: {len(law.used)} steady states, {left:.2g} {unit} RMS about the curve of "
            f"{span:.3g} {unit}"
        )
        if law.law == "longitudinal" and law.rest_shift is None:
            say(f"section {law.section}: the spring forces keep one sign, so the rest length is the file's")
        if law.law == "bending" and law.offset == 0.0:
            say(f"section {law.section}: bent to one side only, so nothing tells a moment at angle zero")
    if found.swing is not None:
        for stretch, seen in zip(found.swing.used, found.swing.measured, strict=True):
            say(
                f"swing at {stretch.start:.3g} s of {stretch.record}: {seen.frequency:.3g} Hz, damping ratio "
                f"{seen.damping_ratio:.3g}, {1e3 * seen.residual:.2g} mm RMS about the oscillation of "
                f"{1e3 * seen.amplitude:.3g} mm"
            )


def finish_procedure(found: Procedure, out: Path | None, stem: Path | None, *, as_json: bool) -> None:
    """Write what is asked for, and print; ``stem`` is that of the figures, None for none."""
    written = []
    if out is not None:
        found.parameters().write(out)
        written.append(out)
    if stem is not None:
        written += _figures(found, stem)
    if as_json:
        print_json(found.summary() | {"written": written})
        return
    show_procedure(found)
    for path in written:
        click.echo(f"written: {path}")


def _figures(found: Procedure, stem: Path) -> list[Path]:
    from bha.plot import section_four  # noqa: PLC0415  (figures need an extra)
    from bha.plot.style import write_figure  # noqa: PLC0415

    if found.swing is None:
        draw = section_four.plot_stiffness if found.name == "stiffness" else section_four.plot_bending
        return [write_figure(draw(found.laws), stem.with_name(f"{stem.name}_{found.name}.pdf"))]
    count = len(found.swing.swings)
    return [
        write_figure(
            section_four.plot_swing(found.swing, k),
            stem.with_name(f"{stem.name}_damping{f'_{k + 1}' if count > 1 else ''}.pdf"),
        )
        for k in range(count)
    ]
