"""Cages: exact moments of what a surface fills, axes, masses, carried points, bad surfaces."""

import meshio
import numpy as np
import pytest
from surfaces import block, prongs, sphere, turn

import tisoft as ts
from tisoft.check.meshes import mesh_notes
from tisoft.check.warnings import warnings_of
from tisoft.geometry.cage.build import caged, split_long
from tisoft.geometry.cage.cutting import cut
from tisoft.geometry.cage.lattice import Lattice
from tisoft.geometry.cage.moments import filled
from tisoft.geometry.cage.thickness import thinnest
from tisoft.geometry.surface import closed, joined, read_surface, solid_moments

SIZE = np.array([0.5, 0.1, 0.08])


def lattice_over(points, edge, offset=0.0, axes=None):
    """Cubes of an edge whose first one the box's corner lies in, `offset` cells from its own."""
    axes = np.eye(3) if axes is None else axes
    local = points @ axes
    low = local.min(axis=0) - np.broadcast_to(offset, 3) * edge
    cells = np.ceil((local.max(axis=0) - low) / edge - 1e-9).astype(int)
    return Lattice(axes, axes @ low, np.full(3, edge), cells)


def test_a_shifted_box_fills_cells_as_it_should():
    """Fill and means are products of one-dimensional ones."""
    points, triangles = block(SIZE)
    edge, offset = 0.02, 0.3
    lattice = lattice_over(points, edge, offset)
    found = filled(cut(lattice.local(points), triangles, lattice.cells), lattice)
    assert len(found.cells) == lattice.cells.prod()
    low = np.maximum(found.cells, offset)
    high = np.minimum(found.cells + 1, offset + SIZE / edge)
    middle = low + high - 2 * found.cells - 1
    assert found.moments[:, 0] == pytest.approx((high - low).prod(axis=1), abs=1e-13)
    assert found.moments[:, 1:4] == pytest.approx(middle, abs=1e-12)
    pairs = middle[:, [1, 0, 0]] * middle[:, [2, 2, 1]]
    assert found.moments[:, 4:] == pytest.approx(pairs, abs=1e-12)


@pytest.mark.parametrize("degrees", [0.0, 33.0])
def test_cells_add_up_to_the_body(degrees):
    """Volume and centre, of a ball with a hole in the middle; the full cells have no moments."""
    outer, rows = sphere(0.2, 12)
    inner, own = sphere(0.09, 6)
    points = np.concatenate([outer, inner]) @ turn([1, 2, 3], degrees).T + [1.0, -2.0, 3.0]
    points, triangles = joined(points, np.concatenate([rows, own[:, ::-1] + len(outer)]))
    triangles, turned = closed(points, triangles)
    assert not turned
    lattice = lattice_over(points, 0.03, 0.37)
    found = filled(cut(lattice.local(points), triangles, lattice.cells), lattice)
    fill, means = found.moments[:, 0], found.moments[:, 1:4]
    volume, first, _ = solid_moments(points, triangles)
    assert fill.sum() * 0.03**3 == pytest.approx(volume, rel=1e-12)
    center = fill @ (found.cells + 0.5 + means / 2) / fill.sum()
    assert lattice.world(center) == pytest.approx(first / volume, abs=1e-13)
    full = np.abs(fill - 1) < 1e-14
    assert full.sum() > 200
    assert np.abs(means[full]).max() < 1e-12


def test_volume_centre_and_inertia_of_a_ball():
    points, triangles = sphere(0.2, 40)
    volume, first, second = solid_moments(points + np.array([5, 0, 0]), triangles)
    exact = 4 / 3 * np.pi * 0.2**3
    assert volume == pytest.approx(exact, rel=2e-3)
    assert first / volume == pytest.approx([5, 0, 0], abs=1e-12)
    spread = second / volume - np.outer([5, 0, 0], [5, 0, 0])
    assert spread == pytest.approx(np.eye(3) * 0.2**2 / 5, rel=3e-3, abs=1e-12)


def test_the_lattice_follows_the_body():
    """A box turned in space is a mesh of whole cells; a ball takes the world's axes."""
    R = turn([1, 1, 1], 30)
    points, triangles = block(SIZE)
    mesh = ts.cage(points @ R.T + 3, triangles, size=0.02)
    assert mesh.elements == 25 * 5 * 4
    assert mesh.volumes == pytest.approx(np.full(500, 8e-6), rel=1e-9)
    assert mesh.cage.lattice.is_turned
    assert not ts.cage(*sphere(0.1, 6), cells_across=4).cage.lattice.is_turned
    moved = mesh.transformed(scale=2.0, rotate=(10, 20, 30))
    assert moved.volumes == pytest.approx(8 * mesh.volumes)
    assert moved.cage is mesh.cage


def test_masses_have_the_bodys_mass_centre_and_inertia():
    points, triangles = block((0.3, 0.2, 0.2))
    points = points @ turn([1, 2, 3], 25).T
    mesh = caged(points, triangles, lattice_over(points, 0.04, 0.41))
    fill = np.bincount(mesh.hexes.ravel(), np.repeat(mesh.volumes / 8, 8))
    mass = fill * mesh.cage.factor
    volume, first, second = solid_moments(points, triangles)
    assert mesh.cage.inertia_error < 1e-9
    assert mass.min() > 0
    assert mass.sum() == pytest.approx(volume, rel=1e-10)
    assert mass @ mesh.points == pytest.approx(first, abs=1e-10 * volume)
    own = np.einsum("n,ni,nj->ij", mass, mesh.points, mesh.points)
    assert own == pytest.approx(second, rel=1e-8, abs=1e-9 * volume)


def test_the_surface_is_carried_exactly_where_it_was():
    points, triangles = sphere(0.2, 10)
    mesh = ts.cage(points, triangles, cells_across=7)
    skin = mesh.cage.skin
    gradient = np.random.default_rng(1).normal(size=(3, 3))
    there = skin.carried(mesh.points @ gradient.T + 1.0)
    places = joined(points, triangles)[0]  # the file's own come first
    assert there[: len(places)] == pytest.approx(places @ gradient.T + 1.0, abs=1e-12)
    assert skin.weights.sum(axis=1) == pytest.approx(1.0)


def test_long_triangles_are_split_for_drawing():
    points, triangles = split_long(*block((1.0, 0.2, 0.2)), 0.11)
    closed(points, triangles)
    assert solid_moments(points, triangles)[0] == pytest.approx(0.04)
    sides = points[triangles] - np.roll(points[triangles], 1, axis=1)
    assert np.linalg.norm(sides, axis=2).max() < 0.111


def open_block():
    points, triangles = block((1, 1, 1))
    return points, triangles[:-1]


def inside_out_side():
    points, triangles = block((1, 1, 1))
    return points, np.concatenate([triangles[:-2], triangles[-2:, ::-1]])


def crossing():
    points, triangles = block((1, 1, 1))
    return np.concatenate([points, points + 0.5]), np.concatenate([triangles, triangles + 8])


@pytest.mark.parametrize(
    "surface, keys, told",
    [
        (open_block, {"size": 0.3}, r"is open: 3 edges .* as that at \(1, .*close the holes"),
        (inside_out_side, {"size": 0.3}, "disagree about what is outside at 4 edges"),
        (crossing, {"size": 0.1}, r"encloses a place twice near \("),
        (lambda: block((1, 1, 1)), {"size": 1e-4}, "more than 50,000,000 cells; take larger"),
        (lambda: block((1, 1, 1)), {"size": 3}, "is smaller than one cell of 3 m"),
        (lambda: block((1, 1, 0)), {"size": 0.1}, "encloses no volume"),
        (lambda: (np.zeros((3, 3)), [[0, 1, 2]]), {"size": 0.1}, "this one has none"),
    ],
)
def test_what_is_no_closed_surface_is_refused_with_the_place(surface, keys, told):
    with pytest.raises(ts.MeshError, match=told):
        ts.cage(*surface(), **keys)


def test_a_surface_that_faces_inward_is_turned_and_told():
    points, triangles = block((1, 1, 1))
    mesh = ts.cage(points, triangles[:, ::-1], cells_across=2)
    assert mesh.volumes.sum() == pytest.approx(1.0)
    assert "turned round" in mesh.notes[0]


@pytest.mark.parametrize("suffix", [".stl", ".obj", ".ply", ".off", ".vtp"])
def test_surface_files(tmp_path, suffix):
    points, triangles = sphere(0.2, 4)
    path = tmp_path / f"ball{suffix}"
    if suffix == ".vtp":
        path.write_text(vtp_of(points, triangles))
    else:
        meshio.write(path, meshio.Mesh(points, [("triangle", triangles.astype(np.int32))]))
    found = read_surface(path)
    assert len(found[1]) == len(triangles)
    assert closed(*found)[1] is False
    volume = solid_moments(*joined(points, triangles))[0]
    assert solid_moments(*found)[0] == pytest.approx(volume, rel=1e-5)


def vtp_of(points, triangles):
    def array(name, kind, values):
        text = " ".join(str(x) for x in np.ravel(values).tolist())
        return f'<DataArray Name="{name}" type="{kind}" format="ascii">{text}</DataArray>'

    ends = 3 * np.arange(1, len(triangles) + 1)
    return (
        '<VTKFile type="PolyData" byte_order="LittleEndian"><PolyData>'
        f'<Piece NumberOfPoints="{len(points)}" NumberOfPolys="{len(triangles)}">'
        f"<Points>{array('Points', 'Float64', points)}</Points>"
        f"<Polys>{array('connectivity', 'Int64', triangles)}{array('offsets', 'Int64', ends)}"
        "</Polys></Piece></PolyData></VTKFile>"
    )


@pytest.mark.parametrize("thick, degrees", [(0.02, 0), (0.02, 25), (0.033, 40)])
def test_the_thinnest_part_is_measured_at_any_angle(thick, degrees):
    points, triangles = block((0.4, 0.3, thick))
    points = points @ turn([1, 2, 0], degrees).T
    assert thinnest(points, triangles, lattice_over(points, 0.025, 0.3)) == pytest.approx(thick)


def test_check_tells_what_a_cage_cannot_do():
    points, triangles = block((0.4, 0.3, 0.04))
    mesh = caged(points, triangles, lattice_over(points, 0.025, 0.3))
    scene = ts.Scene()
    body = scene.add_body(mesh, ts.ViscoElastic(1e5, 0.3, 1000.0), "plate")
    body.pin(ts.where.nodes([0]))
    told = "\n".join(warnings_of(scene) + mesh_notes(body))
    assert "has 1.6 cells through its thinnest part: that bends about 19 % too stiffly" in told
    assert "is held by pin[0] within half a cell" in told
    assert "cells of 0.025 x 0.025 x 0.025 m along the world's axes" in told
    forked = scene.add_body(ts.cage(*prongs(0.006), size=0.0187), body.model, "fork")
    assert " of which hold parts that do not touch" in "\n".join(mesh_notes(forked))
    fitted = ts.Scene()
    fitted.add_body(ts.cage(points, triangles, cells_across=1), body.model)
    assert not [line for line in warnings_of(fitted) if "thinnest" in line]
