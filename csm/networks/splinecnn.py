"""SplineCNN: a network whose convolutions weight a neighbour by a spline over the vector to it."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Literal, NamedTuple, get_args

import torch
from torch import Tensor, nn
from torch.autograd.function import once_differentiable

from csm.networks.base import ConvolutionalNetwork
from csm.networks.sparse import Csr, widened, without_autocast
from csm.networks.surface import Surface

Aggregate = Literal["sum", "mean"]


class SplineCNN(ConvolutionalNetwork):
    """Six spline convolutions and a linear layer of 256 channels, with ELU after each, and the classifier.

    Parameters
    ----------
    in_channels
        Width P of the input descriptor, which is a constant in the original.
    n_classes
        Number of template vertices.
    channels
        Width of each convolution.
    descriptor_channels
        Width of the learned descriptor.
    kernel
        Number of control points per axis.
    aggregate
        What is taken of the messages of the neighbours: the "sum", as in the authors' example for FAUST, or the "mean",
        as in their paper.
    dropout
        Dropout between the learned descriptor and the classifier.

    Notes
    -----
    The convolutions tell neighbours apart by the direction in space, so the learned descriptor changes when the shape
    is turned.

    References
    ----------
    Fey, Lenssen, Weichert, Mueller, "SplineCNN: fast geometric deep learning with continuous B-spline kernels", CVPR
    2018, and the authors' example ``faust.py`` in PyTorch Geometric.
    """

    def __init__(
        self,
        in_channels: int,
        n_classes: int,
        channels: Sequence[int] = (32, 64, 64, 64, 64, 64),
        descriptor_channels: int = 256,
        kernel: int = 5,
        aggregate: Aggregate = "sum",
        dropout: float = 0.5,
    ) -> None:
        super().__init__()
        widths = itertools.pairwise((in_channels, *channels))
        self.convs = nn.ModuleList(SplineConv(a, b, kernel, aggregate) for a, b in widths)
        self.embed = nn.Linear(channels[-1], descriptor_channels)
        self.add_classifier(descriptor_channels, n_classes, dropout)
        self.kernel = kernel

    def stencils(self) -> dict[str, dict[str, Any]]:
        """Return the stencil that the convolutions gather neighbours with: the edge splines."""
        return {"edge_splines": {"kernel": self.kernel}}

    def operators(self, surface: Surface, dtype: torch.dtype) -> tuple[Any, ...]:
        """Return the tensors of the edge splines."""
        return (surface.stencil("edge_splines"),)


class SplineConv(nn.Module):
    r"""Spline convolution of degree 1 over the mesh edges.

    .. math::
        y_i = \sum_{j \sim i} \sum_m B_m(u_{ij}) \, x_j W_m + x_i W_\mathrm{root} + b

    Parameters
    ----------
    in_channels, out_channels
        Channels C_in of the input and C_out of the output functions.
    kernel
        Number s of control points per axis.
    aggregate
        "sum" for the formula above, or "mean" for its sum over j divided by the number of neighbours.

    Shapes
    ------
    input (N, C_in), output (N, C_out); weight (s^3, C_in, C_out), root (C_out, C_in), bias (C_out,).
    """

    def __init__(self, in_channels: int, out_channels: int, kernel: int = 5, aggregate: Aggregate = "sum") -> None:
        super().__init__()
        if aggregate not in get_args(Aggregate):
            raise ValueError(f'aggregate must be "sum" or "mean", got {aggregate!r}')
        self.aggregate: Aggregate = aggregate
        self.weight = nn.Parameter(torch.empty(kernel**3, in_channels, out_channels))
        self.root = nn.Linear(in_channels, out_channels, bias=False)
        self.bias = nn.Parameter(torch.zeros(out_channels))
        self.reset_parameters()

    def reset_parameters(self) -> None:
        """Draw the weights uniformly within one over the square root of their fan-in, as the authors do.

        The bias is set to zero.
        """
        points, fan_in, _ = self.weight.shape
        nn.init.uniform_(self.weight, -1 / math.sqrt(points * fan_in), 1 / math.sqrt(points * fan_in))
        nn.init.uniform_(self.root.weight, -1 / math.sqrt(fan_in), 1 / math.sqrt(fan_in))
        nn.init.zeros_(self.bias)

    def forward(self, x: Tensor, stencil: Mapping[str, Tensor]) -> Tensor:
        """Convolve the functions `x`, shape (N, C_in), on the shape with this stencil "edge_splines"."""
        messages = spline_messages(x, self.weight, stencil)
        if self.aggregate == "mean":
            messages = messages / stencil["degrees"][:, None].to(x.dtype)
        y: Tensor = messages + self.root(x) + self.bias
        return y

    def extra_repr(self) -> str:
        """Show the sizes when the module is printed."""
        points, fan_in, fan_out = self.weight.shape
        return f"{fan_in}, {fan_out}, points={points}, aggregate={self.aggregate!r}"


def spline_messages(x: Tensor, weight: Tensor, stencil: Mapping[str, Tensor]) -> Tensor:
    """Return sum_m S_m x W_m, shape (N, C_out), for the matrices S_m of the stencil "edge_splines".

    One control point at a time is gathered, multiplied and scattered, so that no intermediate result is larger than
    the functions themselves.  The transpose of S_m is the matrix of the mirrored control point m'.  With V_m = S_m dy,
    the gradient of x is therefore sum_m V_m W_m'^T and that of W_m' is x^T V_m, and the backward pass also gathers once
    per control point.

    Parameters
    ----------
    x
        Functions, shape (N, C_in).
    weight
        Shape (s^3, C_in, C_out).
    stencil
        The tensors of `csm.operators.stencils.edge_splines.EdgeSplines` with a kernel of s.
    """
    with without_autocast(x):
        y: Tensor = _SplineMessages.apply(widened(x), weight, stencil)  # type: ignore[no-untyped-call]
    return y


class _Gathered(NamedTuple):
    """The R_m rows of S_m x that are not empty, for one control point."""

    point: int
    targets: Tensor  # (R_m,), the vertices of the rows, each at most once
    rows: Tensor  # (R_m, C)


def _gathered(x: Tensor, stencil: Mapping[str, Tensor]) -> Iterator[_Gathered]:
    """Yield the rows of S_m x that are not empty, for one control point m after the other."""
    offsets = stencil["offsets"]
    starts: list[int] = (stencil["starts"] if "starts" in stencil else stencil["indptr"][offsets]).tolist()
    bounds: list[int] = offsets.tolist()
    for point, ((begin, end), (first, last)) in enumerate(
        zip(itertools.pairwise(bounds), itertools.pairwise(starts), strict=True)
    ):
        if begin < end:
            indptr = stencil["indptr"][begin : end + 1] - first
            matrix = Csr(indptr, stencil["indices"][first:last], stencil["values"][first:last])
            yield _Gathered(point, stencil["targets"][begin:end], matrix.times(x))


class _SplineMessages(torch.autograd.Function):
    """`spline_messages` with the gradients that its docstring derives."""

    @staticmethod
    def forward(ctx: Any, x: Tensor, weight: Tensor, stencil: Mapping[str, Tensor]) -> Tensor:
        ctx.save_for_backward(x, weight)
        ctx.stencil = stencil
        y = x.new_zeros(len(x), weight.shape[2])
        room = torch.empty_like(y)
        for point, targets, rows in _gathered(x, stencil):
            y.index_add_(0, targets, torch.mm(rows, weight[point], out=room[: len(rows)]))
        return y

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, dy: Tensor) -> tuple[Tensor | None, ...]:
        x, weight = ctx.saved_tensors
        dx = torch.zeros_like(x) if ctx.needs_input_grad[0] else None
        dw, room = torch.zeros_like(weight), torch.empty_like(x)
        for point, targets, rows in _gathered(dy.contiguous(), ctx.stencil):
            mirrored = len(weight) - 1 - point
            torch.mm(x.index_select(0, targets).T, rows, out=dw[mirrored])
            if dx is not None:
                dx.index_add_(0, targets, torch.mm(rows, weight[mirrored].T, out=room[: len(rows)]))
        return dx, dw, None
