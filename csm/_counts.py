"""Counts of things in messages: one vertex, two vertices."""

from __future__ import annotations

_IRREGULAR = {"vertex": "vertices", "mesh": "meshes", "copy": "copies", "entry": "entries", "body": "bodies"}


def counted(n: int, one: str, many: str = "") -> str:
    """Return a number and what it counts, in the singular or the plural.

    Parameters
    ----------
    n
        How many.
    one
        What is said of one of them: a noun, or a phrase.
    many
        What is said of another number; by default `one` with its last word in the plural.

    Examples
    --------
    >>> counted(1, "mesh file"), counted(0, "shape"), counted(2, "vertex"), counted(1, "byte follows", "bytes follow")
    ('1 mesh file', '0 shapes', '2 vertices', '1 byte follows')
    """
    if n == 1:
        return f"{n} {one}"
    before, space, noun = one.rpartition(" ")
    return f"{n} {many or before + space + _IRREGULAR.get(noun, f'{noun}s')}"
