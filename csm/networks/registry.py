"""Networks by name, and the named settings that experiments use them with.

The default of an option stands in the constructor of its network and nowhere else; everything here asks for it there.
"""

from __future__ import annotations

import inspect
from functools import partial
from typing import TYPE_CHECKING, Any

from csm._places import Loaded, load

if TYPE_CHECKING:
    from csm.networks.base import CorrespondenceNetwork

PLACES = {
    "acscnn": "acscnn:ACSCNN",
    "chebynet": "chebynet:ChebyNet",
    "csmcnn": "csmcnn:CSMCNN",
    "diffusionnet": "diffusionnet:DiffusionNet",
    "gcnn": "gcnn:GCNN",
    "identity": "identity:Identity",
    "mgcn": "mgcn:MGCN",
    "mlp": "mlp:MLP",
    "splinecnn": "splinecnn:SplineCNN",
}
"""Name -> file and class.  A new network is one file and one line here."""

NETWORKS: Loaded[type[CorrespondenceNetwork]] = Loaded(
    {name: partial(load, f"csm.networks.{place}") for name, place in PLACES.items()}
)
"""The classes by name."""

MODELS: dict[str, dict[str, Any]] = {
    # CSMCNN as in the paper. What the text leaves open (K_s, the number of terms, the normalisation, the activation and
    # the dropout) follows the released code, but the momentum of the batch normalisation is PyTorch's.
    "csmcnn_paper": {"name": "csmcnn"},
    # CSMCNN as in the released code, whose batch normalisation has an eps and a momentum of 1e-3. The released code
    # also has a spectral bias, which makes the output depend on the signs of the eigenvectors; bias="spectral"
    # reproduces that, and this setting keeps the spatial bias.
    "csmcnn_release": {"name": "csmcnn", "momentum": 1e-3, "eps": 1e-3},
    # csm's own setting, for descriptor=acd_two_bands with learning.standardise=true (experiment=faust): what each part
    # is worth is in docs/lab.md.
    "csmcnn_own": {"name": "csmcnn", "ks": 256, "terms": 12, "normalisation": "area"},
    # ACSCNN as released (Li et al. 2020): six layers of 16 Chebyshev polynomials of 8 anisotropic Laplacians. Only the
    # frame differs: that of the authors (frame="released") depends on the pose in space, and the average of lines does
    # not. The authors' input is a constant; the paper compares with 48 columns, which is the width of acd_release.
    "acscnn": {"name": "acscnn"},
    # The network on top of ADD (Boscaini et al. 2016), whose input is descriptor=add. It is known to be a perceptron.
    # Its three layers of 256 channels with batch normalisation are a guess, and the fourth is the MLP256 that all
    # other networks end with.
    "add_mlp": {"name": "mlp", "widths": [256, 256, 256, 256]},
    # ChebyNet (Defferrard et al. 2016). Its authors have no network for shapes, so it has the layers of SplineCNN.
    "chebynet": {"name": "chebynet"},
    # DiffusionNet as released (Sharp et al. 2022), in the narrower of its two sizes, whose input is
    # descriptor=hks_diffusionnet; with descriptor=xyz the authors take a width of 256. Their classifier reads the
    # blocks directly, so the learned descriptor has 128 channels; descriptor_channels=256 puts a linear layer of that
    # width in between.
    "diffusionnet": {"name": "diffusionnet"},
    # GCNN (Masci et al. 2015), whose input is descriptor=geometry_vectors. The patches are those of the authors' public
    # preparation, the layer is that of their later tutorial, and what both leave open is called a guess there.
    "gcnn": {"name": "gcnn"},
    # No network: the input descriptor itself is matched (with trainer.max_epochs=0), or a linear classifier of it is
    # trained.
    "identity": {"name": "identity"},
    # MGCN as in the released code (Wang et al. 2020), whose input is descriptor=weds. The paper states 3.03 M
    # parameters, the release has 2.85 M, and the difference cannot be explained. The authors train with Adam at 1e-3
    # and a weight decay of 1e-4 (optimizer.weight_decay=1e-4) for 200 epochs of cross-entropy. Their second phase, 100
    # epochs with a triplet loss, is left out, as in the paper's comparison. The tolerance is an addition of csm: it is
    # what a wavelet may lose of its sum, so that it need not reach all vertices, and 0 is exact. products="bfloat16"
    # is less exact, and faster on processors that have matrix units for it.
    "mgcn": {"name": "mgcn"},
    # The input descriptor through a perceptron, vertex by vertex: csmcnn_paper without its convolutions (Figure 11).
    "mlp": {"name": "mlp"},
    # The network on top of OSD (Litman and Bronstein 2014), whose input is descriptor=geometry_vectors. Its authors fit
    # linear filters to pairs of points in closed form; here a perceptron is trained with the loss of all other methods.
    # It is that of add_mlp, so that the two differ in the anisotropy of their input alone.
    "osd": {"name": "mlp", "widths": [256, 256, 256, 256]},
    # SplineCNN (Fey et al. 2018) as in the authors' example for FAUST, whose input is descriptor=constant and which
    # sums over the neighbours (the text of the paper takes the mean). Its published training is Adam at 0.01 for 60
    # epochs and at 0.001 for 40 more.
    "splinecnn": {"name": "splinecnn"},
}
"""The named settings: the network's name, and the options that differ from the defaults of its constructor."""


def build(name: str, in_channels: int, n_classes: int, **options: Any) -> CorrespondenceNetwork:
    """Create a network by its name.

    Parameters
    ----------
    name
        A key of `NETWORKS`.
    in_channels
        Width P of the input descriptor.
    n_classes
        Number of template vertices.
    options
        The other arguments of the network's constructor; those left out keep their defaults.

    Raises
    ------
    ValueError
        If there is no network of that name, if it has no such option, or if an option has a bad value.
    """
    known = _defaults(name)
    unknown = [option for option in options if option not in known]
    if unknown:
        raise ValueError(f"network {name} has no option {unknown[0]!r}; its options are {', '.join(known)}")
    try:
        return NETWORKS[name](in_channels, n_classes, **options)
    except TypeError as error:
        raise ValueError(f"network {name}: {error}") from error


def stencils_of(name: str, **options: Any) -> dict[str, dict[str, Any]]:
    """Return the stencils that a network with these options needs, from their names to their parameters.

    The network is created without memory for its weights, on PyTorch's "meta" device, and asked.

    Raises
    ------
    ValueError
        As `build` does.

    Examples
    --------
    >>> stencils_of("csmcnn", ks=64)
    {}
    >>> stencils_of("splinecnn", kernel=3)
    {'edge_splines': {'kernel': 3}}
    """
    import torch

    with torch.device("meta"):
        return build(name, 1, 1, **options).stencils()


def settings(model: str) -> dict[str, Any]:
    """Return a named setting with all options of its network, as plain data.

    Parameters
    ----------
    model
        A key of `MODELS`, or the name of a network, which then has the defaults of its constructor.

    Returns
    -------
    dict[str, Any]
        The name of the network under "name", and every option of its constructor; sequences are lists.

    Raises
    ------
    ValueError
        If there is no setting of that name.

    Examples
    --------
    >>> settings("add_mlp")["widths"], settings("add_mlp")["dropout"]
    ([256, 256, 256, 256], 0.5)
    """
    if model not in MODELS and model not in NETWORKS:
        raise ValueError(f"there is no model {model!r}; known are {', '.join(sorted({*MODELS, *NETWORKS}))}")
    chosen = MODELS.get(model, {"name": model})
    options = _defaults(chosen["name"]) | chosen
    plain = {option: list(value) if isinstance(value, tuple | list) else value for option, value in options.items()}
    return {"name": chosen["name"], **plain}


def _defaults(name: str) -> dict[str, Any]:
    """Return the options of a network's constructor, in its order, with their default values."""
    if name not in NETWORKS:
        raise ValueError(f"there is no network {name!r}; known are {', '.join(sorted(NETWORKS))}")
    parameters = inspect.signature(NETWORKS[name]).parameters
    return {key: p.default for key, p in parameters.items() if key not in ("in_channels", "n_classes")}
