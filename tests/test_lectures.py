"""The pages of the lectures run, agree with theory, and are where docs/lectures.md says."""

import re
import runpy
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / "demos" / "lectures"
PAGES = sorted(FOLDER.glob("[0-9]*.py"))
MAP = (ROOT / "docs" / "lectures.md").read_text(encoding="utf-8")
LONGEST = 50
"""Lines of a page."""


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_page_agrees_with_theory_and_draws(page, tmp_path, monkeypatch, capsys):
    assert page.read_text(encoding="utf-8").count("\n") <= LONGEST
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(FOLDER)
    runpy.run_path(str(page), run_name="__main__")
    told = capsys.readouterr().out.splitlines()
    assert told[0].split("  ")[0].strip() and told[2].split() == ["theory", "computed"]
    assert sum("allowed" in line for line in told) >= 3
    drawn, shown = tmp_path / f"{page.stem}.png", ROOT / "docs" / "lectures" / f"{page.stem}.png"
    with Image.open(drawn) as picture, Image.open(shown) as kept:
        assert np.ptp(np.asarray(picture)) > 50
        assert picture.size == kept.size, "draw the picture of docs/lectures again"


def test_a_page_fails_where_theory_and_computation_differ(monkeypatch):
    monkeypatch.syspath_prepend(FOLDER)
    check = runpy.run_path(str(FOLDER / "page.py"))["check"]
    check("a length [m]", 2.0, 2.001, within=1e-3)
    for theory, computed in ((2.0, 2.003), (0.0, 2e-3), (2.0, -2.0), (2.0, np.nan)):
        with pytest.raises(AssertionError, match="a length"):
            check("a length [m]", theory, computed, within=1e-3)


def test_every_row_of_the_map_leads_to_its_file_its_page_and_its_picture():
    tables = MAP[: MAP.index("## Beyond the lectures")]
    rows = [line.strip("|").split("|") for line in tables.splitlines() if line.startswith("| ")]
    rows = [
        [cell.strip() for cell in row] for row in rows if row[0].strip() not in ("topic", "---")
    ]
    told = set()
    for topic, equation, files, example, picture in rows:
        assert topic and equation
        assert all((ROOT / file).is_file() for file in re.findall(r"`(.+?)`", files)), files
        (name,) = re.fullmatch(r"\[(\w+)\.py\]\(\.\./demos/lectures/\1\.py\)", example).groups()
        assert picture == f"[picture](lectures/{name}.png)"
        told.add(name)
    names = [page.stem for page in PAGES]
    assert told == set(names)
    assert re.findall(r"^!\[.+\]\(lectures/(\w+)\.png\)$", MAP, re.MULTILINE) == names
