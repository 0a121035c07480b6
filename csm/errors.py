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


class ParameterError(ConfigError):
    """A parameter of an object has a value that cannot work.

    Parameters
    ----------
    owner
        What the object is called.
    name, value
        The parameter, and what came.
    wanted
        In words.
    """

    def __init__(self, owner: str, name: str, value: object, wanted: str) -> None:
        super().__init__(owner, name, value, wanted)  # all of them, so that it can be pickled
        self.owner, self.name, self.value, self.wanted = owner, name, value, wanted

    def __str__(self) -> str:
        return f"{self.owner}: {self.name}={self.value!r}; wanted {self.wanted}"
