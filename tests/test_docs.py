"""Every code block of README and docs does what it says.

A block says by its first line what it is: ```toml is a whole scene, ```toml fragment a part of one
with a body "beam", ```python a program, ```sh commands.
"""

import json
import re
import shlex
from pathlib import Path

import pytest

from tisoft.cli import main
from tisoft.commands.demo import shipped

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
OTHERS = [
    ROOT / "CONTRIBUTING.md",
    ROOT / "CHANGELOG.md",
    *sorted((ROOT / "docs/tasks").glob("*.md")),
]
"""Pages whose blocks are run elsewhere, or which have none."""
BLOCK = re.compile(r"^```(.*?)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
BODY = """
[[body]]
name = "beam"
young = 1e5
poisson = 0.3
density = 1000.0
mesh = { box = { size = [1, 0.2, 0.2], cells = [5, 1, 1] } }
"""
SHORTER = {
    "stability": ["--only", "diagonals", "--quiet"],
    "render": ["--set", "duration=0.1", "--size", "64x48"],
    "demo": ["--set", "duration=0.1", "--size", "64x48"],
}
"""Options that make a command of the docs end soon, where the docs' own do not."""


def blocks():
    """Kind and text of every block, with a name for the test."""
    for page in PAGES:
        for number, (kind, text) in enumerate(BLOCK.findall(page.read_text(encoding="utf-8"))):
            yield pytest.param(kind, text, id=f"{page.stem}-{number}-{kind or 'nothing'}")


def run_scene(text, folder):
    path = folder / "scene.toml"
    path.write_text(text, encoding="utf-8")
    return main(["run", str(path), "--json", "--set", "duration=0.1"])


def run_line(line, folder):
    """A command of tisoft, or one of the two that install it first, which other tests run."""
    if "pip install" in line:
        installed = line.endswith((".venv/bin/tisoft demo", ".venv/bin/python -m pytest"))
        assert line.startswith("python3 -m venv .venv && ") and installed
        return
    program, command, *words = shlex.split(line, comments=True)
    assert program == "tisoft"
    assert main([command, *words, *SHORTER.get(command, [])]) == 0, line


@pytest.mark.parametrize(("kind", "text"), list(blocks()))
def test_code_block(kind, text, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "demos").symlink_to(shipped("demos"))
    (tmp_path / "assets").symlink_to(shipped("assets"))
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    if kind == "toml":
        assert run_scene(text, tmp_path) == 0
        assert json.loads(capsys.readouterr().out)["warnings"] == []
    elif kind == "toml fragment":
        assert run_scene(BODY + text, tmp_path) == 0
    elif kind == "python":
        exec(compile(text, "block", "exec"), {})
    else:
        assert kind == "sh"
        for line in text.splitlines():
            run_line(line, tmp_path)


def test_no_page_has_a_block_of_another_kind():
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        assert text.count("```") == 2 * len(BLOCK.findall(text)), page
        kinds = {kind for kind, _ in BLOCK.findall(text)}
        assert kinds <= {"toml", "toml fragment", "python", "sh"}, page


def test_links_between_the_pages_lead_somewhere():
    for page in [*PAGES, *OTHERS]:
        for link in re.findall(r"\]\((?!http)([^)#]+)", page.read_text(encoding="utf-8")):
            assert (page.parent / link).exists(), f"{page.name}: {link}"


def test_readme_python_tells_what_it_says(capsys):
    (text,) = (block for kind, block in BLOCK.findall(PAGES[0].read_text()) if kind == "python")
    exec(compile(text, "README.md", "exec"), {})
    assert re.fullmatch(r"after 0\.5 s the tip is 0\.\d\d m down\n", capsys.readouterr().out)


def test_ci_runs_the_test_command_of_the_readme():
    shell = "".join(text for kind, text in BLOCK.findall(PAGES[0].read_text()) if kind == "sh")
    _, tests = shell.strip().splitlines()
    assert tests in (ROOT / ".ci" / "run").read_text(encoding="utf-8").splitlines()
    assert "/usr/bin/env bash" in (ROOT / ".ci" / "run").read_text(encoding="utf-8")


def test_the_set_up_of_contributors_is_that_of_the_readme():
    (block,) = BLOCK.findall(OTHERS[0].read_text(encoding="utf-8"))
    assert block[1] in PAGES[0].read_text(encoding="utf-8")


def test_the_citation_is_of_this_version():
    text = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    version = re.search(r'^version = "(.+)"$', (ROOT / "pyproject.toml").read_text(), re.MULTILINE)[
        1
    ]
    assert f"\nversion: {version}\n" in text
    assert f"## {version}" in OTHERS[1].read_text(encoding="utf-8")
