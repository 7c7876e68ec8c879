"""``report.html``: one file that works offline. Every string that comes from a file is escaped."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING, Any

from bha.diagnosis import figures
from bha.diagnosis.arm_figure import arm_figure
from bha.diagnosis.force_figure import force_figure
from bha.diagnosis.words import (
    VERDICTS,
    alike_in_words,
    errors_in_words,
    experiment_in_words,
    headline,
    in_words,
    slow_in_words,
)
from bha.support.extras import import_extra

if TYPE_CHECKING:
    from bha.arm import Arm
    from bha.diagnosis.force_summary import Unexplained
    from bha.diagnosis.result import Diagnosis, ResidualForceFound
    from bha.diagnosis.workflow import Investigation

#: Chance of a rank correlation below which what is left is said to follow something: one in a hundred and some pairs.
FOLLOWS = 1e-4
STYLE = """
:root { color-scheme: light; --line: #ddd; --soft: #555; }
* { box-sizing: border-box; }
body {
  font: 16px/1.5 system-ui, sans-serif; margin: 0 auto; max-width: 1120px; padding: 1rem; color: #222; background: #fff;
}
h1 { font-size: 1.5rem; margin: 0.2rem 0; }
h2 { font-size: 1.15rem; margin: 1.6rem 0 0.4rem; border-top: 1px solid var(--line); padding-top: 0.8rem; }
.verdict { border-left: 6px solid var(--mark); padding: 0.4rem 0.9rem; background: #fafafa; }
.named, .one_of { --mark: #0072b2; } .equivalent { --mark: #009e73; } .unexplained, .setup { --mark: #d55e00; }
.soft { color: var(--soft); } .scroll { overflow-x: auto; }
details { margin: 1.2rem 0; border-top: 1px solid var(--line); padding-top: 0.6rem; }
summary { font-weight: 600; font-size: 1.1rem; cursor: pointer; }
code { font-size: 0.88rem; overflow-wrap: anywhere; }
table { border-collapse: collapse; font-size: 0.92rem; }
th, td {
  text-align: left; padding: 0.25rem 0.7rem 0.25rem 0; border-bottom: 1px solid var(--line); vertical-align: top;
}
.grid { display: grid; grid-template-columns: repeat(2, minmax(0, 1fr)); gap: 0.8rem; }
.figure { min-width: 0; width: 100%; overflow: hidden; } .wide { min-width: 760px; }
@media (max-width: 720px) { .grid { grid-template-columns: minmax(0, 1fr); } body { padding: 0.6rem; } }
"""


def report_html(outcome: Investigation, arm: Arm, unexplained: Unexplained | None = None) -> str:
    """The text of the report.

    Args:
        outcome: what was found.
        arm: the arm with what was found, as ``arm_diagnosed.toml`` has it.
        unexplained: the residual force, of that verdict.

    Raises:
        MissingExtraError: Plotly is not installed.
    """
    found = outcome.diagnosis
    parts: list[str] = [_head(found, arm.name)]
    figure = _Figures(parts)
    figure.add(figures.gap_figure(found))
    if found.effects:
        parts.append("<h2>What was found</h2>")
        parts += [_effect(e) for e in found.effects]
        if found.next_experiment is not None:
            parts.append(
                f"<p><b>Next experiment.</b> {escape(_capital(experiment_in_words(found.next_experiment)))}.</p>"
            )
    if unexplained is not None:
        parts.append(f"<h2>The force that would explain it</h2>{_force(unexplained.found)}")
        figure.add(force_figure(unexplained), wide=True)
    parts.append("<h2>The arm, measured against simulated</h2>")
    figure.add(arm_figure(outcome, arm))
    figure.add(figures.trace_figure(outcome))
    figure.add(figures.error_figure(outcome))
    parts.append(
        "<h2>All candidates</h2><p>Share of the error that each alone promises to explain; green: "
        "refitted, with its error on the held-out logs then.</p>"
    )
    figure.add(figures.candidates_figure(found))
    parts.append("<h2>Parameters</h2><p>Estimates over the values of the file, with 95 % intervals.</p>")
    figure.add(figures.estimates_figure(found))
    parts.append(_estimates(found))
    parts.append("<details><summary>Where the plain model errs</summary><div class='grid'>")
    where = found.where
    figure.add(figures.bars_figure(where["channel"], "name", "channel"))
    if where["mode"]:
        figure.add(figures.bars_figure(where["mode"], "name", "mode (u, v: bends, l: mean length)"))
    figure.add(figures.band_figure(where["band"]))
    figure.add(figures.time_figure(where["time"]))
    parts.append("</div><h3>By region (chance of such a spread in p)</h3>")
    figure.add(figures.region_figure(where["region"]))
    parts.append("</details><details><summary>What is left, and how the search went</summary>")
    figure.add(figures.spectrum_figure(found))
    parts.append(f"{_residual(found)}</details>")
    parts.append(f"<details><summary>What these logs can tell</summary>{_excitation(found)}</details>")
    return _page(found, arm, parts, figure)


def standing_html(found: Diagnosis, arm: Arm) -> str:
    """The text of the report on logs in which nothing moves: of these there is no model to be shown.

    Raises:
        MissingExtraError: Plotly is not installed.
    """
    parts: list[str] = [_head(found, arm.name)]
    return _page(found, arm, parts, _Figures(parts))


def _page(found: Diagnosis, arm: Arm, parts: list[str], figure: _Figures) -> str:
    """The page of what is in ``parts``, closed by its logs and how it was made."""
    offline = import_extra("plotly.offline", extra="report", purpose="The report of a diagnosis")
    parts.append(f"<details><summary>Logs, and how this was made</summary>{_logs(found)}{_made(found)}</details>")
    title = escape(f"Diagnosis of {arm.name}")
    return (
        "<!DOCTYPE html>\n<html lang='en'><head><meta charset='utf-8'>"
        "<meta name='viewport' content='width=device-width, initial-scale=1'>"
        f"<title>{title}</title><style>{STYLE}</style><script>{offline.get_plotlyjs()}</script></head><body>"
        + "\n".join(parts)
        + f"<script>{figure.script()}</script></body></html>\n"
    )


class _Figures:
    """Collects figures: a place each in the page, and one script that draws them all."""

    def __init__(self, parts: list[str]) -> None:
        self._parts = parts
        self._json: list[str] = []

    def add(self, figure: Any | None, *, wide: bool = False) -> None:
        if figure is None:
            return
        place = f"<div class='figure{' wide' if wide else ''}' id='figure{len(self._json)}'></div>"
        self._parts.append(f"<div class='scroll'>{place}</div>" if wide else place)
        # A script ends at the first "</", wherever it stands; "<!--" begins a comment in it.
        self._json.append(figure.to_json().replace("<", "\\u003c"))

    def script(self) -> str:
        drawn = ",".join(self._json)
        # What is folded away has no width: it is drawn once it has one.
        draw = (
            "figures.forEach((f,i)=>{const d=document.getElementById('figure'+i);let drawn=false;"
            "new ResizeObserver(()=>{const width=d.clientWidth;if(!width)return;"
            "if(drawn){Plotly.relayout(d,{width});return;}drawn=true;"
            "Plotly.newPlot(d,{data:f.data,layout:{...f.layout,width},frames:f.frames||[],"
            "config:{displayModeBar:false}});}).observe(d);});"
        )
        return f"const figures=[{drawn}];{draw}"


def _head(found: Diagnosis, arm_name: str) -> str:
    made, incomplete = found.made, _incomplete(found)
    of_when = f", {escape(made.date[:16].replace('T', ' '))}" if made else ""
    names = ", ".join(f"{e.kind} at {e.where}" for e in found.missing)
    how = "Nothing was fitted: the arm is held where the other logs show it"
    if found.plain:
        how = "These logs took no part in any fit; the plain model was identified again first"
    return (
        f"<p class='soft'>Diagnosis of {escape(arm_name)}{of_when}</p><div class='verdict {escape(found.verdict)}'>"
        f"<h1>{escape(headline(found))}</h1><p>"
        + (f"{escape(VERDICTS[found.verdict])}: {escape(names)}. " if names else "")
        + f"{escape(_capital(found.reason))}.</p>{incomplete}</div>"
        f"<p>{escape(_capital(errors_in_words(found.gap, named=found.has_names)))}. {how}.</p>"
        + "".join(f"<p>Setup: {escape(text)}.</p>" for text in found.setup)
    )


def _incomplete(found: Diagnosis) -> str:
    """That a search did not come to its end, and why; empty where it did."""
    if found.unexamined:
        return f"<p><b>Out of time before: {escape(found.unexamined)}. What comes after it was not examined.</b></p>"
    return "" if found.complete else "<p><b>Interrupted: the search is not complete.</b></p>"


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]


def _interval(number: Any) -> str:
    return "" if number.ci95 is None else f"{number.ci95[0]:.4g} to {number.ci95[1]:.4g}"


def _effect(effect: Any) -> str:
    rows = "".join(
        f"<tr><td>{escape(name)}</td><td>{n.value:.4g} {escape(n.unit)}</td>"
        f"<td>{_interval(n)}{' (on a bound)' if n.at_bound else ''}</td></tr>"
        for name, n in effect.parameters.items()
    )
    notes = [f"confidence {effect.confidence:.2f} ({escape(effect.kind)} at {escape(effect.where)})"]
    if effect.empirical:
        notes.append("an empirical term: it helps to predict, but breaks a physical rule")
    if alike := alike_in_words(effect):
        notes.append(escape(alike))
    sentence = slow_in_words(effect.slow) if effect.slow else in_words(effect)
    if effect.slow:
        notes.append(escape(f"the numbers are those of one way to divide it: {in_words(effect)}"))
    return (
        f"<h3>{escape(_capital(sentence))}</h3><p>{'; '.join(notes)}.</p>"
        f"<div class='scroll'><table><tr><th>number</th><th>value</th><th>95 % interval</th></tr>{rows}</table></div>"
    )


def _force(found: ResidualForceFound) -> str:
    text = f"<p>{escape(_capital(found.reason))}.</p>"
    if not found.along:
        return text
    rows = "".join(
        f"<tr><td>{escape(line.where)}</td><td>{line.rms:.3g} N</td><td>&plusmn; {line.deviation:.2g} N</td>"
        f"<td>{100.0 * max(line.told, 0.0):.0f} %</td></tr>"
        for line in found.along
    )
    text += (
        "<p>Beside the re-identified plain model, along each bellows; positive pushes its ends apart. It says where "
        "and when the model errs and by how much, not why.</p>"
        "<details><summary>As a table</summary><div class='scroll'><table><tr><th>along</th>"
        f"<th>RMS over all logs</th><th>95 % band</th><th>told by the readings</th></tr>{rows}</table></div></details>"
    )
    if found.file:
        text += f"<p class='soft'>Row by row in <code>{escape(found.file)}</code>.</p>"
    if found.table is not None and found.table.file:
        text += (
            f"<p class='soft'><code>bha simulate arm_diagnosed.toml --input LOG --residual {escape(found.table.file)}"
            "</code> carries the table.</p>"
        )
    return text


def _residual(found: Diagnosis) -> str:
    rest = found.residual
    text = ""
    if rest.get("mean_square") is not None:
        text += (
            f"<p>Mean square of the white residual on held-out logs: {rest['mean_square']:.3g} (1 is noise), "
            f"neighbouring rows that err together: {rest['correlation_rows']:.3g} (1 is white).</p>"
        )
    if rest.get("line"):
        text += f"<p>A line stands out at {rest['line']['frequency']:.2f} Hz.</p>"
    rows = "".join(
        f"<tr><td>{escape(f['output'])}</td><td>{escape(f['with'])}</td><td>{f['correlation']:+.2f}</td>"
        f"<td>{f['p_value']:.2g}</td></tr>"
        for f in rest.get("follows", [])[:6]
        if f["p_value"] < FOLLOWS
    )
    if rows:
        text += (
            "<div class='scroll'><table><tr><th>residual of</th><th>follows</th><th>rank correlation</th>"
            f"<th>p</th></tr>{rows}</table></div>"
        )
    elif rest.get("mean_square") is not None:
        text += "<p>It follows nothing that was logged.</p>"
    notes = "".join(f"<li>{escape(n)}</li>" for n in rest.get("notes", []))
    return text + (f"<p>Steps of the search:</p><ul>{notes}</ul>" if notes else "")


def _excitation(found: Diagnosis) -> str:
    told = found.excitation
    weak = "".join(
        f"<tr><td>{escape(w['kind'])}</td><td>{100 * w['detectable_over_typical']:.3g} %</td></tr>"
        for w in told["least_visible"]
    )
    text = (
        "<div class='scroll'><table><tr><th>least visible</th><th>detectable size over a typical one</th></tr>"
        f"{weak}</table></div>"
    )
    groups = "".join(
        f"<li>{escape(', '.join(g[:12]))}{' ...' if len(g) > 12 else ''}</li>" for g in told["classes"][:10]
    )
    if groups:
        text += f"<p>Look-alikes in these logs:</p><ul>{groups}</ul>"
    if told["next_experiment"]:
        asked = any(e.one_of for e in found.effects)
        what = "Best next experiment" if asked else "To see what these logs show least"
        text += f"<p>{what}: {escape(told['next_experiment'])}.</p>"
    return text


def _estimates(found: Diagnosis) -> str:
    rows = "".join(
        f"<tr><td>{escape(name)}</td><td>{'' if e.start is None else f'{e.start:.5g}'}</td><td>{e.value:.5g}</td>"
        f"<td>{_interval(e)}{' (on a bound)' if e.at_bound else ''}</td><td>{escape(e.unit)}</td></tr>"
        for name, e in found.plain.items()
    )
    return (
        "<details><summary>As a table</summary><div class='scroll'><table><tr><th>parameter</th><th>file</th>"
        f"<th>estimate</th><th>95 % interval</th><th>unit</th></tr>{rows}</table></div></details>"
    )


def _logs(found: Diagnosis) -> str:
    rows = "".join(
        f"<tr><td>{escape(log['name'])}</td><td>{escape(log['part'])}</td><td>{log['rows']}</td>"
        f"<td>{log['duration']:.4g} s</td><td>{escape(_flaws(log))}</td></tr>"
        for log in found.logs
    )
    return (
        "<div class='scroll'><table><tr><th>log</th><th>part</th><th>rows</th><th>duration</th>"
        f"<th>noise and flaws</th></tr>{rows}</table></div>"
    )


def _made(found: Diagnosis) -> str:
    made = found.made
    if made is None:
        return ""
    files = "".join(
        f"<tr><td>{escape(f.name)}</td><td><code>{escape(f.sha256 or 'from memory')}</code></td></tr>"
        for f in made.files
    )
    return (
        f"<p>{escape(made.date)}, bha {escape(made.version)}, seed {made.seed}, {found.seconds:.0f} s.<br>"
        f"<code>{escape(made.command)}</code></p>"
        f"<div class='scroll'><table><tr><th>log</th><th>SHA-256</th></tr>{files}</table></div>"
    )


def _flaws(log: dict[str, Any]) -> str:
    by_unit: dict[str, list[float]] = {}
    flaws = []
    for channel in log["channels"]:
        by_unit.setdefault(channel["unit"], []).append(channel["noise"])
        if channel["held"] > 0.2:
            flaws.append(f"{channel['name']} holds {100 * channel['held']:.0f} % of its samples")
        flaws += [f"{channel['name']} frozen {a:.4g} to {b:.4g} s" for a, b in channel["frozen"]]
    noise = [f"noise {min(v):.3g} to {max(v):.3g} {unit}" for unit, v in by_unit.items()]
    return "; ".join(noise + flaws[:6])
