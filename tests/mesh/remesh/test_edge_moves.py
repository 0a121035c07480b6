"""Edge tables, splits, flips and collapses on small meshes where the outcome is known."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from csm.mesh.remesh import edge_moves
from csm.mesh.remesh.edge_moves import EdgeTable, edge_table
from tests.shapes import blob, plane

SQUARE = np.array([[0, 1, 2], [0, 2, 3]])


def is_sound(faces: np.ndarray, n: int) -> bool:
    """Edge-manifold and oriented: no directed edge comes twice."""
    directed = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    return len(np.unique(directed @ [n, 1])) == len(directed)


def euler(faces: np.ndarray) -> int:
    return len(np.unique(faces)) - len(edge_table(faces).ends) + len(faces)


def row_of(table: EdgeTable, a: int, b: int) -> np.ndarray:
    return np.flatnonzero((table.ends == sorted((a, b))).all(axis=1))


def test_edge_table_of_a_square() -> None:
    table = edge_table(SQUARE)
    assert table.ends.tolist() == [[0, 1], [0, 2], [0, 3], [1, 2], [2, 3]]
    diagonal = row_of(table, 0, 2)[0]
    assert table.faces[diagonal].tolist() == [1, 0]  # face 1 runs 0 -> 2, face 0 runs 2 -> 0
    assert table.opposite[diagonal].tolist() == [3, 1]
    assert table.inner.sum() == 1
    assert edge_moves.boundary_vertices(table, 4).all()
    np.testing.assert_array_equal(
        np.sort(table.ends[table.of_faces(2)].reshape(2, -1)), [[0, 0, 1, 1, 2, 2], [0, 0, 2, 2, 3, 3]]
    )


def test_edge_table_agrees_with_trimesh() -> None:
    mesh = blob(2)
    table = edge_table(mesh.faces)
    expected = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    np.testing.assert_array_equal(table.ends, np.unique(expected.edges_unique, axis=0))
    np.testing.assert_array_equal(
        np.sort(table.ends[table.of_faces(mesh.n_faces)].reshape(-1, 6))[:, ::2], np.sort(mesh.faces)
    )


def test_flip_turns_the_diagonal_and_a_second_flip_turns_it_back() -> None:
    once = edge_moves.flip(SQUARE, edge_table(SQUARE), row_of(edge_table(SQUARE), 0, 2))
    assert row_of(edge_table(once), 1, 3).size == 1
    assert row_of(edge_table(once), 0, 2).size == 0
    twice = edge_moves.flip(once, edge_table(once), row_of(edge_table(once), 1, 3))
    np.testing.assert_array_equal(edge_table(twice).ends, edge_table(SQUARE).ends)


def test_a_flip_never_doubles_an_edge() -> None:
    tetrahedron = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
    table = edge_table(tetrahedron)
    np.testing.assert_array_equal(edge_moves.flip(tetrahedron, table, np.array([0])), tetrahedron)


@pytest.mark.parametrize("make", [lambda: blob(2), plane])
def test_many_independent_splits_flips_and_collapses_keep_the_topology(make) -> None:
    mesh = make()
    rng = np.random.default_rng(0)
    faces, n, chi = mesh.faces, mesh.n_vertices, euler(mesh.faces)
    for _ in range(6):
        table = edge_table(faces)
        chosen = edge_moves.independent(table, np.arange(len(table.ends)), rng.random(len(table.ends)), len(faces))
        assert np.bincount(table.faces[chosen][table.faces[chosen] >= 0]).max() == 1
        faces, n = edge_moves.split(faces, table, chosen, n), n + len(chosen)
        assert is_sound(faces, n)
        table = edge_table(faces)
        inner = np.flatnonzero(table.inner)
        faces = edge_moves.flip(faces, table, edge_moves.independent(table, inner, rng.random(len(inner)), len(faces)))
        assert is_sound(faces, n)
        table = edge_table(faces)
        edges = np.flatnonzero(edge_moves.collapsible(table, np.arange(len(table.ends)), n))
        rim = edge_moves.boundary_vertices(table, n)[table.ends[edges]]
        side = np.where(rim[:, 0], 1, 0) * np.where(rim.all(axis=1), 0, 1)  # a boundary vertex stays
        gone, kept = np.take_along_axis(table.ends[edges], np.column_stack([side, 1 - side]), axis=1).T
        chosen = edge_moves.independent_collapses(table, gone, kept, rng.random(len(gone)), n)
        assert len(chosen) > len(np.unique(faces)) / 40
        before = len(np.unique(faces))
        faces = edge_moves.collapse(faces, gone[chosen], kept[chosen])
        assert len(np.unique(faces)) == before - len(chosen)
        assert is_sound(faces, n)
        assert euler(faces) == chi


def test_the_link_condition_refuses_what_would_pinch_the_surface() -> None:
    """An edge of a triangular tube: its ends have a common neighbour beyond the two of its faces."""
    ring = np.arange(3)
    below, above = ring, ring + 3
    nxt = (ring + 1) % 3
    faces = np.concatenate([np.column_stack([below, nxt, nxt + 3]), np.column_stack([below, nxt + 3, above])])
    faces = np.concatenate([faces, faces[:, :] + 3])  # two storeys, open at both ends
    table = edge_table(faces)
    middle = row_of(table, 3, 4)
    assert not edge_moves.collapsible(table, middle, 9)[0]
    assert not edge_moves.collapsible(edge_table(SQUARE), row_of(edge_table(SQUARE), 0, 2), 4)[0]
