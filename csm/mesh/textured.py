"""A mesh with images on it: texture coordinates for every corner of every face."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from csm._counts import counted
from csm._types import FloatArray, IntArray
from csm.errors import MeshError
from csm.mesh.shape import Mesh


@dataclass(frozen=True)
class Image:
    """An image as its file holds it, such as a .png or .jpg; it is copied and never decoded.

    Parameters
    ----------
    suffix
        Of such a file: ".png", ".jpg", ...
    data
        The bytes of the file.
    """

    suffix: str
    data: bytes

    def __repr__(self) -> str:
        return f"Image({self.suffix}, {counted(len(self.data), 'byte')})"


@dataclass(frozen=True, eq=False)
class Textured:
    """A mesh with texture coordinates, which belong to corners of faces, so that they may jump at seams.

    Parameters
    ----------
    mesh
        The shape.
    uv
        Shape (M, 3, 2): for each corner of each face a place in the image; (0, 0) is the lower left corner of the
        image and (1, 1) the upper right one.  NaN for faces without texture.
    images
        The images.
    image_of
        Shape (M,): number of the image on each face, -1 for none.  By default the first image on every face with
        texture coordinates.
    notes
        What the reader noticed in the file.

    Raises
    ------
    MeshError
        If the shapes do not fit, or an image does not exist.

    Examples
    --------
    >>> corner = Mesh(np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), np.array([[0, 1, 2]]), "corner")
    >>> Textured(corner, np.array([[[0, 0], [1, 0], [0, 1]]]))
    Textured('corner', 1 of 1 face with texture coordinates, 0 images)
    """

    mesh: Mesh
    uv: FloatArray
    images: tuple[Image, ...] = ()
    image_of: IntArray | None = None
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        uv = np.array(self.uv, dtype=np.float64)
        if uv.shape != (self.mesh.n_faces, 3, 2):
            raise MeshError(
                f"{self.mesh.label}: texture coordinates have shape {uv.shape}, wanted ({self.mesh.n_faces}, 3, 2): "
                "two for each corner of each face"
            )
        uv[~np.isfinite(uv).all((1, 2))] = np.nan
        given = 0 if self.image_of is None else np.asarray(self.image_of)
        image_of = np.array(np.broadcast_to(given, (len(uv),)), dtype=np.int64)
        if self.image_of is None and not self.images:
            image_of[:] = -1
        if image_of.min(initial=-1) < -1 or image_of.max(initial=-1) >= len(self.images):
            raise MeshError(
                f"{self.mesh.label}: a face has image {image_of.max()}, counted from 0, but the mesh has "
                f"{counted(len(self.images), 'image')}"
            )
        image_of[np.isnan(uv[:, 0, 0])] = -1
        for key, array in (("uv", uv), ("image_of", image_of)):
            array.setflags(write=False)
            object.__setattr__(self, key, array)

    @property
    def image_numbers(self) -> IntArray:
        """Shape (M,): number of the image on each face, -1 for none."""
        assert self.image_of is not None
        return self.image_of

    @property
    def has_uv(self) -> IntArray:
        """Numbers of the faces with texture coordinates."""
        return np.flatnonzero(np.isfinite(self.uv[:, 0, 0]))

    def __repr__(self) -> str:
        return (
            f"Textured({self.mesh.name!r}, {len(self.has_uv)} of {counted(self.mesh.n_faces, 'face')} with texture "
            f"coordinates, {counted(len(self.images), 'image')})"
        )
