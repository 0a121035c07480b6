"""The trained networks that csm brings, by name."""

from __future__ import annotations

from pathlib import Path

FOLDER = Path(__file__).parents[1] / "assets" / "models"
"""It has a folder with an export of `csm.learning.checkpoint` and a card, ``README.md``, for each."""

_SETTINGS = "model.json"


def shipped_models() -> list[str]:
    """Return the names of the trained networks that csm brings.

    Examples
    --------
    >>> shipped_models()
    ['humans', 'humans_parts']
    """
    return sorted(path.parent.name for path in FOLDER.glob(f"*/{_SETTINGS}"))


def shipped_file(name: str) -> Path:
    """Return the file of a network that csm brings, as `csm.learning.checkpoint.load_module` takes it."""
    return FOLDER / name / _SETTINGS
