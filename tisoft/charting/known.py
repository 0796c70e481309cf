"""What is known of a scene's variants before any two of them can be compared."""

from __future__ import annotations

from typing import Any

from tisoft.charting.survey import Survey
from tisoft.charting.variants import Variant

ANSWERS = ("static", "modes", "step")


def rows_of(survey: Survey) -> list[dict[str, Any]]:
    """A row for each variant that was asked anything: its own numbers, not yet its errors.

    Displacements are those of the probes [m]; frequencies in Hz, energies in J, steps in s.
    """
    bench, given = survey.asking.bench, survey.catalogue.given
    rows = []
    for key, record in bench.kept.items():
        settings = tuple(record["settings"])
        if key != bench.key(Variant("", settings)) or settings[: len(given)] != given:
            continue  # another scene's
        if not any(_found(record, what) for what in (*ANSWERS, "exact modes", "timing")):
            continue
        size, settings = _found(record, "size"), settings[len(given) :]
        static, step = _found(record, "static"), _found(record, "step")
        modes = _found(record, "modes") or _found(record, "exact modes")
        timing = _found(record, "timing")
        rows.append({
            "set": " ".join(f"--set {s}" for s in settings), "current": not settings,
            "model": size.get("model"), "element": size.get("element"),
            "elements": size.get("elements"), "nodes": size.get("nodes"),
            "displacements": static.get("places"), "energy": static.get("energy"),
            "frequencies": modes.get("frequencies"), "step": step.get("step"),
            "stable_step": step.get("stable_step"), "cost": timing.get("cost"),
        })  # fmt: skip
    return rows


def sentence(survey: Survey) -> str:
    """What is known of the scene itself."""
    record = survey.asking.bench.record(survey.catalogue.current)
    static, modes, step = (_found(record, what) for what in ANSWERS)
    parts = []
    if static:
        parts.append(f"moves by up to {static['most']:.3g} m at rest under its loads")
    if modes.get("frequencies"):
        told = ", ".join(f"{f:.3g}" for f in modes["frequencies"])
        parts.append(f"has its first elastic frequencies at {told} Hz")
    if step:
        parts.append(f"has a stable step of {step['stable_step'] * 1e3:.3g} ms")
    return f"The scene as it is {', '.join(parts)}." if parts else ""


def _found(record: dict[str, Any], what: str) -> dict[str, Any]:
    """An answer, or nothing where there is none."""
    found: dict[str, Any] = record.get(what, {})
    return {} if "error" in found else found
