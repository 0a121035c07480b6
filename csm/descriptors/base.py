"""The base class of all descriptors, and what calling one returns.

A descriptor is a frozen dataclass: its fields are its parameters, and calling it on a mesh returns `Features`.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from functools import cache
from numbers import Integral, Real
from typing import Any, ClassVar, Literal, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import DTypeLike, NDArray

from csm._counts import counted
from csm._types import FloatArray, IntArray
from csm.errors import ConfigError, ParameterError
from csm.mesh.inputs import MeshLike, as_mesh
from csm.operators.operators import Operators


@dataclass(frozen=True, eq=False)
class Features:
    """A descriptor evaluated at every vertex.

    ``numpy.asarray(features)`` is `values`, so features can be given to functions of arrays.

    Attributes
    ----------
    values
        Shape (N, Q).
    columns
        What each of the Q columns is, such as ``"theta=0.157 T3"``.
    """

    values: FloatArray
    columns: tuple[str, ...]

    @property
    def shape(self) -> tuple[int, int]:
        """Number of vertices N and of columns Q."""
        n, q = self.values.shape
        return n, q

    def __len__(self) -> int:
        return len(self.values)

    def __array__(self, dtype: DTypeLike | None = None, copy: bool | None = None) -> NDArray[Any]:
        if copy is False and dtype is not None and np.dtype(dtype) != self.values.dtype:
            raise ValueError(f"features of type {self.values.dtype} become {np.dtype(dtype)} only as a copy")
        return np.array(self.values, dtype=dtype) if copy else np.asarray(self.values, dtype=dtype)

    def __repr__(self) -> str:
        n, q = self.shape
        ends = self.columns[:1] + self.columns[1:][-1:]
        return f"Features({counted(n, 'vertex')}, {counted(q, 'column')}: {' ... '.join(ends)})"


_WANTED = {
    "int": "a whole number",
    "float": "a finite number",
    "bool": "true or false",
    "tuple[float, ...]": "a list of finite numbers",
    "tuple[str, ...]": "a list of names",
}
"""Annotations of parameters that are checked, and what is wanted of them."""


def _is_kind(value: Any, kind: str) -> bool:
    if kind.startswith("tuple"):
        several, each = isinstance(value, Sequence) and not isinstance(value, str), kind[6:].partition(",")[0]
        return several and all(isinstance(one, str) if each == "str" else _is_kind(one, each) for one in value)
    if kind == "bool" or isinstance(value, bool):
        return kind == "bool" and isinstance(value, bool)
    return isinstance(value, Integral) if kind == "int" else isinstance(value, Real) and math.isfinite(value)


@cache
def _choices(family: type) -> dict[str, tuple[Any, ...]]:
    """Return the words among which parameters of a family choose, by their annotations."""
    hints = get_type_hints(family).items()
    return {name: get_args(hint) for name, hint in hints if get_origin(hint) is Literal}


@dataclass(frozen=True)
class Descriptor(ABC):
    """A map from a shape to one row of numbers per vertex: the base class of every family of descriptors.

    A family is a frozen dataclass that derives from this class.  It has its parameters as fields, a `name`, and a
    method `evaluate`.

    Attributes
    ----------
    by_component
        Whether it is evaluated on each component by itself, at the scale of the whole: the few smallest eigenvalues of
        a mesh of several components are those of the larger ones, and say nothing of the others.
    turns
        Whether it changes when the shape is turned, so that its neighbours are right only where both
        shapes stand alike.
    name
        What stored results and checkpoints call the family.
    version
        Raised by one when a change of the formula gives other values for the same parameters.
    added
        Parameters that came after the first release, each with the value at which it changes nothing: at that value
        it is left out of `parameters()`, so keys of stored results and checkpoints written before stay valid.
    """

    name: ClassVar[str]
    version: ClassVar[int] = 1
    added: ClassVar[Mapping[str, Any]] = {}
    by_component: ClassVar[bool] = False
    turns: ClassVar[bool] = False

    def __post_init__(self) -> None:
        """Raise a ConfigError if a parameter is not of the kind, or none of the words, of its annotation.

        Families check more.  Numbers of other libraries become Python's, which can be written to files.
        """
        for field in fields(self):
            kind, _, rest = str(field.type).partition(" | ")
            value = getattr(self, field.name)
            if kind not in _WANTED or (value is None and rest == "None"):
                continue
            if not _is_kind(value, kind):
                raise ParameterError(self.name, field.name, value, _WANTED[kind])
            if kind in ("int", "float") and not isinstance(value, int | float):
                object.__setattr__(self, field.name, int(value) if kind == "int" else float(value))
        for name, words in _choices(type(self)).items():
            value = getattr(self, name)
            known = any(type(value) is type(word) and value == word for word in words)
            self.require(known, name, f"one of {', '.join(words)}")

    def require(self, good: bool, name: str, wanted: str) -> None:
        """Raise a `csm.errors.ParameterError` about a parameter unless its value is good.

        Parameters
        ----------
        good
            Whether it is.
        name
            Of the parameter.
        wanted
            What is wanted of it, in words.
        """
        if not good:
            raise ParameterError(self.name, name, getattr(self, name), wanted)

    def require_at_least(self, least: int, *names: str) -> None:
        """Raise a `csm.errors.ParameterError` about the first of these parameters that is below `least`."""
        for name in names:
            self.require(getattr(self, name) >= least, name, f"{least} or more")

    def require_positive(self, *names: str) -> None:
        """Raise a `csm.errors.ParameterError` about the first of these lists that is empty or has a number up to 0."""
        for name in names:
            values = getattr(self, name)
            self.require(bool(values) and min(values) > 0, name, "one number or more, all above 0")

    @property
    def eigenpairs(self) -> int:
        """Greatest number of eigenpairs asked of one operator; 0 if none are.

        It is the parameter `k` if there is one, unless a family says otherwise.  Of several descriptors of one shape
        evaluate the one that asks for most first: `Operators` reuses its spectrum for the others.
        """
        return int(getattr(self, "k", 0))

    def __call__(self, shape: MeshLike | Operators) -> Features:
        """Evaluate on a mesh, which is first scaled to unit area, or on operators made before, used as they are.

        A mesh may be a file, of csm, of trimesh, or a pair (vertices, faces) of arrays.

        Debris takes no part (`csm.mesh.debris`); a vertex of it has the row of the nearest vertex of the body.
        """
        operators = as_operators(shape)
        if operators.body is None and self.by_component and operators.n_components > 1:
            return self._by_component(operators)
        if operators.body is None:
            return self.evaluate(operators)
        features = self(operators.body.operators)
        return Features(features.values[operators.body.nearest], features.columns)

    def _by_component(self, operators: Operators) -> Features:
        parts = [(part.vertices, self.evaluate(part.operators)) for part in operators.parts()]
        values = np.zeros((operators.mesh.n_vertices, parts[0][1].shape[1]))
        for vertices, features in parts:
            values[vertices] = features.values
        return Features(values, parts[0][1].columns)

    @abstractmethod
    def evaluate(self, operators: Operators) -> Features:
        """Return the descriptor of every vertex of the mesh of `operators`, which is without debris."""

    def mirrored_columns(self) -> IntArray:
        """Return which column of a shape is which of its mirror image: column i there is column ``[i]`` here.

        Shape (Q,).  It makes the descriptor of a mirror image without computing it.

        Raises
        ------
        ConfigError
            If that is not known of this descriptor.
        """
        raise ConfigError(f"{self.name}: it is not known how its columns change when a shape is mirrored")

    def parameters(self) -> dict[str, Any]:
        """Return the parameters as plain data, without those of `added` that have their neutral value."""
        return {key: x for key, x in asdict(self).items() if key not in self.added or x != self.added[key]}


def record(descriptor: Descriptor) -> dict[str, Any]:
    """Return name, parameters and, from the second on, version: what keys and checkpoints know a descriptor by.

    `csm.descriptors.from_parameters` makes the descriptor of a record.
    """
    found = {"name": descriptor.name, **descriptor.parameters()}
    return found if descriptor.version == 1 else {**found, "version": descriptor.version}


def as_operators(shape: MeshLike | Operators) -> Operators:
    """Return `shape` itself if it is `Operators`, else the operators of the mesh at unit area.

    Raises
    ------
    ConfigError
        If it is neither `Operators` nor what `csm.mesh.inputs.as_mesh` takes for a mesh.
    MeshError
        If it is a mesh that cannot be read or used.
    """
    if isinstance(shape, Operators):
        return shape
    return Operators(as_mesh(shape))
