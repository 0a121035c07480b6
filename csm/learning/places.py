r"""Where on the template each vertex of a shape is, as a descriptor.

A network's classifier says of each vertex x how probable it is that it is template point c, p_c(x).  The mean of the
template's eigenfunctions over these points is a row of K numbers,

.. math:: q_k(x) = \sum_c p_c(x) \, \varphi_k(c), \qquad k = 1 \ldots K,

the row of x in Pi Phi for the soft map Pi from the shape to the template.  Unlike the last layer of the network it
leaves out whatever does not change the place, and points that are neighbours on the template count as nearly the same.
"""

from __future__ import annotations

import logging
from collections.abc import Iterable

import torch
from torch import Tensor, nn
from torch.nn import functional

from csm.learning.samples import ShapeSample

LOG = logging.getLogger(__name__)


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

    def __init__(self, n_classes: int, k: int) -> None:
        super().__init__()
        if k < 2:
            raise ValueError(f"{k} eigenfunctions of the template; wanted 2 or more")
        self.register_buffer("functions", torch.zeros(n_classes, k))

    def learn(self, sample: ShapeSample) -> None:
        """Take the eigenfunctions of a shape for those of the template; points that the shape lacks have zeros.

        Raises
        ------
        ValueError
            If the basis of the shape has too few.
        """
        found, k = sample.surface.basis.evecs, self.functions.shape[1]
        if found.shape[1] < k:
            raise ValueError(f"wanted {k} eigenfunctions of the template, and the data hold {found.shape[1]}")
        self.functions.zero_()
        self.functions[sample.classes] = found[sample.rows, :k].to(self.functions)

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
        descriptor = descriptor.to(self.functions.dtype)
        parts = (descriptor[begin : begin + block] for begin in range(0, max(1, len(descriptor)), block))
        found = [torch.softmax(classifier(part), 1) @ self.functions for part in parts]
        return functional.normalize(torch.cat(found), dim=1)


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
