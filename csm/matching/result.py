"""What matching two meshes gives: the map in both directions, how far to believe it, and what can be done with it."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from numpy.typing import ArrayLike

from csm._places import load
from csm._types import Float32Array, FloatArray, IntArray
from csm.errors import ConfigError
from csm.matching.barycentric import BarycentricMap
from csm.matching.base import Matcher
from csm.matching.confidence import Confidence
from csm.matching.errors import Normaliser, map_errors
from csm.matching.functional import FunctionalMap
from csm.matching.maps import VertexMap
from csm.matching.methods import Method
from csm.matching.transfer import Kind, transfer
from csm.matching.way import Way
from csm.mesh.shape import Mesh
from csm.operators.geodesic import Method as Distance


@dataclass(frozen=True, eq=False)
class Match:
    """Two meshes and the map from one to the other, source -> target.

    Parameters
    ----------
    source, target
        The meshes, with the vertices as they were given.
    there, back
        The map source -> target and the one target -> source, in the forms that were computed.
    method, matcher
        How it was made.
    notes
        What a careful reader should know: what the files, the cleaning, the check and the comparison of both say.
    refinement
        What the refinement did, in words; empty where there was none.
    features
        Descriptors of both, shapes (N_source, Q) and (N_target, Q); zero where none was computed.  None if left out.
    """

    source: Mesh
    target: Mesh
    there: Way
    back: Way
    method: Method
    matcher: Matcher
    notes: tuple[str, ...] = ()
    refinement: str = ""
    features: tuple[Float32Array, Float32Array] | None = None

    @property
    def vertex_map(self) -> VertexMap:
        """From every vertex of the source to one of the target; -1 for debris and vertices in no face."""
        return self.there.vertex_map

    @property
    def barycentric(self) -> BarycentricMap | None:
        """From every vertex of the source into a face of the target; None if that was not computed."""
        return self.there.barycentric

    @property
    def functional_map(self) -> FunctionalMap | None:
        """The map between functions on the two meshes; None if that was not computed."""
        return self.there.functional_map

    @property
    def confidence(self) -> Confidence:
        """How far to believe the partner of each vertex of the source."""
        if self.there.confidence is None:
            raise ConfigError(f"{self!r}: no confidence was computed; csm.match computes it")
        return self.there.confidence

    @property
    def indices(self) -> IntArray:
        """For each vertex of the source a vertex of the target, shape (N_source,), 0-based."""
        return self.vertex_map.indices

    @property
    def coverage(self) -> float:
        """Fraction of the target's vertices that something is mapped to."""
        return self.vertex_map.coverage

    @cached_property
    def inverse(self) -> Match:
        """The match target -> source; its own inverse is this match.

        It is the map that was computed in that direction: maps between vertices are not one to one.
        """
        other = replace(
            self,
            source=self.target,
            target=self.source,
            there=self.back,
            back=self.there,
            features=None if self.features is None else self.features[::-1],
        )
        other.__dict__["inverse"] = self
        return other

    @property
    def into_faces(self) -> BarycentricMap:
        """The barycentric map; where none was computed, the vertex map as one to corners of faces."""
        return self.barycentric or BarycentricMap.of_vertices(self.vertex_map, self.target.faces)

    def errors(
        self,
        truth: VertexMap | ArrayLike,
        distance: Distance = "exact",
        normaliser: Normaliser = "diameter",
    ) -> FloatArray:
        """Measure the map against a known one; see `csm.matching.errors.map_errors`.

        Parameters
        ----------
        truth
            Shape (N_source,): the true target vertex of each vertex of the source, -1 where it is unknown.
        distance
            "exact", "heat" or "edge", as of `csm.geodesics`.
        normaliser
            What errors are divided by: the geodesic diameter of the target, or the square root of its area.

        Returns
        -------
        FloatArray
            Shape (N_source,); NaN where the truth is unknown or the vertex has no partner.
        """
        return map_errors(self.vertex_map, truth, self.target, distance, normaliser)

    def transfer(self, what: Any, kind: Kind | None = None, *, fill: Any = None) -> Any:
        """Bring something from the target to the source: fields, labels, colours, landmarks or a texture.

        ``match.inverse.transfer`` brings things from the source to the target.  See `csm.matching.transfer.transfer`.

        Parameters
        ----------
        what
            An array with a row per vertex or face of the target, a list of its vertices (kind="landmarks"), or a
            `csm.mesh.textured.Textured`.
        kind
            "values", "labels", "faces", "colors", "normals", "landmarks" or "texture", see
            `csm.matching.transfer.Kind`; None to tell by the type and the shape.
        fill
            What vertices without a partner get; None for NaN, or -1 for labels.
        """
        return transfer(what, self.into_faces, self.source, self.target, kind, back=self.back.vertex_map, fill=fill)

    def save(self, folder: str | os.PathLike[str], *, overwrite: bool = False) -> Path:
        """Write what ``csm match`` writes: the map, coloured meshes, a page to look at and an account of it.

        Parameters
        ----------
        folder
            Where the files go; it is made if needed.
        overwrite
            Whether files of these names may be replaced that csm did not write, or that were changed since; files
            that are as csm left them are replaced in any case.

        Returns
        -------
        Path
            The folder.

        Raises
        ------
        DataError
            If there is a file of such a name that may not be replaced, such as an input, or the folder cannot be
            written.
        """
        return Path(load("csm.viewer.match_folder:save_match")(self, folder, overwrite=overwrite))

    def show(self) -> Path:
        """Open a page in the browser to turn both meshes around, and return the temporary file that it is in."""
        return Path(load("csm.viewer.match_folder:show_match")(self))

    def _repr_html_(self) -> str | None:
        """Show both meshes in a notebook."""
        frame: str | None = load("csm.viewer.notebook:match_frame")(self)
        return frame

    def __repr__(self) -> str:
        names = f"{self.vertex_map.source} -> {self.vertex_map.target}"
        return f"Match({names} by {self.method.name}, {self.matcher.name})"
