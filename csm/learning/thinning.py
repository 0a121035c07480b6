"""Smaller copies of trained networks, to be passed on: with some of the template points, in half precision."""

from __future__ import annotations

import torch
from torch.nn import functional

from csm._types import IntArray
from csm.errors import ConfigError
from csm.learning.describer import Describer
from csm.learning.places import PARTS


def thinned(module: Describer, classes: IntArray, functions: int) -> Describer:
    """Return a network that describes by fewer points of the template, and by fewer of its eigenfunctions.

    Neighbouring points say nearly the same, so well-spread ones serve nearly as well as all.  The classifier is nine
    tenths of a network; its further classifiers, which only serve the training, are left out.

    Parameters
    ----------
    module
        A network that describes by places (``learning.places``).
    classes
        Shape (C',): which points of the template are kept, without repetition.
    functions
        How many eigenfunctions are kept.

    Raises
    ------
    ConfigError
        If the network does not describe by places, or has fewer points or functions.

    Examples
    --------
    >>> thinned(module, spread_vertices(template, 2000), 128)  # doctest: +SKIP
    """
    if module.places is None:
        raise ConfigError("only a network that was trained with learning.places can do without points of its template")
    n, k = module.places.functions.shape
    if not 2 <= functions <= k or not 0 < len(set(classes.tolist()) & set(range(n))) == len(classes):
        raise ConfigError(f"wanted some of {n} points of the template, each once, and 2 to {k} of its functions")
    made = Describer.of({**module.settings, "n_classes": len(classes), "places": functions, "also_classes": {}})
    kept = torch.as_tensor(classes)
    weights = {name: x for name, x in module.state_dict().items() if not name.startswith("others.")}
    for name in ("network.classifier.weight", "network.classifier.bias", *(f"places.{name}" for name in PARTS)):
        weights[name] = weights[name][kept]
    if module.places.has_twins:
        rows = functional.normalize(module.places.functions, dim=1)
        weights["places.twins"] = (rows[weights["places.twins"]] @ rows[kept].T).argmax(1)
    weights["places.functions"] = weights["places.functions"][:, :functions]
    made.load_state_dict(weights)
    return made.eval()
