"""The chart as one page: the picture, and what a point is where the mouse rests on it."""

from __future__ import annotations

import html
import json
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tisoft.charting.chart import Chart

STYLE = """body{font:15px/1.45 sans-serif;max-width:60em;margin:2em auto;color:#222}svg{width:100%;
height:auto}#told{border-left:4px solid #0072B2;padding:.4em 1em;min-height:9em;background:#f6f6f6;
white-space:pre-wrap}code{font-size:13px}[id^=variant-]{cursor:pointer}td,th{padding:.2em .8em;
text-align:right}td:first-child,th:first-child{text-align:left}"""
SCRIPT = """for(const[i,v]of DATA.entries()){const g=document.getElementById('variant-'+i);if(!g)
continue;const show=()=>{document.getElementById('told').textContent=v};
for(const e of['mouseenter','click'])g.addEventListener(e,show);g.style.pointerEvents='all'}"""


def page(chart: Chart, svg: str, title: str) -> str:
    """The whole page, which needs no other file."""
    picture = svg[svg.index("<svg") :]
    told = [_told(row) for row in chart.table()]
    sentences = "".join(f"<p>{html.escape(s)}</p>" for s in chart.sentences())
    warnings = "".join(f"<li>{html.escape(w)}</li>" for w in chart.warnings)
    rows = "".join(
        f"<tr><td>{html.escape(v.name)}</td><td>{v.cost:.3g}</td><td>{100 * v.worst.value:.2g}</td>"
        f"<td>{100 * v.worst.bar:.2g}</td></tr>"
        for v in sorted(chart.variants, key=lambda v: v.cost)
    )
    data = json.dumps(told).replace("</", "<\\/")
    return (
        f"<!doctype html><html lang=en><meta charset=utf-8><title>{html.escape(title)}</title>"
        f"<style>{STYLE}</style><h1>{html.escape(title)}: error against cost</h1>{sentences}"
        f"{picture}<div id=told>Rest the mouse on a point: here is what it is.</div>"
        "<table><tr><th>variant<th>s a simulated second<th>error %<th>bar %</tr>"
        f"{rows}</table><ul>{warnings}</ul><script>const DATA={data};{SCRIPT}</script></html>\n"
    )


def _told(row: dict[str, object]) -> str:
    lines = [str(row["name"]), str(row["set"]) or "(no --set: the scene itself)"]
    return "\n".join(lines + [f"{k}: {v}" for k, v in row.items() if k not in ("name", "set")])
