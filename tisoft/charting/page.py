"""The chart as one page: the picture, and what a point is where the mouse rests on it."""

from __future__ import annotations

import html
import json
import shlex
from collections.abc import Mapping
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tisoft.charting.chart import Chart
    from tisoft.charting.judged import Judged

STYLE = """body{font:15px/1.45 sans-serif;max-width:62em;margin:2em auto;color:#222}svg{width:100%;
height:auto}#told{display:flex;gap:1.5em;border-left:4px solid #0072B2;padding:.4em 1em;
min-height:15em;background:#f6f6f6}#told img{max-width:340px;align-self:flex-start}#told pre{
white-space:pre-wrap;font:13px/1.4 monospace;margin:.3em 0}[id^=variant-]{cursor:pointer}table{
border-collapse:collapse}td,th{padding:.2em .8em;text-align:right}td:first-child,th:first-child{
text-align:left}tr.now{font-weight:bold}"""
SCRIPT = """const told=document.getElementById('told');function show(i){const v=DATA[i];
told.replaceChildren();if(v[1]){const p=new Image();p.src=v[1];p.alt='the mesh under its loads';
told.append(p)}const t=document.createElement('pre');t.textContent=v[0];told.append(t)}
for(const[i]of DATA.entries()){for(const g of[document.getElementById('variant-'+i),
document.getElementById('row-'+i)]){if(!g)continue;g.style.pointerEvents='all';
for(const e of['mouseenter','click'])g.addEventListener(e,()=>show(i))}}show(0)"""


def page(
    chart: Chart, svg: str, title: str, shapes: Mapping[str, str] | None = None, steps: str = ""
) -> str:
    """The whole page, which needs no other file.

    Args:
        chart: what it shows.
        svg: its picture.
        title: the scene's name.
        shapes: pictures of variants as data addresses, by name.
        steps: the picture of the step side, SVG.
    """
    made = shapes or {}
    data = json.dumps([[_told(v), made.get(v.name)] for v in chart.variants]).replace("</", "<\\/")
    sentences = "".join(f"<p>{html.escape(s)}</p>" for s in chart.sentences())
    warnings = "".join(f"<li>{html.escape(w)}</li>" for w in chart.warnings)
    second = f"<h2>The step</h2>{_plain(steps)}" if steps else ""
    return (
        f"<!doctype html><html lang=en><meta charset=utf-8><title>{html.escape(title)}</title>"
        f"<style>{STYLE}</style><h1>{html.escape(title)}: error against cost</h1>{sentences}"
        f"{_plain(svg)}<div id=told></div>{_table(chart)}{second}"
        f"<h2>What to know</h2><ul>{warnings}</ul>"
        f"<script>const DATA={data};{SCRIPT}</script></html>\n"
    )


def _plain(svg: str) -> str:
    return svg[svg.index("<svg") :]


def _table(chart: Chart) -> str:
    order = sorted(range(len(chart.variants)), key=lambda k: chart.variants[k].cost)
    rows = []
    for k in order:
        v = chart.variants[k]
        now = " class=now" if v.current else ""
        error = "below" if v.worst.below else f"{100 * v.worst.value:.2g}"
        rows.append(
            f"<tr id=row-{k}{now}><td>{html.escape(v.name)}</td><td>{v.cost:.3g}</td>"
            f"<td>{'timed' if v.timed else 'predicted'}</td><td>{error}</td>"
            f"<td>{100 * v.worst.bar:.2g}</td></tr>"
        )
    return (
        "<table><tr><th>variant<th>s a simulated second<th><th>error %<th>bar %</tr>"
        f"{''.join(rows)}</table>"
    )


def _told(v: Judged) -> str:
    """What is said of a variant where the mouse rests on its point."""
    line = " ".join(f"--set {shlex.quote(s)}" for s in v.settings)
    lines = [
        v.name,
        line or "(no --set: the scene itself)",
        f"{v.model}, {v.element}: {v.elements} elements, {v.nodes} nodes",
        f"cost {v.cost:.3g} s a simulated second, {'timed' if v.timed else 'predicted'}",
        f"step {v.step:.3g} s; stable up to {v.stable_step:.3g} s",
    ]
    for what, error in v.errors.items():
        how = "" if what != "path" else " (run)" if v.ran else " (predicted)"
        size = f"below {100 * error.most:.2g} %" if error.below else f"{100 * error.value:.2g} %"
        lines.append(f"{what} {size}, bar {100 * error.bar:.2g} %{how}")
    return "\n".join(lines)
