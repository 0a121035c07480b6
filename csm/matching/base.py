"""Descriptions of meshes, and the base class of the matchers that make maps from them."""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from csm._types import Float32Array, IntArray
from csm.data.prepare import Recipe, shared_operators
from csm.data.store import Store
from csm.descriptors.constant import Constant
from csm.errors import ConfigError
from csm.matching.embedded import Embedded, n_eigenfunctions, spread_vertices
from csm.matching.maps import VertexMap
from csm.matching.rows import as_array, is_tensor
from csm.mesh.debris import unit_area
from csm.mesh.shape import Mesh
from csm.operators import Spectrum

if TYPE_CHECKING:
    from torch import Tensor


class Classifier(NamedTuple):
    """A linear classifier over the C template points: `weight`, shape (C, Q), and `bias`, shape (C,)."""

    weight: Tensor
    bias: Tensor


NO_CLASSIFIER = (
    "matching=argmax needs a trained network with its classifier; a descriptor has none, and an export leaves it out: "
    "use the .ckpt file"
)


@dataclass(frozen=True, eq=False)
class Votes:
    """What a classifier over the template says of one shape.

    Parameters
    ----------
    classes
        Shape (N,): for each vertex the template point of greatest probability.
    vertices
        Shape (C,): for each template point the vertex that gives it the greatest probability.
    """

    classes: IntArray
    vertices: IntArray


def votes(features: Tensor, classifier: Classifier, *, block: int = 1024) -> Votes:
    """Let a linear classifier with softmax decide, in blocks of bounded memory.

    Parameters
    ----------
    features
        Shape (N, Q), on the device that is to do the work.
    classifier
        Over C template points.
    block
        Vertices at a time.

    Raises
    ------
    ConfigError
        If a number is not finite.
    """
    import torch

    weight, bias = (tensor.to(features.device) for tensor in classifier)
    if not torch.isfinite(features).all():
        raise ConfigError("argmax: a descriptor is not finite, so no class is the most probable; look at the features")
    classes, n = [], len(weight)
    best = torch.full((n,), -torch.inf, device=features.device)
    vertices = torch.zeros(n, dtype=torch.int64, device=features.device)
    with torch.no_grad():
        for begin in range(0, len(features), block):
            scores = torch.log_softmax(torch.addmm(bias, features[begin : begin + block], weight.T), 1)
            classes.append(scores.argmax(1))
            score, row = scores.max(0)
            vertices = torch.where(score > best, row + begin, vertices)
            best = torch.maximum(score, best)
    return Votes(torch.cat(classes).cpu().numpy(), vertices.cpu().numpy())


def require_device(device: str) -> str:
    """Return the name of a device if PyTorch can use it here.

    Raises
    ------
    ConfigError
        If there is no such device.

    Examples
    --------
    >>> require_device("cpu")
    'cpu'
    """
    if device == "cpu":
        return device
    import torch

    try:
        torch.zeros(1, device=device).item()  # a device without numbers, such as "meta", is of no use
    except (RuntimeError, AssertionError, NotImplementedError) as error:
        known = re.match(r"(cpu|cuda|mps|xpu|meta)(:\d+)?$", str(device))
        why = str(error).splitlines()[0] if known else "it knows no such device; wanted cpu, cuda, cuda:1 or mps"
        raise ConfigError(f"device={device}: PyTorch cannot use it here ({why}); device=cpu always works") from error
    return device


@dataclass(frozen=True, eq=False)
class Described:
    """A mesh with its description by a method.

    Parameters
    ----------
    mesh
        The shape, at the scale it was given.
    rows
        Shape (N, Q), the features of the vertices: a tensor, or an array, with which matching runs on the processor.
    classifier
        Over the template points, if the method is a network that has one.
    store
        Where eigenpairs are looked up and kept; without one they are computed.
    given
        Shape (N, Q'): the handcrafted descriptor that a network was given; None for other methods.
    classified
        Shape (N, Q''): what the classifier takes; None if it takes the features.
    """

    mesh: Mesh
    rows: NDArray[Any] | Tensor
    classifier: Classifier | None = None
    store: Store | None = None
    given: Tensor | None = None
    classified: Tensor | None = None

    def __repr__(self) -> str:
        return f"Described({self.mesh!r}, {self.rows.shape[1]} features)"

    @cached_property
    def features(self) -> Tensor:
        """The rows as a tensor, on the device where matching runs."""
        import torch

        return torch.as_tensor(self.rows)

    @cached_property
    def values(self) -> Float32Array:
        """The rows as an array of float32."""
        return as_array(self.rows).astype(np.float32, copy=False)

    @cached_property
    def votes(self) -> Votes:
        """What the classifier says; ConfigError if there is none."""
        if self.classifier is None:
            raise ConfigError(NO_CLASSIFIER)
        return votes(self.features if self.classified is None else self.classified, self.classifier)

    def spectrum(self, k: int) -> Spectrum:
        """Return the first `k` Laplace-Beltrami eigenpairs of the mesh at unit area."""
        store = self.store or Store()
        return shared_operators(self.mesh, [Recipe(Constant(), k)], store).lbo(k)

    @cached_property
    def embedded(self) -> Embedded:
        """The mesh at unit area with its eigenfunctions, as refinements compute with them."""
        spectrum = self.spectrum(n_eigenfunctions(self.mesh))
        device = self.rows.device if is_tensor(self.rows) else "cpu"
        return Embedded(unit_area(self.mesh), spectrum, device, self.order)

    @cached_property
    def order(self) -> IntArray:
        """Vertices spread over the shape, see `csm.matching.embedded.spread_vertices`."""
        return spread_vertices(self.mesh)


class Matcher(ABC):
    """A rule that makes a map from the descriptions of two shapes; its fields are its parameters.

    A matcher is a frozen dataclass.  It is added to csm by one file here and one line in `csm.matching.registry`.
    """

    name: ClassVar[str]
    by_classifier: ClassVar[bool] = False
    """Whether it needs a method with a classifier over the template points."""

    @abstractmethod
    def __call__(self, source: Described, target: Described, at: IntArray | None = None) -> VertexMap:
        """Map the vertices of the source to those of the target.

        Parameters
        ----------
        source, target
            The shapes, described by one method.
        at
            Vertices of the source that are asked for, such as those with known ground truth; others may have -1.
            None for all.
        """

    def parameters(self) -> dict[str, Any]:
        """Return every parameter as plain data: with `name`, all that a cache key needs."""
        return asdict(self)  # type: ignore[call-overload,no-any-return]
