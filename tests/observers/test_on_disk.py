"""What lies in a run's folder: tables that another run goes on from, and how often it is saved."""

from types import SimpleNamespace

import pytest

import tisoft as ts
from tisoft.observers import checkpoints
from tisoft.observers.tables import ProbeTable

ROWS = "time,tip.x\n0,1\n0.1,2\n"


def gone_on(folder, frame):
    """The table of a folder, as a run leaves it that goes on from a frame."""
    with ProbeTable(folder, goes_on=True) as table:
        table.on_start(SimpleNamespace(frame=frame))
    return (folder / "probes.csv").read_text(encoding="utf-8")


def test_a_table_goes_on_behind_the_rows_of_earlier_frames(tmp_path):
    for frame, lines in ((2, 3), (1, 2)):
        (tmp_path / "probes.csv").write_text(ROWS, encoding="utf-8", newline="")
        assert gone_on(tmp_path, frame) == "".join(ROWS.splitlines(keepends=True)[:lines])


@pytest.mark.parametrize("cut", [0, 1])
def test_a_table_that_ends_before_its_checkpoint_is_told_and_left(tmp_path, cut):
    text = ROWS[: len(ROWS) - cut]
    (tmp_path / "probes.csv").write_text(text, encoding="utf-8", newline="")
    frame = 2 if cut else 3
    with pytest.raises(ts.SceneError, match=rf"probes\.csv ends before frame {frame}, where"):
        gone_on(tmp_path, frame)
    assert (tmp_path / "probes.csv").read_text(encoding="utf-8") == text


def test_a_table_that_is_missing_is_told_in_one_sentence(tmp_path):
    with pytest.raises(ts.SceneError, match=r"be read: No such file or directory; run the scene"):
        gone_on(tmp_path, 1)


@pytest.mark.parametrize(("writing", "pause"), [(0.5, 30.0), (3.0, 60.0)])
def test_checkpoints_take_less_than_a_twentieth_of_the_time(tmp_path, monkeypatch, writing, pause):
    """By a clock that only frames, of 1 s each, and the writing of checkpoints move."""
    now, begun = [0.0], []
    scene = ts.Scene()
    sim = SimpleNamespace(scene=scene, arch="cpu", frame=0)

    def save(*_, **__):
        begun.append(now[0])
        now[0] += writing

    monkeypatch.setattr(checkpoints, "time", SimpleNamespace(monotonic=lambda: now[0]))
    monkeypatch.setattr(checkpoints.resume, "save", save)
    folder = SimpleNamespace(path=tmp_path, tell=lambda share: None)
    kept = checkpoints.Checkpoints(folder, sim, [], notes=dict)
    for sim.frame in range(1, 200):
        now[0] += 1.0
        kept.on_frame(SimpleNamespace(index=sim.frame, simulation=sim))
    assert begun[0] == 31.0
    assert begun[1] - begun[0] == writing + pause + 1.0  # the first frame after the pause
