"""What is told of frames that share a launch is what each of them was."""

import numpy as np
import pytest

import tisoft as ts
from tisoft.observers.tables import ENERGIES


class Rows:
    """Probes and energies of all frames; `looks_every` 0: frames may share a launch."""

    def __init__(self, looks_every):
        self.looks_every, self.probes, self.energies = looks_every, [], []

    def on_frame(self, frame):
        self.probes.append(frame.probes())
        known = frame.energy()
        self.energies.append([np.nan if known[key] is None else known[key] for key in ENERGIES])


def flight(*, ledger):
    """A soft block that is thrown, falls several times its size, and wobbles."""
    scene = ts.Scene(precision="f64")
    model = ts.ViscoElastic(2e4, 0.3, 1000.0, phi=4.0, eta=2.0)
    body = scene.add_body(ts.box((0.2, 0.2, 0.2), (1, 1, 1)), model, velocity=(1.0, 2.0, 0.0))
    scene.add_probe("corner", body, point=(0, 0, 0))
    sim = ts.Simulation(scene, threads=1, ledger=ledger)
    points = sim.positions() * [1.1, 0.95, 0.95]
    sim.set_state(points, sim.velocities())
    return sim


@pytest.mark.parametrize("ledger", [True, False])
def test_frames_made_together_are_told_as_those_made_one_by_one(ledger):
    together, alone = Rows(0), Rows(1)
    shared, single = flight(ledger=ledger), flight(ledger=ledger)
    shared.run(1.5, observers=[together])
    single.run(1.5, observers=[alone])
    assert len(together.probes) == len(alone.probes) == 91
    scale = np.nanmax(np.abs(alone.energies))
    assert np.allclose(together.probes, alone.probes, rtol=0, atol=1e-12)
    assert np.allclose(
        together.energies, alone.energies, rtol=0, atol=1e-11 * scale, equal_nan=True
    )
    assert np.abs(shared.parts[0].shift).max() > 1.0  # its origin has followed it
    assert np.ptp(np.array(alone.energies)[:, 1]) > 0.0


def swing():
    """A block that hangs and swings a little, in frames of many substeps."""
    scene = ts.Scene(precision="f64", frame_rate=10.0)
    model = ts.ViscoElastic(2e4, 0.3, 1000.0, phi=4.0, eta=2.0)
    body = scene.add_body(ts.box((0.2, 0.2, 0.2), (1, 1, 1)), model)
    body.pin(ts.where.box((-1, 0.199, -1), (1, 1, 1)))
    scene.add_probe("corner", body, point=(0, 0, 0))
    sim = ts.Simulation(scene, threads=1, ledger=True)
    sim.look = 2
    return sim


def test_long_frames_are_cut_where_the_limit_is_looked_at_and_come_out_the_same_together():
    shared, single = swing(), swing()
    launches = []
    advance = shared.stepper._advance
    shared.stepper._advance = lambda scene: launches.append(1) or advance(scene)
    shared.run(12.0, observers=[Rows(0)])
    single.run(12.0, observers=[Rows(1)])
    assert single.substeps > 2.5 * single.look * single.frame
    assert shared.steps == single.steps
    assert np.array_equal(shared.positions(), single.positions())
    assert shared.energy() == single.energy()
    assert len(single.steps) < 1.3 * single.frame  # of calm frames, one stretch each
    assert len(launches) < 0.5 * single.frame
