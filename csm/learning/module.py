"""The LightningModule: a network, its loss and its optimiser."""

from __future__ import annotations

from typing import Any, Literal

import lightning as L
import torch
from scipy.spatial.transform import Rotation
from torch import Tensor, nn
from torch.optim import Adam
from torch.optim.lr_scheduler import CosineAnnealingLR, LRScheduler, OneCycleLR, StepLR

from csm.descriptors import Coordinates
from csm.errors import ConfigError
from csm.learning.describer import FORMAT, Describer
from csm.learning.loading import metric_group
from csm.learning.loss import Products, linear_cross_entropy
from csm.learning.samples import NetworkInput, ShapeSample, mirrored_template

Schedule = Literal["constant", "cosine", "step", "drop", "one_cycle"]


class CSMModule(Describer, L.LightningModule):
    """Learn to classify the template vertex of every vertex of a shape.

    All hyper-parameters are plain data, so a checkpoint loads with ``weights_only=True`` and without a config.

    Parameters
    ----------
    network, in_channels, n_classes, descriptor, basis_k, standardise, vary, mirror, places, format
        Of a `Describer`.  With `mirror`, `also_classes` must have the mirrored templates
        (`csm.learning.samples.also_classes`).
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
    rotate
        Turn the input features, which must be vertex positions (descriptor "xyz"), by a rotation drawn anew in every
        training step, any as likely as any other, so that the network learns not to depend on how a shape stands.
    training
        How the checkpoint came about (data, split, seed), free plain data for its reader.
    """

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
        super().__init__(
            network,
            in_channels,
            n_classes,
            descriptor,
            basis_k,
            standardise=standardise,
            vary=vary,
            mirror=mirror,
            places=places,
            format=format,
        )
        self.save_hyperparameters()
        self.settings = self.hparams
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
        return sample._replace(features=self.mirrored(sample.features), template=mirrored_template(sample.template))

    def validation_step(self, sample: ShapeSample) -> Tensor:
        """Return the learned descriptor of one shape; the loss is logged, the errors are a callback's business."""
        last = self(sample.features, sample.surface)
        name = f"{metric_group(self._trainer)}/loss"
        self.log(name, self.loss(last, sample), prog_bar=True, batch_size=sample.counts, sync_dist=True)
        return self.descriptor(last, NetworkInput(sample.features, sample.surface))

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
