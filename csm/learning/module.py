"""The LightningModule: a network, its loss and its optimiser."""

from __future__ import annotations

from typing import Any, Literal

import lightning as L
import torch
from scipy.spatial.transform import Rotation
from torch import Tensor, nn
from torch.nn import functional
from torch.optim import Adam
from torch.optim.lr_scheduler import CosineAnnealingLR, LRScheduler, OneCycleLR, StepLR

from csm.descriptors import Coordinates
from csm.errors import ConfigError
from csm.learning.loading import metric_group
from csm.learning.loss import Products, linear_cross_entropy
from csm.learning.places import Places
from csm.learning.samples import NetworkInput, ShapeSample, mirrored_template
from csm.learning.sides import mended
from csm.learning.standardisation import Standardisation
from csm.learning.variation import Variation, image_columns
from csm.mesh.shape import Mesh
from csm.networks import Surface, build, stencils_of

Schedule = Literal["constant", "cosine", "step", "drop", "one_cycle"]

FORMAT = 1
"""Version of the hyper-parameters in a checkpoint."""


class CSMModule(L.LightningModule):
    """Learn to classify the template vertex of every vertex of a shape.

    All hyper-parameters are plain data, so a checkpoint loads with ``weights_only=True`` and without a config.

    Parameters
    ----------
    network
        Name of the network and its options, for `csm.networks.build`.
    in_channels
        Width of the input descriptor.
    n_classes
        Number of template vertices.
    descriptor
        Name and parameters of the input descriptor, kept in the checkpoint so that it can be computed for any mesh.
    basis_k
        Eigenpairs of the basis that the network was trained with.
    also_classes
        Number of template points of each further template that training shapes have, by the name of the template.  Each
        has a classifier of its own, which only serves the training.
    lr, weight_decay
        Of Adam (betas 0.9 and 0.999, eps 1e-8).
    schedule
        Of the learning rate: "constant", "cosine" (to zero), "step" (halved at every third of the training),
        "drop" (a tenth after 60 % of the training) or "one_cycle" (rises for 30 % of the training, then falls).
    loss_products
        Precision of the classifier's matrix products, see `linear_cross_entropy`.
    loss_rows
        How many labelled vertices, drawn anew in every training step, the loss is taken over; None for all.  The
        classifier is most of the cost of a step, so 1024 of 6890 make it several times faster; the gradient is that
        of all vertices on average.
    standardise
        Give every column of the input mean 0 and deviation 1 over the training shapes, and cut what is more than 10
        deviations off (`Standardisation`).
    vary
        How much every column of the standardised input is scaled and shifted at random in every training step
        (`Variation`); 0 for not at all.
    mirror
        Share of training steps that see the mirror image of their shape, whose input is that of the shape with its
        columns in another order (`csm.descriptors.base.Descriptor.mirrored_columns`), so that left and right are told
        apart on bodies that it has not seen.  `also_classes` must have the mirrored templates then
        (`csm.learning.samples.also_classes`).
    places
        Describe a vertex by where on the template the classifier sees it, in this many of the template's
        eigenfunctions (`Places`); 0: by the network's last layer.
    rotate
        Turn the input features, which must be vertex positions (descriptor "xyz"), by a rotation drawn anew in every
        training step, any as likely as any other, so that the network learns not to depend on how a shape stands.
    training
        How the checkpoint came about (data, split, seed), free plain data for its reader.
    """

    image_columns: Tensor

    def __init__(
        self,
        network: dict[str, Any],
        in_channels: int,
        n_classes: int,
        descriptor: dict[str, Any],
        basis_k: int = 128,
        also_classes: dict[str, int] | None = None,
        lr: float = 1e-3,
        weight_decay: float = 0.0,
        schedule: Schedule = "constant",
        loss_products: Products = "float32",
        loss_rows: int | None = None,
        standardise: bool = False,
        vary: float = 0.0,
        mirror: float = 0.0,
        places: int = 0,
        rotate: bool = False,
        training: dict[str, Any] | None = None,
        format: int = FORMAT,
    ) -> None:
        super().__init__()
        self.save_hyperparameters()
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
        width = self.network.classifier.in_features
        self.others = nn.ModuleDict({name: nn.Linear(width, n) for name, n in (also_classes or {}).items()})
        self.lr, self.weight_decay, self.schedule = lr, weight_decay, schedule
        if loss_rows is not None and loss_rows < 1:
            raise ConfigError(f"loss_rows={loss_rows}; wanted a number of vertices from 1, or none for all")
        if rotate and descriptor.get("name") != Coordinates.name:
            raise ConfigError(
                f"learning.rotate turns vertex positions, and the input is {descriptor.get('name')!r}: set "
                "descriptor=xyz, or leave rotate out, as the other descriptors do not turn with the shape"
            )
        self.loss_products: Products = loss_products
        self.rotate = rotate
        self.loss_rows = loss_rows

    def forward(self, features: Tensor, surface: Surface) -> Tensor:
        """Return the network's last layer before the classifier, shape (N, Q)."""
        x = features if self.inputs is None else self.inputs(features)
        return self.network.describe(self.variation(x), surface)

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
            Its mesh, with which parts that are taken for their mirror images are mended (`csm.learning.sides`).
        """
        if self.places is None:
            return last
        classifier = self.network.classifier
        if not self.mirror or not self.places.has_twins:
            plain: Tensor = self.places(last, classifier)
            return plain
        columns = self.image_columns.to(given.features.device)
        image = self.last_layer(given._replace(features=given.features[:, columns]))
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

    def loss(self, last: Tensor, sample: ShapeSample) -> Tensor:
        """Cross-entropy of the classifier over the rows with a known template point (in training, a draw of them)."""
        classifier = self.classifier(sample.template)
        rows, classes = sample.rows, sample.classes
        if self.training and self.loss_rows is not None and self.loss_rows < len(rows):
            drawn = torch.randperm(len(rows), device=rows.device)[: self.loss_rows]
            rows, classes = rows[drawn], classes[drawn]
        x = self.network.dropout(last[rows])
        weight, bias = classifier.weight, classifier.bias
        return linear_cross_entropy(x, weight, bias, classes, products=self.loss_products)

    def classifier(self, template: str) -> nn.Linear:
        """Return the classifier over the points of a template; that of the training set has no name."""
        found = self.others[template] if template else self.network.classifier
        assert isinstance(found, nn.Linear)
        return found

    def training_step(self, sample: ShapeSample) -> Tensor:
        """One shape: loss of its labelled vertices."""
        sample = self._seen(sample)
        features = sample.features
        if self.rotate:
            features = features @ random_rotation().to(features, non_blocking=True)
        loss = self.loss(self(features, sample.surface), sample)
        self.log("train/loss", loss, on_step=False, on_epoch=True, prog_bar=True, batch_size=1, sync_dist=True)
        return loss

    def _seen(self, sample: ShapeSample) -> ShapeSample:
        """Return the shape or its mirror image, whose points are those of a template of its own."""
        if not self.mirror or torch.rand(()).item() >= self.mirror:
            return sample
        image = sample.features[:, self.image_columns]
        return sample._replace(features=image, template=mirrored_template(sample.template))

    def validation_step(self, sample: ShapeSample) -> Tensor:
        """Return the learned descriptor of one shape; the loss is logged, the errors are a callback's business."""
        last = self(sample.features, sample.surface)
        name = f"{metric_group(self._trainer)}/loss"
        self.log(name, self.loss(last, sample), prog_bar=True, batch_size=sample.counts, sync_dist=True)
        return self.descriptor(last, NetworkInput(sample.features, sample.surface))

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

    def configure_optimizers(self) -> Any:
        """Adam with the chosen schedule, stepped once per training step."""
        optimizer = Adam(self.parameters(), lr=self.lr, weight_decay=self.weight_decay)
        if self.schedule == "constant":
            return optimizer
        steps = int(self.trainer.estimated_stepping_batches)
        return {
            "optimizer": optimizer,
            "lr_scheduler": {"scheduler": self._scheduler(optimizer, steps), "interval": "step"},
        }

    def _scheduler(self, optimizer: Adam, steps: int) -> LRScheduler:
        match self.schedule:
            case "cosine":
                return CosineAnnealingLR(optimizer, steps)
            case "step":
                return StepLR(optimizer, max(1, steps // 3), gamma=0.5)
            case "drop":
                return StepLR(optimizer, max(1, steps * 3 // 5), gamma=0.1)
            case "one_cycle":
                return OneCycleLR(optimizer, self.lr, total_steps=steps + 1)  # it is stepped once after the last step
        raise ConfigError(f"schedule is constant, cosine, step, drop or one_cycle, got {self.schedule!r}")


def random_rotation() -> Tensor:
    """Return a rotation matrix, shape (3, 3), drawn uniformly by PyTorch's generator."""
    quaternion = torch.randn(4, dtype=torch.float64)  # its direction is uniform on the sphere
    return torch.as_tensor(Rotation.from_quat(quaternion.numpy()).as_matrix())
