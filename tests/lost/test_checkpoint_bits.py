"""Checkpoints are used whole or not at all: flipped bits, cut ends, other versions, forgeries."""

import hashlib
import io
import json
import random

import numpy as np
import pytest

import tisoft as ts
from tisoft import checkpoint
from tisoft.cli import main
from tisoft.errors import SceneError


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    """The bytes of a small scene's checkpoint."""
    scene = ts.Scene()
    body = scene.add_body(ts.box((1.0, 0.5, 0.5), (2, 1, 1)), ts.ViscoElastic(1e5, 0.3, 1000.0))
    body.pin(ts.where.nearest((0, 0, 0)))
    sim = ts.Simulation(scene)
    sim.step()
    path = tmp_path_factory.mktemp("saved") / "a.npz"
    sim.save(path)
    return path.read_bytes()


def assert_damaged(data, path):
    path.write_bytes(data)
    with pytest.raises(SceneError, match=r"a\.npz is damaged or no checkpoint|of version"):
        checkpoint.read(path)


def flipped(data, place, bit):
    return data[:place] + bytes([data[place] ^ 1 << bit]) + data[place + 1 :]


def header_of(data, name):
    """Where the .npy header of an array lies."""
    start = data.index(b"\x93NUMPY", data.index(name.encode()))
    return range(start, start + 128)


@pytest.mark.parametrize("name", ["u.npy", "v.npy"])
def test_no_flipped_bit_of_a_header_goes_unseen(name, saved, tmp_path):
    for place in header_of(saved, name):
        assert_damaged(flipped(saved, place, place % 8), tmp_path / "a.npz")


def test_no_flipped_bit_goes_unseen(saved, tmp_path):
    chance = random.Random(1)
    for _ in range(300):
        place = chance.randrange(len(saved))
        assert_damaged(flipped(saved, place, chance.randrange(8)), tmp_path / "a.npz")


@pytest.mark.slow
def test_no_flipped_bit_of_any_byte_goes_unseen(saved, tmp_path):
    for place in range(len(saved)):
        assert_damaged(flipped(saved, place, place % 8), tmp_path / "a.npz")


def test_no_cut_end_goes_unseen(saved, tmp_path):
    for length in [*range(0, len(saved), 97), len(saved) - 1, len(saved) - 32]:
        assert_damaged(saved[:length], tmp_path / "a.npz")
    assert_damaged(saved + b"\x00", tmp_path / "a.npz")


def forged(saved, path, change):
    """Write the checkpoint with its content changed and a checksum that fits."""
    with np.load(io.BytesIO(saved[:-32])) as archive:
        store = {name: archive[name] for name in archive.files}
    data = json.loads(store["json"].tobytes())
    change(data, store)
    store["json"] = np.frombuffer(json.dumps(data).encode(), np.uint8)
    made = io.BytesIO()
    np.savez(made, **store)
    path.write_bytes(made.getvalue() + hashlib.sha256(made.getvalue()).digest())


@pytest.mark.parametrize("version", [1, 9, "x", None])
def test_another_version_is_refused_by_its_number(version, saved, tmp_path):
    forged(saved, tmp_path / "a.npz", lambda data, store: data.update(version=version))
    with pytest.raises(
        SceneError, match=f"of version {version!r}, and this tisoft reads {checkpoint.VERSION}"
    ):
        checkpoint.read(tmp_path / "a.npz")


def test_a_checkpoint_of_the_first_version_is_refused_by_its_number(saved, tmp_path):
    forged(saved, tmp_path / "a.npz", lambda data, store: data.update(version=1))
    data = (tmp_path / "a.npz").read_bytes()
    (tmp_path / "a.npz").write_bytes(data[:-32])  # it had no checksum
    with pytest.raises(SceneError, match="of version 1"):
        checkpoint.read(tmp_path / "a.npz")


def test_no_name_in_the_file_sets_an_attribute(saved, tmp_path):
    def change(data, store):
        data["content"]["dict"]["numbers"]["dict"] |= {"step": "gone", "__class__": "gone"}

    forged(saved, tmp_path / "a.npz", change)
    sim = ts.Simulation.load(tmp_path / "a.npz")
    sim.step()
    assert type(sim).__name__ == "Simulation" and "step" not in vars(sim)


FORGERIES = {
    "no frame": lambda data, store: data["content"]["dict"]["numbers"]["dict"].pop("frame"),
    "no notes": lambda data, store: data["content"]["dict"].pop("scene"),
    "no state": lambda data, store: store.pop("u"),
    "another shape": lambda data, store: store.update(u=store["u"][:1]),
    "one held node": lambda data, store: store.update(held=store["held"][:0]),
    "objects": lambda data, store: store.update(shifts=np.zeros(7)),
    "another class": lambda data, store: data["content"]["dict"]["scene"].update(type="os.system"),
    "an unknown field": lambda data, store: data["content"]["dict"]["scene"]["fields"].update(x=1),
    "no content": lambda data, store: data.pop("content"),
    "no version": lambda data, store: data.pop("version"),
}


@pytest.mark.parametrize("name", FORGERIES)
def test_content_of_another_kind_is_told(name, saved, tmp_path):
    forged(saved, tmp_path / "a.npz", FORGERIES[name])
    with pytest.raises(SceneError):
        ts.Simulation.load(tmp_path / "a.npz")


def test_resume_from_a_flipped_bit_is_told(scene, tmp_path, capsys):
    out = tmp_path / "out"
    run = ["run", scene, "-o", str(out), "--quiet"]
    assert main([*run, "--set", "duration=0.1"]) == 0
    path = out / "checkpoint.npz"
    whole, state = path.read_bytes(), (out / "probes.csv").read_bytes()
    for name in ("u.npy", "v.npy"):
        for place in header_of(whole, name)[::9]:
            path.write_bytes(flipped(whole, place, 1))
            assert main([*run, "--resume"]) == 2
            assert "checkpoint.npz is damaged or no checkpoint" in capsys.readouterr().err
    assert (out / "probes.csv").read_bytes() == state
    path.write_bytes(whole)
    assert main([*run, "--resume"]) == 0
