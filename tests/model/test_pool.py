"""Fields and kernels are shared: by scenes one after the other, and by scenes side by side."""

import gc

import numpy as np
import pytest

import tisoft as ts
from tisoft import runtime
from tisoft.errors import SceneError
from tisoft.model.arena import Pool, Shelf, check_memory


def scene(cells=(3, 1, 1), model=None, **settings):
    made = ts.Scene(frame_rate=100, **settings)
    mesh = ts.box(size=(1, 0.3, 0.3), cells=cells)
    body = made.add_body(mesh, model or ts.ViscoElastic(1e4, 0.3, 1000.0, eta=2.0))
    body.pin(ts.where.box((-1e-6, -9, -9), (1e-6, 9, 9)))
    return made


def test_a_shelf_lends_what_was_given_back():
    shelf = Shelf(10)
    first, second = shelf.take(4), shelf.take(6)
    assert (first, second) == (0, 4)
    assert shelf.place(1) is None
    shelf.give_back(0, 4)
    assert shelf.take(3) == 0
    shelf.give_back(4, 6)
    shelf.give_back(0, 3)
    assert shelf.is_empty


def test_rows_that_come_back_while_others_are_lent_are_lent_once(monkeypatch):
    """As where the garbage collector ends a simulation in the middle of `take`."""
    shelf = Shelf(10)
    first, second = shelf.take(2), shelf.take(2)
    place = shelf.place

    def place_and_collect(count):
        start = place(count)
        shelf.give_back(second, 2)
        return start

    monkeypatch.setattr(shelf, "place", place_and_collect)
    assert (first, shelf.take(3)) == (0, 4)
    monkeypatch.undo()
    assert (shelf.take(2), shelf.take(3), shelf.place(1)) == (2, 7, None)


def test_the_second_scene_of_a_structure_compiles_nothing():
    one = ts.Simulation(scene())
    one.step()
    pool = runtime.pool(Pool)
    compiled, made = runtime.compilations, pool.made
    other = ts.Simulation(scene(cells=(5, 2, 1), model=ts.ViscoElastic(3e4, 0.2, 900.0)))
    other.step()
    assert (runtime.compilations, pool.made) == (compiled, made)


def test_simulations_side_by_side_do_not_touch_each_other():
    alone = ts.Simulation(scene(), threads=1)
    for _ in range(10):
        alone.step()
    wanted = alone.positions()
    del alone
    pair = [ts.Simulation(scene(), threads=1), ts.Simulation(scene(cells=(4, 2, 2)), threads=1)]
    for _ in range(10):
        for sim in pair:
            sim.step()
    np.testing.assert_array_equal(pair[0].positions(), wanted)


def test_many_scenes_leave_fields_and_kernels_as_they_are():
    """Sizes and structures in turn; only what lives holds rows."""
    models = [
        ts.ViscoElastic(1e4, 0.3, 1000.0),
        ts.NeoHookean(1e4, 0.3, 1000.0),
        ts.MassSpring(young=1e4, density=1000.0),
    ]
    pool = runtime.pool(Pool)

    def turn(k):
        sim = ts.Simulation(scene(cells=(2 + k % 7, 1 + k % 3, 1), model=models[k % 3]), threads=1)
        sim.step()
        assert np.isfinite(sim.positions()).all()

    for k in range(21):
        turn(k)
    gc.collect()
    compiled, made = runtime.compilations, pool.made
    for k in range(120):
        turn(k)
    gc.collect()
    assert (runtime.compilations, pool.made) == (compiled, made)
    arenas = [arena for known in pool.arenas.values() for arena in known]
    assert len(arenas) < 40


def test_a_scene_that_does_not_fit_into_memory_is_told_with_its_size():
    check_memory(1 << 20)
    with pytest.raises(SceneError, match=r"1e\+06 GiB of memory .* are free; use a coarser mesh"):
        check_memory(1 << 50)


def test_a_changed_material_compiles_nothing_and_is_felt_at_once():
    made = scene()
    sim = ts.Simulation(made)
    sim.step()
    compiled, before = runtime.compilations, sim.stable_step()
    made.bodies[0].model = ts.ViscoElastic(4e4, 0.3, 1000.0, phi=1.0, eta=8.0)
    made.bodies[0].load(ts.where.everything(), force=(0, -1, 0))
    made.bodies[0].load(ts.where.everything(), pressure=10.0)
    sim.step()
    assert runtime.compilations == compiled
    assert sim.stable_step() < 0.6 * before
