"""Errors that a user can cause and mend.

Every message names the file or object, says what came, what was wanted and what to do.  The commands print such an
error as one paragraph and exit with status 2; anything else is a defect of csm and keeps its traceback.
"""

from __future__ import annotations


class CsmError(Exception):
    """Base of every error that the user, not csm, can mend."""


class MeshError(CsmError):
    """A mesh file or a mesh cannot be used as asked."""


class DataError(CsmError):
    """A data set, split, label file or store is missing, incomplete or inconsistent."""


class NumericalError(CsmError):
    """An operator, eigenproblem or geodesic computation failed in a way that a mended mesh would not."""


class ConfigError(CsmError):
    """An option has a value that cannot work."""
