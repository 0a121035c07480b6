"""A network with all that it describes a shape by; training is `csm.learning.module`, and is not needed for this."""

from __future__ import annotations

from collections.abc import Mapping
from inspect import signature
from typing import Any

import torch
from torch import Tensor, nn
from torch.nn import functional

from csm.errors import ConfigError
from csm.learning.places import Places
from csm.learning.samples import NetworkInput
from csm.learning.sides import mended
from csm.learning.smoothing import smoothed
from csm.learning.standardisation import Standardisation
from csm.learning.variation import Variation, image_columns
from csm.mesh.shape import Mesh
from csm.networks import Surface, build, stencils_of

FORMAT = 1
"""Version of the hyper-parameters in a checkpoint."""

PLACES_VERSION = 2
"""Of how places become a descriptor; raised where that changes, so that older results are not taken for new ones."""


class Describer(nn.Module):
    """A network, the scale of its input, and where on the template it sees the vertices of a shape.

    Parameters
    ----------
    network
        Name of the network and its options, for `csm.networks.build`.
    in_channels
        Width of the input descriptor.
    n_classes
        Number of template vertices.
    descriptor
        Name and parameters of the input descriptor, so that it can be computed for any mesh.
    basis_k
        Eigenpairs of the basis that the network was trained with.
    standardise
        Give every column of the input mean 0 and deviation 1 over the training shapes, and cut what is more than 10
        deviations off (`Standardisation`).
    vary
        How much every column of the standardised input is scaled and shifted at random in every training step
        (`Variation`); 0 for not at all.
    mirror
        Share of training steps that see the mirror image of their shape, whose input is that of the shape with its
        columns in another order (`csm.descriptors.base.Descriptor.mirrored_columns`), so that left and right are told
        apart on bodies that it has not seen.
    places
        Describe a vertex by where on the template the classifier sees it, in this many of the template's
        eigenfunctions (`Places`); 0: by the network's last layer.
    format
        Version of these parameters.

    Raises
    ------
    ConfigError
        If the parameters do not fit each other.

    Examples
    --------
    >>> descriptor = {"name": "hks", "k": 30, "n_times": 7, "scaled": True}
    >>> Describer({"name": "csmcnn", "ks": 20}, 7, 50, descriptor).network.classifier
    Linear(in_features=256, out_features=50, bias=True)
    """

    image_columns: Tensor

    def __init__(
        self,
        network: Mapping[str, Any],
        in_channels: int,
        n_classes: int,
        descriptor: Mapping[str, Any],
        basis_k: int = 128,
        standardise: bool = False,
        vary: float = 0.0,
        mirror: float = 0.0,
        places: int = 0,
        format: int = FORMAT,
    ) -> None:
        super().__init__()
        if format != FORMAT:
            raise ConfigError(f"the checkpoint has format {format}, this version of csm reads format {FORMAT}")
        options = dict(network)
        try:
            self.network = build(options.pop("name"), in_channels, n_classes, **options)
        except ValueError as error:
            raise ConfigError(str(error)) from error
        wanted = self.network.n_eigenpairs
        if wanted > basis_k:
            raise ConfigError(
                f"the network wants {wanted} eigenpairs, the data hold {basis_k}: set data.basis_k={wanted} or a "
                "smaller model.ks"
            )
        self.settings: Mapping[str, Any] = {}
        self.has_classifier = True
        self.inputs = Standardisation(in_channels) if standardise else None
        self.variation = self._variation(vary, standardise)
        if mirror and stencils_of(**network):
            raise ConfigError(
                f"learning.mirror={mirror}: {network['name']} sees more of a shape than its descriptor, and it is not "
                "known how that changes when a shape is mirrored; set learning.mirror=0"
            )
        self.mirror = mirror
        self.register_buffer("image_columns", image_columns(mirror, descriptor), persistent=False)
        self.places = self._places(n_classes, places, basis_k)

    @classmethod
    def of(cls, settings: Mapping[str, Any]) -> Describer:
        """Make the one that the hyper-parameters of a checkpoint describe, which become its `settings`."""
        known = signature(Describer).parameters
        made = Describer(**{name: value for name, value in settings.items() if name in known})
        made.settings = settings
        return made

    @property
    def device(self) -> torch.device:
        """Where the weights are."""
        return self.network.classifier.weight.device

    def forward(self, features: Tensor, surface: Surface) -> Tensor:
        """Return the network's last layer before the classifier, shape (N, Q)."""
        x = features if self.inputs is None else self.inputs(features)
        return self.network.describe(self.variation(x), surface)

    def mirrored(self, features: Tensor) -> Tensor:
        """Return the input features of the mirror image of a shape, of its own, shape (N, P)."""
        return features[:, self.image_columns.to(features.device)]

    @torch.no_grad()
    def descriptor(self, last: Tensor, given: NetworkInput, mesh: Mesh | None = None) -> Tensor:
        """Return the learned descriptor in evaluation mode, shape (N, Q): the network's last layer, or the places.

        Where the twins of the template's points are known, the places are the means of those of the shape and of its
        mirror image, two opinions that seldom go wrong together.

        Parameters
        ----------
        last
            Shape (N, Q): the network's last layer, as `last_layer` returns it.
        given
            The shape.
        mesh
            Its mesh, with which parts that are taken for their mirror images are mended (`csm.learning.sides`), and
            the places of neighbours averaged (`csm.learning.smoothing`); without it neither is done.
        """
        if self.places is None:
            return last
        found = self._placed(last, given, mesh)
        return found if mesh is None else smoothed(found, mesh)

    def _placed(self, last: Tensor, given: NetworkInput, mesh: Mesh | None) -> Tensor:
        """Return the places of a shape as the network sees them vertex by vertex, rows of unit length."""
        assert self.places is not None
        if not self.mirror or not self.places.has_twins:
            plain: Tensor = self.places(last, self.network.classifier)
            return plain
        image = self.last_layer(given._replace(features=self.mirrored(given.features)))
        rows = self._read(last, mesh, image=False) + self._read(image, mesh, image=True)
        found: Tensor = functional.normalize(rows, dim=1)
        return found

    def _read(self, last: Tensor, mesh: Mesh | None, *, image: bool) -> Tensor:
        """Return the places of a shape, of its last layer or of that of its mirror image, before they have length 1."""
        assert self.places is not None
        places, classifier = self.places, self.network.classifier
        found = places.read(last, classifier, twins=image)
        if mesh is None:
            return found.rows
        return mended(found, lambda: places.read(last, classifier, twins=not image), mesh)

    @torch.no_grad()
    def describe(self, given: NetworkInput, mesh: Mesh | None = None) -> Tensor:
        """Return the learned descriptor of a shape in evaluation mode, shape (N, Q), on the device of the module."""
        return self.descriptor(self.last_layer(given), given, mesh)

    @torch.no_grad()
    def last_layer(self, given: NetworkInput) -> Tensor:
        """Return what the classifier takes of a shape, in evaluation mode, on the device of the module."""
        self.eval()
        features, surface = given.to(self.device)
        found: Tensor = self(features, surface)
        return found

    def weights(self) -> dict[str, Tensor]:
        """Return the tensors that a trained network consists of: those of the network, standardisation and places."""
        found = dict(self.network.state_dict())
        for name, part in (("inputs.", self.inputs), ("places.", self.places)):
            found |= {} if part is None else part.state_dict(prefix=name)
        return found

    def _variation(self, spread: float, standardise: bool) -> Variation:
        if spread and not standardise:
            raise ConfigError(
                "learning.vary is in deviations of a standardised input: set learning.vary=0 or standardise"
            )
        return Variation(spread)

    def _places(self, n_classes: int, k: int, basis_k: int) -> Places | None:
        if isinstance(k, bool) or not isinstance(k, int):
            raise ConfigError(f"learning.places={k}; wanted a number of eigenfunctions, or 0 for none")
        if k > basis_k:
            raise ConfigError(f"learning.places={k}, and the data hold {basis_k} eigenfunctions: set data.basis_k={k}")
        try:
            return Places(n_classes, k) if k else None
        except ValueError as error:
            raise ConfigError(f"learning.places: {error}") from error
