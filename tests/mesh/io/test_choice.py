import numpy as np
import pytest

from csm.errors import MeshError
from csm.mesh.io.choice import chosen, joined
from csm.mesh.io.raw import RawMesh


def test_one_shape_needs_no_choice_and_several_do():
    assert chosen(["a"], None) == [0]
    assert chosen(["a", "b", "c"], "all") == [0, 1, 2]
    assert chosen(["a", "b", "c"], np.int64(2)) == [2]
    with pytest.raises(MeshError, match=r"holds 8 shapes \(0, 1, 2, 3, 4, 5, \.\.\.\).*from 0 to 7"):
        chosen([str(i) for i in range(8)], None)


@pytest.mark.parametrize("wrong", [-1, 2, 1.5, "b"])
def test_a_choice_that_is_not_there(wrong):
    with pytest.raises(MeshError, match=r"there is no choose=.*holds 2 shapes \(a, b\), counted from 0"):
        chosen(["a", "b"], wrong)


def test_joined_shapes_keep_their_order_and_their_notes_once():
    one = RawMesh.of(np.eye(3), np.array([[0, 1, 2]]), ("note",))
    two = RawMesh(np.eye(3) * 2, np.array([0, 1, 2, 0, 1, 2, 2]), np.array([3, 4]), ("note", "other"))
    both = joined([one, two])
    np.testing.assert_array_equal(both.vertices, np.concatenate([np.eye(3), np.eye(3) * 2]))
    assert both.corners.tolist() == [0, 1, 2, 3, 4, 5, 3, 4, 5, 5]
    assert both.sizes.tolist() == [3, 3, 4]
    assert both.notes == ("note", "other", "2 shapes were joined, of 3, 3 vertices")
    assert joined([one]) is one
