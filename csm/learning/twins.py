"""Which points of the template are twins, one on its left and one on its right, found by what a network says.

A network that was trained on mirror images too knows a left hand in a mirror image as well as in a body.  Asked by the
classifier of bodies, it says that the left hand of a mirror image is a right hand.  So the twin of a point is where on
the template the classifier sees that point in the mirror images of the training shapes.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence

import torch
from torch import Tensor
from torch.nn import functional

from csm.learning.describer import Describer
from csm.learning.places import UNKNOWN
from csm.learning.samples import NetworkInput, ShapeSample

LOG = logging.getLogger(__name__)

SHAPES = 10
"""How many of the training shapes are asked."""

AGREED = 0.8
"""Share of the points of their mirror images that must be placed well for the twins to be believed."""

NEAR = 0.1
"""How near to its place that is, in units of the diagonal of the template's bounding box."""


@torch.no_grad()
def learn_twins(module: Describer, samples: Sequence[ShapeSample]) -> bool:
    """Find the twins of the template's points, where the template has a left and a right; return whether it has.

    Parameters
    ----------
    module
        A network that was trained with ``learning.mirror`` and ``learning.places``; it gets the twins.
    samples
        Training shapes of its template; a few of them, evenly chosen, are asked.
    """
    places = module.places
    assert places is not None
    places.twins.fill_(UNKNOWN)
    asked = [samples[i] for i in torch.linspace(0, len(samples) - 1, min(SHAPES, len(samples))).long().tolist()]
    functions = functional.normalize(places.functions, dim=1)
    seen, total = [], torch.zeros_like(functions)
    for sample in asked:
        rows, classes = _places_in_image(module, sample), sample.classes.to(functions.device)
        total[classes] += rows
        seen.append((classes, _nearest(rows, functions)))
    twins = torch.arange(len(functions), device=functions.device)
    known = torch.nonzero(total.norm(dim=1))[:, 0]
    twins[known] = _nearest(total[known], functions)
    reach = NEAR * (places.points.amax(0) - places.points.amin(0)).norm()
    apart = [(places.points[classes] - places.points[twins[at]]).norm(dim=1) for classes, at in seen]
    agreed = (torch.cat(apart) < reach).float().mean().item()
    if agreed < AGREED:
        LOG.info(
            "learning.mirror: with left and right exchanged, %.0f %% of the points of mirror images are where they "
            "belong, fewer than %.0f %%: the network is too little trained, or the template's two sides do not match; "
            "shapes are described without their mirror images",
            100 * agreed,
            100 * AGREED,
        )
        return False
    places.twins.copy_(twins)
    return True


def _places_in_image(module: Describer, sample: ShapeSample) -> Tensor:
    """Return where the classifier sees the known points of a shape in its mirror image, shape (R, K)."""
    assert module.places is not None
    last = module.last_layer(NetworkInput(module.mirrored(sample.features), sample.surface))
    found: Tensor = module.places(last[sample.rows.to(last.device)], module.network.classifier)
    return found


def _nearest(rows: Tensor, functions: Tensor, block: int = 1024) -> Tensor:
    """Return the template point of each row, shape (R,)."""
    parts = (rows[begin : begin + block] for begin in range(0, len(rows), block))
    return torch.cat([(part @ functions.T).argmax(1) for part in parts])
