"""Trained networks as methods."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Mapping
from functools import cached_property
from typing import Any

import torch

from csm._counts import counted
from csm.data.prepare import Recipe, prepare_mesh
from csm.data.store import Store
from csm.learning.checkpoint import load_module
from csm.learning.describer import PLACES_VERSION, Describer
from csm.learning.samples import network_input, recipe_of
from csm.matching.base import Classifier, Described
from csm.matching.methods import Method
from csm.matching.shipped import shipped_file, shipped_models
from csm.mesh.shape import Mesh

_CLASSIFIER = ("network.classifier.",)


class NetworkMethod(Method):
    """A trained network, which brings the descriptor and the basis that it was trained with.

    Parameters
    ----------
    module
        The network.
    name
        What tables call it; by default what its training was called.
    """

    refine = "trusting"  # a search mends exchanged limbs, but a start that the network is sure of needs none

    def __init__(self, module: Describer, name: str = "") -> None:
        self.module = module
        self.has_classifier = module.has_classifier
        self.training: Mapping[str, Any] = module.settings.get("training") or {}
        self.name = name or str(self.training.get("name", "network"))

    def __repr__(self) -> str:
        return f"NetworkMethod({self.name!r}, {self.module.settings['network']['name']})"

    @property
    def trained_on(self) -> str:
        """What it was trained on, in words; empty where the checkpoint does not say."""
        known, epochs = self.training.get("set"), self.training.get("epochs")
        if known and (also := self.training.get("also")):
            known = " and ".join([str(known), *map(str, also)])
        return f"{known}, {counted(epochs, 'epoch')}" if known and epochs else str(known or "")

    @cached_property
    def key(self) -> Mapping[str, Any]:
        """Network, input, the hash of the weights, and how they describe a shape."""
        hparams = self.module.settings
        plain = {name: hparams[name] for name in ("network", "descriptor", "basis_k")}
        if self.module.places is not None:
            plain["places"] = {"version": PLACES_VERSION, "mirror": bool(self.module.mirror)}
        # an export leaves the classifier out, and what stands in its place is drawn at random
        return {**plain, "weights": self._hash(() if self.module.has_classifier else _CLASSIFIER)}

    @property
    def weights(self) -> str:
        """The hash of the weights that describe a shape, which a checkpoint and its export have in common."""
        return self._hash(_CLASSIFIER)

    def _hash(self, left_out: tuple[str, ...]) -> str:
        """Return the hash of the weights but for those whose names begin so."""
        digest = hashlib.sha256()
        for name, tensor in sorted(self.module.state_dict().items()):
            if not name.startswith((*left_out, "others.")):  # further templates' classifiers only served the training
                digest.update(name.encode() + tensor.detach().cpu().numpy().tobytes())
        return digest.hexdigest()

    @cached_property
    def recipe(self) -> Recipe:
        """Input descriptor, basis and stencils."""
        return recipe_of(self.module.settings)

    def describe(self, mesh: Mesh, store: Store, device: str = "cpu") -> Described:
        """Return the learned descriptor of a mesh, computed on the device."""
        self.module.to(device)
        prepared = prepare_mesh(mesh, self.recipe, store)
        seen = network_input(prepared)
        last = self.module.last_layer(seen)
        classifier = None
        if self.module.has_classifier:
            linear = self.module.network.classifier
            classifier = Classifier(linear.weight.detach(), linear.bias.detach())
        given = torch.from_numpy(prepared.features).to(last.device)
        return Described(mesh, self.module.descriptor(last, seen, mesh), classifier, store, given, last)


def load_model(path: str | os.PathLike[str], name: str = "") -> NetworkMethod:
    """Load a trained network as a method: one that csm brings, a checkpoint of ``csm train``, or an export's json file.

    Nothing in the files is executed, and no configuration is needed.

    Parameters
    ----------
    path
        "humans" or "humans_parts", which csm brings (`csm.matching.shipped`), or a file such as
        ``outputs/train/DATE/model.ckpt``.
    name
        What tables call it; by default what its training was called.

    Raises
    ------
    DataError
        If there is no such file, or it is no network of csm.

    Examples
    --------
    >>> load_model("humans")
    NetworkMethod('humans', csmcnn)
    """
    if isinstance(path, str) and path in shipped_models():
        return NetworkMethod(load_module(shipped_file(path)), name or path)
    return NetworkMethod(load_module(path), name)
