"""The multiscale convolution of MGCN, computed without storing its N x N operators."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping
from typing import Any, Literal, NamedTuple

import torch
from torch import Tensor, nn
from torch.autograd.function import once_differentiable

from csm.networks.sparse import widened, without_autocast

Products = Literal["float32", "bfloat16"]

HELD_BYTES = 3e9
"""Blocks of up to this total size are kept in memory for all layers; greater ones are made anew for every product."""

WHOLE_ROWS = 1024
"""Rows that are multiplied together where the operators are not taken sparse."""


class Patch(NamedTuple):
    """A patch of vertices, the vertices that its wavelets reach, and the weights of these in the wavelets' averages.

    Shapes: `rows` (R,) are the vertices of the patch, and `columns` (C,) those that they reach.  For each of the S
    wavelets, `powers` has the fourth powers of the kernel between the rows and the first C_s columns, (R, C_s).
    Multiplied with `scales` (R, S) these are the weights in an average, and `dropped` (R, S) is the weight that is left
    to the mean over all vertices.
    """

    rows: Tensor
    columns: Tensor
    powers: list[Tensor]
    scales: Tensor
    dropped: Tensor


class WaveletOperators:
    """The operators G_1 .. G_S of one shape, patch by patch (see `csm.operators.stencils.wavelets.Wavelets`).

    Parameters
    ----------
    stencil
        The tensors of the stencil "wavelets".
    dtype
        Type of the functions that the operators are applied to.
    products
        "float32" multiplies in the precision of the functions.  "bfloat16" rounds kernel and functions to eight
        significant bits, which is several times faster on processors with matrix units for it.
    whole
        Whether the operators are multiplied as full matrices, of which nothing is dropped.  None does so on a graphics
        card: there a few great products take less time than thousands of small ones, and nothing waits for the host.
    """

    def __init__(
        self,
        stencil: Mapping[str, Tensor],
        dtype: torch.dtype,
        products: Products = "float32",
        whole: bool | None = None,
    ) -> None:
        self._evecs, self._responses = stencil["evecs"].to(dtype), stencil["responses"].to(dtype)
        whole = self._evecs.is_cuda if whole is None else whole
        self._used: list[int]  # eigenfunctions of each wavelet; the responses to the rest are zeros
        self._extents: list[list[int]]
        if whole:
            (n, k), s = self._evecs.shape, self.n_wavelets
            every = torch.arange(n, device=self._evecs.device)
            self._rows = torch.split(every, WHOLE_ROWS)
            self._columns = (every,) * len(self._rows)
            self._dropped = torch.split(self._evecs.new_zeros(n, s), WHOLE_ROWS)
            self._used, self._extents = [k] * s, [[n] * s] * len(self._rows)
        else:
            used = stencil["used"] if "used" in stencil else self._responses.count_nonzero(0)
            self._used, self._extents = used.tolist(), stencil["extents"].tolist()
            self._rows, self._columns = _split(stencil, "row"), _split(stencil, "column")
            self._dropped = torch.split(stencil["dropped"].to(dtype), [len(rows) for rows in self._rows])
        self.dtype = torch.bfloat16 if products == "bfloat16" else dtype
        with without_autocast(self._evecs):
            self._held = list(self._make()) if self.n_bytes <= HELD_BYTES else None

    @property
    def n_wavelets(self) -> int:
        """Number S of operators."""
        return self._responses.shape[1]

    @property
    def n_bytes(self) -> int:
        """Size of the blocks of all patches, in bytes."""
        entries = sum(len(rows) * sum(extents) for rows, extents in zip(self._rows, self._extents, strict=True))
        return entries * self.dtype.itemsize

    def __iter__(self) -> Iterator[Patch]:
        """Iterate over the patches."""
        return self._make() if self._held is None else iter(self._held)

    def _make(self) -> Iterator[Patch]:
        parts = zip(self._rows, self._columns, self._extents, self._dropped, strict=True)
        for rows, columns, extents, dropped in parts:
            near, far = self._evecs[rows], self._evecs[columns]
            powers = [self._powers(s, near, far[:extent]) for s, extent in enumerate(extents)]
            sums = torch.stack([p.sum(1, dtype=self._evecs.dtype) for p in powers], 1)
            yield Patch(rows, columns, powers, (1 - dropped) / sums.clamp_min(torch.finfo(sums.dtype).tiny), dropped)

    def _powers(self, s: int, near: Tensor, far: Tensor) -> Tensor:
        used = self._used[s]
        squares = ((near[:, :used] * self._responses[:used, s]) @ far[:, :used].T).square_()
        torch.threshold_(squares, 1e-15, 0.0)  # only rounding errors, whose squares would be slow denormal numbers
        return squares.square_().to(self.dtype)

    def averages(self, x: Tensor) -> Tensor:
        """Return G_s^T x, shape (N, S, C): the averages of the functions `x`, shape (N, C), weighted by each wavelet.

        The weight that the stencil dropped is given to the mean over all vertices.
        """
        with without_autocast(x):
            y: Tensor = _Averages.apply(widened(x), self)  # type: ignore[no-untyped-call]
        return y


class _Averages(torch.autograd.Function):
    """`WaveletOperators.averages`, whose backward pass multiplies with the same blocks."""

    @staticmethod
    def forward(ctx: Any, x: Tensor, operators: WaveletOperators) -> Tensor:
        ctx.operators = operators
        y = x.new_empty(x.shape[0], operators.n_wavelets, x.shape[1])
        rounded, mean = x.to(operators.dtype), x.mean(0)
        for patch in operators:
            seen = rounded[patch.columns]
            sums = torch.stack([p @ seen[: p.shape[1]] for p in patch.powers], 1)
            y[patch.rows] = sums * patch.scales[:, :, None] + patch.dropped[:, :, None] * mean
        return y

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, grad: Tensor) -> tuple[Tensor, None]:
        operators: WaveletOperators = ctx.operators
        back = grad.new_zeros(grad.shape[0], grad.shape[2])
        to_mean = grad.new_zeros(grad.shape[2])
        for patch in operators:
            arriving = grad[patch.rows]
            to_mean += (arriving * patch.dropped[:, :, None]).sum((0, 1))
            scaled = (arriving * patch.scales[:, :, None]).transpose(0, 1).to(operators.dtype).contiguous()
            seen = grad.new_zeros(len(patch.columns), grad.shape[2])
            buffer = torch.empty_like(seen, dtype=operators.dtype)  # allocating memory for every product would be slow
            for power, part in zip(patch.powers, scaled, strict=True):
                n = power.shape[1]
                seen[:n] += torch.mm(power.T, part, out=buffer[:n])
            back.index_add_(0, patch.columns, seen)
        return back + to_mean / len(back), None


class MGConv(nn.Module):
    r"""Multiscale graph convolution with fixed wavelets.

    .. math:: y = \hat x W_0 + \sum_{s=1}^{S} G_s^\top \hat x \, W_s, \qquad
              \hat x = \frac{x - \min x}{\max x - \min x} \text{ per channel and shape}

    without bias.  A channel that is constant on the shape becomes 0.

    Parameters
    ----------
    in_channels, out_channels
        Channels C_in of the input and C_out of the output functions.
    wavelets
        Number S of operators.

    Shapes
    ------
    input (N, C_in), output (N, C_out); weight (S + 1, C_in, C_out).
    """

    def __init__(self, in_channels: int, out_channels: int, wavelets: int = 16) -> None:
        super().__init__()
        self.weight = nn.Parameter(torch.empty(wavelets + 1, in_channels, out_channels))
        self.reset_parameters()

    def reset_parameters(self) -> None:
        """Draw every W_s Xavier-uniformly."""
        bound = math.sqrt(6.0 / sum(self.weight.shape[1:]))
        nn.init.uniform_(self.weight, -bound, bound)

    def forward(self, x: Tensor, operators: WaveletOperators) -> Tensor:
        """Return the functions `x`, shape (N, C_in), convolved with these operators, shape (N, C_out)."""
        x = unit_range(x)
        return x @ self.weight[0] + operators.averages(x).flatten(1) @ self.weight[1:].flatten(0, 1)

    def extra_repr(self) -> str:
        """Show the sizes when the module is printed."""
        terms, fan_in, fan_out = self.weight.shape
        return f"{fan_in}, {fan_out}, wavelets={terms - 1}"


def unit_range(x: Tensor) -> Tensor:
    """Return `x`, shape (N, C), with each column brought to the range from 0 to 1; constant columns become 0."""
    least, most = x.amin(0), x.amax(0)
    width = most - least
    return (x - least) / torch.where(width > 0, width, torch.ones_like(width))


def _split(stencil: Mapping[str, Tensor], kind: str) -> tuple[Tensor, ...]:
    """Return the rows or columns, whichever `kind` says, of each patch."""
    ends = stencil[f"{kind}_ends"].tolist()
    return tuple(stencil[f"{kind}s"][a:b] for a, b in itertools.pairwise([0, *ends]))
