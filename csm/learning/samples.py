"""From prepared arrays to the tensors of a network, and the recipe of what a network needs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor

from csm._types import Arrays
from csm.data.base import DataModule
from csm.data.prepare import Prepared, Recipe
from csm.descriptors.presets import from_parameters
from csm.errors import ConfigError
from csm.mesh.correspondence import PointMap
from csm.networks import Basis, Surface, stencils_of
from csm.networks.surface import with_cuts
from csm.operators.stencils import Stencil, stencil


class NetworkInput(NamedTuple):
    """One shape as a network sees it: `features`, shape (N, P), and the `surface` with K eigenpairs and stencils."""

    features: Tensor
    surface: Surface

    def to(self, device: torch.device | str) -> NetworkInput:
        """Return a copy on another device."""
        return NetworkInput(self.features.to(device), self.surface.to(device))


class ShapeSample(NamedTuple):
    """One training shape.

    Shapes: `features` (N, P); `surface` with K eigenpairs; `rows` (R,) vertices with a known template point and
    `classes` (R,) that point of the `template`, which has no name if it is that of the training set.  `counts` is its
    weight in the loss of a validation.
    """

    name: str
    features: Tensor
    surface: Surface
    rows: Tensor
    classes: Tensor
    template: str = ""
    counts: int = 1


def network_input(prepared: Prepared) -> NetworkInput:
    """Convert a prepared mesh to float32 tensors; a mesh that was prepared without a basis has one of size 0."""
    spectrum = prepared.basis
    none = np.zeros(0), np.zeros((len(prepared.mass), 0))
    evals, evecs = none if spectrum is None else (spectrum.evals, spectrum.evecs)
    basis = Basis(*(torch.as_tensor(a, dtype=torch.float32) for a in (evals, evecs, prepared.mass)))
    stencils = with_cuts({name: _tensors(arrays) for name, arrays in prepared.stencils.items()})
    return NetworkInput(torch.as_tensor(prepared.features), Surface(basis, stencils))


def shape_sample(prepared: Prepared, truth: PointMap, template: str = "") -> ShapeSample:
    """Convert a prepared mesh and its map from a template to a training sample."""
    classes = np.flatnonzero(truth.indices >= 0)
    rows = torch.as_tensor(truth.indices[classes])
    return ShapeSample(prepared.mesh.name, *network_input(prepared), rows, torch.as_tensor(classes), template)


def mirrored_template(template: str) -> str:
    """Return the name of the mirror image of a template.

    Examples
    --------
    >>> mirrored_template(""), mirrored_template("humans")
    ('mirrored', 'humans_mirrored')
    """
    return f"{template}_mirrored" if template else "mirrored"


def also_classes(data: DataModule, mirror: bool) -> dict[str, int]:
    """Return the number of points of each template that needs a classifier beside that of the training set, by name.

    With `mirror` the mirror images of all templates are among them: as the left-right map of a template is not always
    known, the points of its mirror image are learned as those of another template.
    """
    found = data.also_classes
    if mirror:
        found |= {mirrored_template(name): n for name, n in {"": data.n_classes, **found}.items()}
    return found


def n_bytes(sample: ShapeSample) -> int:
    """Return what the tensors of a sample take in memory."""
    tables = sample.surface.stencils.values()
    tensors = [sample.features, *sample.surface.basis, *(t for table in tables for t in table.values()), sample.rows]
    return sum(t.numel() * t.element_size() for t in [*tensors, sample.classes])


def _tensors(arrays: Arrays) -> dict[str, Tensor]:
    """Convert to float32 and int64."""
    kinds = {"f": torch.float32, "i": torch.int64}
    return {key: torch.as_tensor(value).to(kinds[value.dtype.kind]) for key, value in arrays.items()}


def stencils_for(network: Mapping[str, Any]) -> tuple[Stencil, ...]:
    """Return the stencils that a network, given as its name and options, needs of every shape.

    Raises
    ------
    ConfigError
        If the network, an option or a stencil is unknown.
    """
    try:
        return tuple(stencil(name, **parameters) for name, parameters in stencils_of(**network).items())
    except ValueError as error:
        raise ConfigError(str(error)) from error


def recipe_of(hparams: Mapping[str, Any]) -> Recipe:
    """Return the recipe of a trained network, given by the hyper-parameters of its checkpoint."""
    descriptor = from_parameters(**hparams["descriptor"])
    return Recipe(descriptor, hparams["basis_k"], stencils_for(hparams["network"]))
