"""Methods: ways to describe a mesh under one interface, with everything that identifies them as plain data.

A handcrafted descriptor is a `DescriptorMethod`, a trained network a `csm.matching.network.NetworkMethod`.
"""

from __future__ import annotations

import hashlib
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

from csm._counts import counted
from csm._parallel import thread_map
from csm._places import load
from csm._types import FloatArray
from csm.data.prepare import Recipe, features_of
from csm.data.store import Store
from csm.descriptors.base import Descriptor, record
from csm.descriptors.presets import preset
from csm.errors import ConfigError
from csm.matching.base import NO_CLASSIFIER, Described, Matcher
from csm.matching.shipped import shipped_models
from csm.mesh.shape import Mesh

if TYPE_CHECKING:
    from torch import Tensor


class Method(ABC):
    """A way to describe a mesh."""

    name: str
    """What tables and figures call the method."""

    refine: str = "multistart"
    """Name of the refiner that suits its descriptor."""

    has_classifier: bool | None = None
    """Whether it says of vertices which template points they are; None where only a described shape tells."""

    @property
    @abstractmethod
    def key(self) -> Mapping[str, Any]:
        """Everything that identifies the method, as plain data: what a cache key needs."""

    @property
    @abstractmethod
    def recipe(self) -> Recipe | None:
        """What has to be prepared of a shape, in any process; None for nothing."""

    @abstractmethod
    def describe(self, mesh: Mesh, store: Store, device: str = "cpu") -> Described:
        """Describe a mesh.

        Parameters
        ----------
        mesh
            The shape, at any scale.
        store
            Where what was prepared is looked up and kept.
        device
            Where the features are computed, if the method can, and end up: "cpu", "cuda", ...
        """


@dataclass(frozen=True, eq=False)
class DescriptorMethod(Method):
    """A handcrafted descriptor.

    Parameters
    ----------
    descriptor
        With its parameters.
    name
        What tables call it; the family by default.
    """

    descriptor: Descriptor
    name: str = ""

    has_classifier = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "name", self.name or self.descriptor.name)

    @property
    def key(self) -> Mapping[str, Any]:
        """Family and parameters."""
        return record(self.descriptor)

    @property
    def recipe(self) -> Recipe:
        """The descriptor alone."""
        return Recipe(self.descriptor, basis_k=0)

    def describe(self, mesh: Mesh, store: Store, device: str = "cpu") -> Described:
        """Return the descriptor of a mesh, from the store or computed and kept."""
        features = features_of(mesh, self.descriptor, store)
        if device == "cpu":
            return Described(mesh, features, store=store)
        import torch

        return Described(mesh, torch.as_tensor(features).to(device), store=store)


@dataclass(frozen=True, eq=False)
class PrecomputedMethod(Method):
    """Features that are there already.

    Parameters
    ----------
    features
        Name of the mesh -> its features, shape (N, Q).
    name
        What tables call them.
    """

    features: Mapping[str, Tensor | FloatArray]
    name: str = "precomputed"

    has_classifier = False

    def __repr__(self) -> str:
        return f"PrecomputedMethod({self.name!r}, {counted(len(self.features), 'mesh')})"

    @cached_property
    def key(self) -> Mapping[str, Any]:
        """The hash of all features."""
        import torch

        digest = hashlib.sha256()
        for name, tensor in sorted(self.features.items()):
            plain = torch.as_tensor(tensor).detach().cpu().contiguous()
            digest.update(f"{name},{tuple(plain.shape)},{plain.dtype};".encode())
            digest.update(plain.view(torch.uint8).numpy().tobytes())
        return {"precomputed": digest.hexdigest()}

    @property
    def recipe(self) -> None:
        """Nothing has to be prepared."""
        return

    def describe(self, mesh: Mesh, store: Store, device: str = "cpu") -> Described:
        """Look the features of a mesh up by its name; ConfigError if there are none, or not one row per vertex."""
        found = self.features.get(mesh.name)
        if found is None:
            raise ConfigError(f"{self.name} has no features of {mesh.name!r}; it has {', '.join(self.features)}")
        if len(found) != mesh.n_vertices:
            raise ConfigError(
                f"{self.name}: {mesh.name} has {mesh.n_vertices} vertices, its features {len(found)} rows; wanted one "
                "row per vertex"
            )
        import torch

        return Described(mesh, torch.as_tensor(found).to(device), store=store)


def describe_all(
    method: Method, meshes: Sequence[Mesh], store: Store, device: str = "cpu", *, embed: bool = False
) -> list[Described]:
    """Describe meshes, on several threads where that helps.

    Parameters
    ----------
    method
        What describes them.
    meshes
        The meshes; the same one is described once at a time, so that the store has it for the next.
    store
        Where what is computed is kept.
    device
        Where networks run.
    embed
        Compute the eigenfunctions that a refinement needs as well.
    """

    def describe(mesh: Mesh) -> Described:
        found = method.describe(mesh, store, device)
        if embed:
            _ = found.embedded
        return found

    if len({mesh.digest for mesh in meshes}) < len(meshes):
        return [describe(mesh) for mesh in meshes]
    return thread_map(describe, meshes)  # the eigensolver leaves the interpreter's lock free for most of its time


def require_classifier(methods: Iterable[Method], matchers: Iterable[Matcher]) -> None:
    """Raise a ConfigError if a matcher needs a classifier over template points that a method is known not to have."""
    if any(rule.by_classifier for rule in matchers) and any(method.has_classifier is False for method in methods):
        raise ConfigError(NO_CLASSIFIER)


def as_method(method: Method | Descriptor | str) -> Method:
    """Return a method as it is given, of a descriptor, or by name: of a preset, or of a network that csm brings.

    Raises
    ------
    ConfigError
        If there is neither a preset nor a network of that name, or the object is something else.

    Examples
    --------
    >>> as_method("acd").name
    'acd'
    """
    if isinstance(method, Method):
        return method
    if isinstance(method, Descriptor):
        return DescriptorMethod(method)
    if isinstance(method, str) and method in shipped_models():
        network: Method = load("csm.matching.network:load_model")(method)
        return network
    if isinstance(method, str):
        try:
            return DescriptorMethod(preset(method), method)
        except ConfigError as error:
            raise ConfigError(f"{error}; and as networks {', '.join(shipped_models())}") from error
    raise ConfigError(
        f"a method is a descriptor, the name of a preset or a trained network (csm.load_model), got a "
        f"{type(method).__name__}"
    )
