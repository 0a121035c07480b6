"""From a mesh to what a trained network says of it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from torch import Tensor

from csm.data.datamodule import to_sample
from csm.data.prepare import Recipe, prepare_shape
from csm.data.shapeset import Shape
from csm.data.store import Store
from csm.descriptors.presets import from_parameters
from csm.errors import ConfigError
from csm.learning.module import CSMModule
from csm.mesh.correspondence import PointMap
from csm.mesh.shape import Mesh
from csm.networks import stencils_of
from csm.operators.stencils import Stencil, stencil


def stencils_for(network: Mapping[str, Any]) -> tuple[Stencil, ...]:
    """Return the stencils that a network, given as its name and options, wants of every shape.

    Raises
    ------
    ConfigError
        If the network or a stencil is unknown.
    """
    try:
        return tuple(stencil(name, **parameters) for name, parameters in stencils_of(**network).items())
    except ValueError as error:
        raise ConfigError(str(error)) from error


def recipe_of(module: CSMModule) -> Recipe:
    """Return what a trained network wants to know of a shape."""
    hparams = module.hparams
    return Recipe(from_parameters(**hparams["descriptor"]), hparams["basis_k"], stencils_for(hparams["network"]))


def describe_mesh(module: CSMModule, mesh: Mesh, store: Store) -> Tensor:
    """Return the learned descriptor of a mesh, shape (N, Q)."""
    shape = Shape(mesh, PointMap.identity(mesh.n_vertices))
    return module.describe(to_sample(prepare_shape(shape, recipe_of(module), store)))
