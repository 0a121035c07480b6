from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.io
import trimesh

from csm.descriptors import ACD
from csm.errors import ConfigError
from csm.mesh.io import read_mesh
from csm.mesh.shape import Mesh
from csm.operators import Operators
from tests.shapes import blob, rotation, sphere


def paper(**changes) -> ACD:
    return replace(ACD.paper(), **changes)


def mirrored(mesh: Mesh) -> Mesh:
    return replace(mesh, vertices=mesh.vertices * np.array([-1.0, 1.0, 1.0]), faces=mesh.faces[:, ::-1])


def blocks(descriptor: ACD, mesh: Mesh) -> np.ndarray:
    """The descriptor with its columns taken apart, (N, J, D + 1)."""
    values = descriptor(mesh).values
    return values.reshape(len(values), descriptor.angles, -1)


def test_against_a_loop_over_angles_orders_and_pairs():
    descriptor, operators = paper(alpha=6.0, angles=3, k=5, order=4), Operators(blob(2))
    features = descriptor(operators)
    column = 0
    for j in range(3):
        spectrum = operators.albo(6.0, np.pi * j / 3, 5)
        for d in range(5):
            expected = np.zeros(operators.mesh.n_vertices)
            for value, vector in zip(spectrum.evals, spectrum.evecs.T, strict=True):
                x = 2 * value / spectrum.evals[-1] - 1
                expected += np.cos(d * np.arccos(np.clip(x, -1, 1))) * vector**2
            np.testing.assert_allclose(features.values[:, column], expected, atol=1e-9 * np.abs(expected).max())
            assert features.columns[column] == f"theta={np.pi * j / 3:.3f} T{d}"
            column += 1
    assert column == features.values.shape[1]


def test_the_sizes_and_settings_of_paper_and_release():
    assert len(ACD.paper().columns) == 140
    assert len(ACD.release().columns) == 48
    assert len(ACD().columns) == 640
    np.testing.assert_allclose(ACD.paper().thetas, np.pi * np.arange(20) / 20)
    length = np.linalg.norm(ACD.release()(blob(2)).values, axis=1)
    np.testing.assert_allclose(length, 1, atol=1e-12)


@pytest.mark.parametrize("angles", [8, 5])
def test_mirror_image_reverses_the_angles(angles):
    descriptor, mesh = paper(angles=angles, k=20), blob(3)
    original, image = blocks(descriptor, mesh), blocks(descriptor, mirrored(mesh))
    scale = np.abs(original).max()
    np.testing.assert_allclose(image, original[:, -np.arange(angles) % angles], atol=1e-8 * scale)
    assert np.abs(image - original).max() > 1e-2 * scale


@pytest.mark.parametrize("descriptor", [ACD(angles=5), ACD.release(frame="smooth"), ACD.two_bands()])
def test_the_columns_of_a_mirror_image_are_known(descriptor):
    mesh = blob(2)
    original, image = descriptor(mesh).values, descriptor(mirrored(mesh)).values
    columns = descriptor.mirrored_columns()
    np.testing.assert_allclose(image, original[:, columns], atol=1e-7 * np.abs(original).max())
    np.testing.assert_array_equal(columns[columns], np.arange(len(columns)))
    assert np.abs(image - original).max() > 1e-2 * np.abs(original).max()


def test_a_frame_of_the_world_has_no_mirrored_columns():
    with pytest.raises(ConfigError, match="not known how its columns change"):
        ACD.release(frame="released").mirrored_columns()


def test_inside_out_reverses_the_angles_and_turns_them_by_a_right_angle():
    descriptor, mesh = paper(angles=8, k=20), blob(3)
    turned = blocks(descriptor, replace(mesh, faces=mesh.faces[:, ::-1]))
    expected = blocks(descriptor, mesh)[:, (4 - np.arange(8)) % 8]
    np.testing.assert_allclose(turned, expected, atol=1e-8 * np.abs(expected).max())


def test_left_and_right_need_three_angles():
    mesh = blob(3)
    for angles, apart in ((1, False), (2, False), (3, True)):
        descriptor = paper(angles=angles, k=20)
        original, image = descriptor(mesh).values, descriptor(mirrored(mesh)).values
        assert np.allclose(image, original, atol=1e-7 * np.abs(original).max()) is not apart


def test_released_frame_is_not_invariant_to_rotation():
    mesh = blob(3)
    moved = replace(mesh, vertices=mesh.vertices @ rotation(5).T)
    descriptor = ACD.release(frame="released", sweeps=10)
    assert np.abs(descriptor(moved).values - descriptor(mesh).values).max() > 1e-3


def test_isotropic_needs_no_frame_and_is_one_block():
    mesh = blob(2)
    descriptor = paper(alpha=0.0, angles=1, k=20)
    near = paper(alpha=1e-9, angles=1, k=20)
    np.testing.assert_allclose(descriptor(mesh).values, near(mesh).values, rtol=1e-4, atol=1e-6)
    with pytest.raises(ConfigError, match="angles=1"):
        ACD(alpha=0.0)


@pytest.mark.parametrize(
    "wrong",
    [
        {"alpha": -1},
        {"angles": 0},
        {"k": 1},
        {"order": -1},
        {"alpha": float("nan")},
        {"cuts": 0},
        {"cuts": 11},
        {"damping": -1},
    ],
)
def test_settings_out_of_range_are_refused(wrong):
    with pytest.raises(ConfigError, match="wanted"):
        ACD(**wrong)


def test_as_many_components_as_pairs_are_no_error():
    twins = Mesh(
        np.concatenate([sphere(1).vertices, sphere(1).vertices + 5]),
        np.concatenate([sphere(1).faces, sphere(1).faces + 42]),
    )
    values = paper(k=2)(twins).values
    assert np.isfinite(values).all()


def test_centred_columns_have_no_mean_over_the_surface():
    operators = Operators(blob(3))
    plain, centred = (paper(angles=3, centred=flag)(operators).values for flag in (False, True))
    np.testing.assert_allclose(operators.mass @ centred, 0, atol=1e-12)
    np.testing.assert_allclose(plain - centred, np.tile(operators.mass @ plain, (len(plain), 1)), atol=1e-12)


def test_every_cut_is_the_descriptor_of_so_many_pairs():
    operators = Operators(blob(2))
    several = paper(angles=3, k=7, order=2, cuts=3)(operators)
    for column, name in enumerate(several.columns):
        _, k, polynomial = name.split()
        single = paper(angles=3, k=int(k.removeprefix("K=")), order=2)(operators)
        alone = single.columns.index(name.replace(f" {k}", ""))
        assert polynomial in single.columns[alone]
        np.testing.assert_array_equal(several.values[:, column], single.values[:, alone])
    assert {name.split()[1] for name in several.columns} == {"K=7", "K=6", "K=5"}


@pytest.mark.data
def test_released_settings_reproduce_the_authors_descriptor(data_set):
    """Median row error 0.053 here; what is left follows LAPACK's arbitrary signs in the authors' frame."""
    folder = data_set("FAUST_6890")
    theirs = scipy.io.loadmat(folder / "ACD" / "tr_reg_000.mat")["desc"]
    descriptor = ACD.release(frame="released", sweeps=10)
    ours = blocks(descriptor, read_mesh(folder / "shapes" / "tr_reg_000.mat"))

    def error(values: np.ndarray) -> float:
        return float(np.median(np.linalg.norm(values.reshape(theirs.shape) - theirs, axis=1)))

    assert error(ours) < 0.08
    assert error(ours[:, -np.arange(8) % 8]) > 0.2  # the angle turned the other way
    assert min(error(np.roll(ours, shift, axis=1)) for shift in range(1, 8)) > 0.2


def test_damping_divides_each_degree_and_is_named_only_where_there_is_any():
    operators = Operators(blob(2))
    plain, damped = (paper(angles=3, k=7, order=3, cuts=2, damping=d) for d in (0.0, 0.5))
    expected = plain(operators).values.reshape(-1, 6, 4) / np.sqrt([1, 2, 3, 4])
    np.testing.assert_allclose(damped(operators).values.reshape(-1, 6, 4), expected)
    assert damped.parameters() == {**plain.parameters(), "damping": 0.5}
    assert ACD().damping == 0.5


def moved(mesh: Mesh, scale: float) -> Mesh:
    return Mesh(scale * mesh.vertices, mesh.faces)


def test_each_component_has_the_spectrum_that_it_has_alone():
    """A small component gets no eigenfunction among the few smallest of the whole, and yet has a descriptor."""
    big, small = blob(3), moved(blob(2, seed=5), 0.3)
    faces = np.vstack([big.faces, small.faces + big.n_vertices])
    both = Mesh(np.vstack([big.vertices, small.vertices + 5]), faces)
    values = ACD.paper()(both).values
    area = both.area
    for mesh, rows in ((big, values[: big.n_vertices]), (small, values[big.n_vertices :])):
        alone = ACD.paper()(Operators(Mesh(mesh.vertices / np.sqrt(area), mesh.faces), unit_area=False)).values
        np.testing.assert_allclose(rows, alone, rtol=1e-5, atol=1e-6 * np.abs(alone).max())
    assert len(np.unique(np.round(values[big.n_vertices :], 6), axis=0)) > 8


def test_a_mesh_with_fewer_vertices_than_eigenpairs_uses_those_that_there_are_and_says_so_once(caplog):
    cube = trimesh.creation.box()
    box = Mesh(cube.vertices, cube.faces, "box")
    assert ACD()(box).shape == (8, 640)
    assert [record.getMessage() for record in caplog.records] == [
        "box: the mesh has fewer vertices than the 11 eigenpairs that are asked for (descriptor.k); acd takes as many "
        "as there are vertices (8)"
    ]
    caplog.clear()
    ACD(k=8)(box)
    assert not caplog.records
    ball = blob(2)
    both = Mesh(np.vstack([ball.vertices, box.vertices + 5]), np.vstack([ball.faces, box.faces + ball.n_vertices]), "x")
    ACD()(both)
    assert len(caplog.records) == 1
    assert "x: 1 component has fewer vertices than the 11 eigenpairs" in caplog.text
    with pytest.raises(ConfigError, match="k=100000; wanted at most 642, the vertices of blob"):
        ACD(k=100_000)(blob(3))


def test_a_whole_damping_is_a_number_as_others_are():
    mesh = blob(2)
    np.testing.assert_array_equal(ACD(damping=1)(mesh).values, ACD(damping=1.0)(mesh).values)
