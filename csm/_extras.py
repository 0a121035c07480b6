"""The name that csm has on the package index, and how its extras are installed."""

from __future__ import annotations

DISTRIBUTION = "csm-correspondence"
"""Not the name that is imported: "csm" on the package index is another program."""


def install_line(extra: str) -> str:
    """Return what to type to install csm with one of its extras, in quotes that every shell takes.

    Examples
    --------
    >>> install_line("prep")
    'pip install "csm-correspondence[prep]"'
    """
    return f'pip install "{DISTRIBUTION}[{extra}]"'
