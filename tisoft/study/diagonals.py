"""Mass-spring with and without diagonals: springs that are missing leave mechanisms.

    mechanisms = 3N − 6 − rank R ≥ 3N − 6 − springs      (Maxwell 1864), R the rigidity matrix

and a net with mechanisms sags until other springs are taut.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import splu

from tisoft import where
from tisoft.body import Body
from tisoft.equilibrium.operators import Elastic
from tisoft.geometry.mesh import bare_net
from tisoft.geometry.rigidity import rigidity
from tisoft.geometry.shapes import grid
from tisoft.gravity import mainly
from tisoft.model.network import network
from tisoft.model.part import parts_of
from tisoft.models.materials import MassSpring
from tisoft.pins import Pin
from tisoft.scene import Scene
from tisoft.simulation import Simulation
from tisoft.study import pictures
from tisoft.study.axis import Axis, Tick
from tisoft.study.own import Own
from tisoft.study.subject import Subject

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

SHARES = (0.0, 0.1, 0.25, 0.5, 0.75, 0.9, 1.0)
"""Of a grid's diagonals that are taken away."""
OWN_SHARES = (0.0, 0.02, 0.05, 0.1, 0.2, 0.3, 0.5)
"""Of a scene's own springs."""
CELLS = 60
"""Cells of the grid that stands in for a body with tets, about."""
LOOKS = 30
MOST_SUBSTEPS = 12_000
"""Of the run that lets the nets sag."""
MOST_SPRINGS = 20_000
WORK = 100_000_000
"""Springs · substeps of that run, at the most."""


@dataclass(frozen=True)
class Net:
    """A net whose springs may go missing."""

    name: str
    points: Floats
    springs: Ints
    stiffness: Floats
    lengths: Floats
    masses: Floats
    pins: list[Pin]
    missing: list[Ints]
    """Rows of `springs` that each of `shares` takes away."""
    shares: tuple[float, ...]
    what: str


@dataclass(frozen=True)
class Sag:
    """One share of missing springs."""

    share: float
    springs: int
    mechanisms: int
    least: int
    """Maxwell's count, which mechanisms cannot fall below."""
    sag: float
    """Mean way of the nodes along gravity at the end [m]."""
    ends: Ints
    positions: Floats


def work(subject: Subject) -> int:
    """Number of ticks that `measure` makes."""
    return len(SHARES) + LOOKS


def net_of(subject: Subject) -> Net:
    """The scene's own net, or a grid as large as the body."""
    if subject.is_springs and len(subject.body.springs()) <= MOST_SPRINGS:
        return _own_net(subject)
    size, material = subject.size, subject.material
    edge = (float(size.prod()) / CELLS) ** (1.0 / 3.0)
    cells = [max(1, round(s / edge)) for s in size]
    mesh = grid(tuple(size), cells)
    points = mesh.points + subject.body.mesh.points.min(axis=0)
    springs = mesh.edges.astype(np.int64)
    vectors = points[springs[:, 1]] - points[springs[:, 0]]
    lengths = np.linalg.norm(vectors, axis=1)
    slanted = np.flatnonzero((np.abs(vectors) > 1e-9 * edge).sum(axis=1) > 1)
    order = np.random.default_rng(0).permutation(slanted)
    stiffness = np.full(len(springs), 6.0 * material.young * size.prod() / (lengths**2).sum())
    masses = np.full(len(points), material.density * float(size.prod()) / len(points))
    name = "the " + " × ".join(map(str, cells)) + " grid of springs"
    missing = [order[: round(s * len(order))] for s in SHARES]
    return Net(name, points, springs, stiffness, lengths, masses, [_clamp(points)], missing,
               SHARES, "diagonals")  # fmt: skip


def _own_net(subject: Subject) -> Net:
    body = subject.body
    made = network(body)
    order = np.random.default_rng(0).permutation(len(made.ends))
    pins = [Pin(where.nodes([int(n) for n in body.nodes(p.where)]), p.axes)
            for p in body.pins if p.release is None]  # fmt: skip
    missing = [order[: round(s * len(order))] for s in OWN_SHARES]
    return Net(f"the net of {body.name!r}", body.mesh.points, made.ends, made.stiffness,
               made.lengths, made.masses, pins or [_clamp(body.mesh.points)], missing, OWN_SHARES,
               "springs")  # fmt: skip


def _clamp(points: Floats) -> Pin:
    """A pin of the end where the longest axis begins."""
    axis = int(np.argmax(np.ptp(points, axis=0)))
    along = points[:, axis]
    end = np.flatnonzero(along <= along.min() + 0.01 * np.ptp(along))
    return Pin(where.nodes([int(n) for n in end]))


def _scene(net: Net, gravity: Floats) -> Scene:
    scene = Scene(gravity=tuple(gravity), precision="f64")
    for share, gone in zip(net.shares, net.missing, strict=True):
        kept = np.setdiff1d(np.arange(len(net.springs)), gone)
        mesh = bare_net(net.points, net.springs[kept])
        model = MassSpring(
            stiffness=net.stiffness[kept], node_mass=net.masses, rest_lengths=net.lengths[kept],
            springs=net.springs[kept],
        )  # fmt: skip
        body = scene.add_body(mesh, model, f"without {100 * share:g} %")
        body.pins = list(net.pins)
        body.contact = False  # they stand in each other's place
    return scene


def settle(net: Net, gravity: Floats, tick: Tick) -> Simulation:
    """Let the net sag under gravity with each share of its springs missing."""
    scene = _scene(net, gravity)
    slow = _slowest(scene.bodies[0], gravity)
    for body in scene.bodies:
        body.model = dataclasses.replace(body.model, point_damping=1.4 * slow)
    sim = Simulation(scene, certify=False)
    step = 0.95 * sim.limit.rest_bound()  # holds however the springs line up
    most = max(500, min(MOST_SUBSTEPS, WORK // max(1, sim.system.springs)))
    scene.step, scene.frame_rate = step, LOOKS / min(4.0 * 2.0 * np.pi / slow, most * step)
    for _ in range(LOOKS):
        sim.step()
        tick()
    return sim


def _slowest(body: Body, gravity: Floats) -> float:
    """About the lowest natural frequency [rad/s] of the whole net, by the shape of its sag."""
    balance = Elastic(parts_of([body])[0])
    part = balance.part
    free = np.ones((balance.nodes, 3), bool)
    for pin in body.pins:
        free[np.ix_(part.rank[body.nodes(pin.where)], pin.components)] = False
    inner = np.flatnonzero(free.ravel())
    matrix = balance.stiffness(np.zeros((balance.nodes, 3)))[inner][:, inner]
    shift = 1e-9 * float(matrix.diagonal().max())  # flat nets are loose out of their plane
    weight = (part.mass[:, None] * gravity).ravel()[inner]
    u = splu((matrix + shift * sparse.identity(len(inner))).tocsc()).solve(weight)
    mass = np.repeat(part.mass, 3)[inner]
    pendulum = float(np.linalg.norm(gravity)) / part.size
    return float(np.sqrt(max(float(u @ weight) / float(u @ (mass * u)), pendulum)))


def measure(subject: Subject, own: Own, tick: Tick) -> Axis:
    """Count the mechanisms and let the nets sag."""
    net = net_of(subject)
    gravity = mainly(subject.scene.gravity)
    if not gravity.any():
        gravity = np.array([0.0, -9.81, 0.0])
    sim = settle(net, gravity, tick)
    down = gravity / np.linalg.norm(gravity)
    found = []
    for share, body in zip(net.shares, sim.scene.bodies, strict=True):
        ends = body.springs()
        counted = rigidity(net.points, ends)
        positions = sim.positions(body)
        sag = float(((positions - net.points) @ down).mean())
        least = max(0, 3 * len(net.points) - 6 - len(ends))
        modes = counted.zero_energy_modes
        found.append(Sag(share, len(ends), modes, least, sag, ends, positions))
        tick()
    return Axis(
        name="diagonals",
        title="Springs that are missing",
        sentence=_sentence(net, found),
        columns=(
            f"share of {net.what} missing",
            "springs",
            "mechanisms",
            "least by Maxwell",
            "sag [m]",
        ),
        rows=[(s.share, s.springs, s.mechanisms, s.least, s.sag) for s in found],
        draw=lambda figure: _draw(figure, net, found, down),
        numbers={
            "net": net.name,
            "mechanisms_whole": found[0].mechanisms,
            "mechanisms_least_springs": found[-1].mechanisms,
            "sag_whole": found[0].sag,
            "sag_least_springs": found[-1].sag,
        },
        notes=[
            f"Measured on {net.name} under gravity, with drag, until it hangs still; mechanisms "
            "are counted in space, without pins, beyond rigid motion and for every loose piece.",
        ],
        size=(13.5, 4.4),
    )


def _sentence(net: Net, found: list[Sag]) -> str:
    whole, last = found[0], found[-1]
    first = next((s for s in found if s.mechanisms > whole.mechanisms), None)
    text = f"With all its {net.what}, {net.name} has {_count(whole)}"
    if first is None:
        return f"{text}, and {100 * last.share:g} % of them can go before it has more."
    text += f"; without {100 * first.share:g} % of them it has {first.mechanisms}"
    if first is not last:
        text += f", without {100 * last.share:g} % {last.mechanisms}"
    if whole.sag > 0.0:
        text += f" and sags {last.sag / whole.sag:.3g} times as far"
    return text + ": such a net is no solid, whatever its stiffness."


def _count(s: Sag) -> str:
    return f"{s.mechanisms or 'no'} mechanism{'s' if s.mechanisms != 1 else ''}"


def _draw(figure: Any, net: Net, found: list[Sag], down: Floats) -> None:
    count, sag, side = figure.subplots(1, 3, width_ratios=(1.0, 1.0, 1.35))
    x = [100.0 * s.share for s in found]
    count.plot(
        x,
        [s.least for s in found],
        color=pictures.BLACK,
        lw=1.4,
        label="at least, by Maxwell's count",
    )
    count.plot(x, [s.mechanisms for s in found], "o", color=pictures.ORANGE, label="counted")
    count.set_ylabel("mechanisms [1]")
    count.set_title("Missing springs leave mechanisms")
    sag.plot(x, [100.0 * s.sag / _size(net) for s in found], "o-", lw=1.2, color=pictures.ORANGE,
             label="mean sag under gravity")  # fmt: skip
    sag.set_ylabel("sag / size [%]")
    sag.set_title("… and the net sags")
    sag.set_ylim(0.0, None)
    for ax in (count, sag):
        ax.set_xlabel(f"{net.what} missing [%]")
        ax.legend(loc="upper left")
    _draw_side(side, net, found, down)


def _size(net: Net) -> float:
    return float(np.ptp(net.points, axis=0).max())


def _draw_side(ax: Any, net: Net, found: list[Sag], down: Floats) -> None:
    from matplotlib.collections import LineCollection

    across = np.eye(3) - np.outer(down, down)
    spread = np.ptp(net.points @ across, axis=0)
    axis = across[int(np.argmax(spread))]
    view = np.stack([axis / np.linalg.norm(axis), -down], axis=1)
    for s, color in ((found[-1], pictures.RED), (found[0], pictures.BLUE)):
        flat = s.positions @ view
        label = f"without {100 * s.share:g} % of its {net.what}"
        label = {0.0: f"with all {net.what}", 1.0: f"without {net.what}"}.get(s.share, label)
        ax.add_collection(
            LineCollection(flat[s.ends], colors=color, lw=0.6, alpha=0.8, label=label)
        )
    ax.autoscale()
    ax.set_aspect("equal", adjustable="datalim")
    ax.set_xlabel("across [m]")
    ax.set_ylabel("up [m]")
    ax.set_title("The same net with and without")
    for handle in ax.legend(loc="upper right").legend_handles:
        handle.set_linewidth(2.0)
