r"""Where on the template each vertex of a shape is, as a descriptor.

A network's classifier says of each vertex x how probable it is that it is template point c, p_c(x).  The mean of the
template's eigenfunctions over these points is a row of K numbers,

.. math:: q_k(x) = \sum_c p_c(x) \, \varphi_k(c), \qquad k = 1 \ldots K,

the row of x in Pi Phi for the soft map Pi from the shape to the template.  Unlike the last layer of the network it
leaves out whatever does not change the place, and points that are neighbours on the template count as nearly the same.

On a template with a left and a right side each point c has a twin on the other side.  With twins for points the same
probabilities say where x is if left and right are exchanged: in the mirror image of the shape.
"""

from __future__ import annotations

import logging
from collections.abc import Iterable
from typing import Any, NamedTuple

import torch
from torch import Tensor, nn
from torch.nn import functional

from csm.learning.samples import ShapeSample
from csm.mesh.shape import Mesh

LOG = logging.getLogger(__name__)

LATER = ("points", "normals", "twins")
"""What networks of older versions of csm do not know of their template."""

PARTS = ("functions", *LATER)
"""All that is known of a template, one row per point."""

UNKNOWN = -1
"""In place of the twin of a point, where there are none."""


class Reading(NamedTuple):
    """Where on the template the N vertices of a shape are.

    Shapes: `rows` (N, K), means of the eigenfunctions; `points` and `normals` (N, 3), means of the positions of the
    template's points, which has area 1, and of its outward normals there.
    """

    rows: Tensor
    points: Tensor
    normals: Tensor


class Places(nn.Module):
    """The template's eigenfunctions, and the descriptor that they make of a classifier's probabilities.

    Parameters
    ----------
    n_classes
        C, template points.
    k
        K, eigenfunctions, at least 2: the width of the descriptor.

    Raises
    ------
    ValueError
        If `k` is less than 2.

    Examples
    --------
    >>> Places(5000, 256).functions.shape
    torch.Size([5000, 256])
    """

    functions: Tensor
    points: Tensor
    normals: Tensor
    twins: Tensor

    def __init__(self, n_classes: int, k: int) -> None:
        super().__init__()
        if k < 2:
            raise ValueError(f"{k} eigenfunctions of the template; wanted 2 or more")
        self.register_buffer("functions", torch.zeros(n_classes, k))
        self.register_buffer("points", torch.zeros(n_classes, 3))
        self.register_buffer("normals", torch.zeros(n_classes, 3))
        self.register_buffer("twins", torch.full((n_classes,), UNKNOWN))

    @property
    def has_twins(self) -> bool:
        """Whether the template's left and right are known."""
        return bool((self.twins != UNKNOWN).all())

    @property
    def is_whole(self) -> bool:
        """Whether the twins are points of a template whose surface is known, or all unknown."""
        among = (self.twins >= 0) & (self.twins < len(self.twins))
        return bool((self.twins == UNKNOWN).all() or (among.all() and self.normals.any()))

    def learn(self, sample: ShapeSample, mesh: Mesh) -> None:
        """Take the surface of a shape for that of the template; points that the shape lacks have zeros.

        Parameters
        ----------
        sample
            The shape, with at least K eigenpairs.
        mesh
            Its mesh.

        Raises
        ------
        ValueError
            If the basis of the shape has too few.
        """
        found, k = sample.surface.basis.evecs, self.functions.shape[1]
        if found.shape[1] < k:
            raise ValueError(f"wanted {k} eigenfunctions of the template, and the data hold {found.shape[1]}")
        points = (mesh.vertices - mesh.vertices.mean(0)) / mesh.area**0.5  # of a size that half precision can hold
        given = found[:, :k], torch.as_tensor(points), torch.as_tensor(mesh.vertex_normals)
        for own, values in zip((self.functions, self.points, self.normals), given, strict=True):
            own.zero_()
            own[sample.classes] = values[sample.rows].to(own)

    def forward(self, descriptor: Tensor, classifier: nn.Module, block: int = 1024) -> Tensor:
        """Return the places, rows of unit length.

        Parameters
        ----------
        descriptor
            Shape (N, Q): the network's last layer.
        classifier
            Over the C template points, from shape (n, Q) to (n, C).
        block
            Vertices at a time, which bounds the memory.

        Returns
        -------
        Tensor
            Shape (N, K).
        """
        return functional.normalize(self._means(descriptor, classifier, self.functions, block), dim=1)

    def read(self, descriptor: Tensor, classifier: nn.Module, *, twins: bool = False, block: int = 1024) -> Reading:
        """Return the places, or with `twins` those on the other side; further parameters as of `forward`."""
        table = torch.cat([self.functions, self.points, self.normals], 1)
        means = self._means(descriptor, classifier, table[self.twins] if twins else table, block)
        return Reading(means[:, :-6], means[:, -6:-3], means[:, -3:])

    def _means(self, descriptor: Tensor, classifier: nn.Module, table: Tensor, block: int) -> Tensor:
        """Return the means of the rows of a table, shape (C, D), over the probable points, shape (N, D)."""
        descriptor = descriptor.to(table.dtype)
        parts = (descriptor[begin : begin + block] for begin in range(0, max(1, len(descriptor)), block))
        return torch.cat([torch.softmax(classifier(part), 1) @ table for part in parts])

    def _load_from_state_dict(self, state_dict: dict[str, Any], prefix: str, *args: Any, **kwargs: Any) -> None:
        """Load; a network of an older csm has eigenfunctions alone."""
        for name in LATER:
            state_dict.setdefault(prefix + name, getattr(self, name))
        super()._load_from_state_dict(state_dict, prefix, *args, **kwargs)


def template_of(samples: Iterable[ShapeSample]) -> ShapeSample:
    """Return the shape that knows most points of the template, the first of such, which then stands for it.

    A warning is logged where some of the points that others know are missing.
    """
    shapes = list(samples)
    known = [set(sample.classes.tolist()) for sample in shapes]
    most = max(range(len(shapes)), key=lambda i: len(known[i]))
    best, missing = shapes[most], len(set().union(*known)) - len(known[most])
    if missing:
        LOG.warning(
            "learning.places: %s stands for the template, and lacks %d of the points that other shapes know; vertices "
            "there are described by the others alone",
            best.name,
            missing,
        )
    return best
