"""Several descriptors side by side."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from csm._types import IntArray
from csm.descriptors.base import Descriptor, Features, record
from csm.errors import ConfigError
from csm.operators.operators import Operators


@dataclass(frozen=True)
class Stack(Descriptor):
    """The columns of several descriptors, one after the other: a richer input for a network.

    Nothing is rescaled, so for nearest neighbours the descriptor with the greatest numbers decides.

    Parameters
    ----------
    parts
        The descriptors by name, at least one; they share the eigensystems of the shape.

    Raises
    ------
    ConfigError
        If there is no part.

    Examples
    --------
    >>> from csm.descriptors import HKS, WKS
    >>> Stack({"heat": HKS(n_times=2), "wave": WKS()}).parameters()["parts"]["heat"]
    {'name': 'hks', 'k': 300, 'n_times': 2, 'scaled': True}
    """

    parts: Mapping[str, Descriptor]

    name: ClassVar[str] = "stack"

    def __post_init__(self) -> None:
        super().__post_init__()
        named = isinstance(self.parts, Mapping) and all(isinstance(part, Descriptor) for part in self.parts.values())
        if not named:
            raise ConfigError(f"stack: parts={self.parts!r}; wanted descriptors by name")
        object.__setattr__(self, "parts", dict(self.parts))
        if not self.parts:
            raise ConfigError("a stack needs at least one descriptor")

    @property
    def eigenpairs(self) -> int:
        """Those of the part that asks for most."""
        return max(part.eigenpairs for part in self.parts.values())

    def evaluate(self, operators: Operators) -> Features:
        """Return the descriptor of every vertex, (N, sum of the parts' columns)."""
        found = {name: part(operators) for name, part in self.parts.items()}
        columns = (f"{name} {column}" for name, features in found.items() for column in features.columns)
        return Features(np.hstack([features.values for features in found.values()]), tuple(columns))

    def mirrored_columns(self) -> IntArray:
        """Return where the columns of a mirror image are, part by part."""
        found: list[IntArray] = []
        for part in self.parts.values():
            found.append(part.mirrored_columns() + sum(map(len, found)))
        return np.concatenate(found)

    def parameters(self) -> dict[str, Any]:
        """Return the record of every part as plain data."""
        return {"parts": {name: record(part) for name, part in self.parts.items()}}
