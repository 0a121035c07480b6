"""Named lists of training and test shapes, with a checksum that results quote."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from csm._counts import counted
from csm.errors import DataError


@dataclass(frozen=True)
class Split:
    """Which shapes a network learns from and which it is tested on.

    Parameters
    ----------
    name
        What results call the split.
    train, test
        Names of the shapes, in order.
    source
        Where the split was published.
    validation
        Names of further shapes, neither fitted nor tested on, that a training is watched on.  The checksum leaves them
        out, since no result depends on them.
    """

    name: str
    train: tuple[str, ...]
    test: tuple[str, ...]
    source: str = ""
    validation: tuple[str, ...] = ()

    @property
    def checksum(self) -> str:
        """First 12 hex digits of the SHA-256 of both lists, in order."""
        return hashlib.sha256(json.dumps([self.train, self.test]).encode()).hexdigest()[:12]

    @property
    def label(self) -> str:
        """One line for result files: name, sizes and checksum."""
        return f"{self.name} ({len(self.train)} train, {len(self.test)} test, {self.checksum})"

    def held_out(self, n: int) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Divide the training list into shapes to fit and the last `n`, which are kept out of the fit.

        Raises
        ------
        DataError
            If that leaves nothing to fit.
        """
        if not 0 <= n < len(self.train):
            raise DataError(f"split {self.name}: cannot hold out {n} of {counted(len(self.train), 'training shape')}")
        keep = len(self.train) - n
        return self.train[:keep], self.train[keep:]

    def require(self, available: Sequence[str], where: str, part: str) -> None:
        """Raise a DataError if shapes of `part` ("train", "validation" or "test") are not among `available`."""
        wanted: tuple[str, ...] = getattr(self, part)
        missing = [name for name in wanted if name not in set(available)]
        if missing:
            raise DataError(
                f"{where}: {len(missing)} of the {len(wanted)} {part} shapes of split {self.name} are missing "
                f"({', '.join(missing[:5])}{', ...' if len(missing) > 5 else ''}); `csm check` lists what a folder has"
            )


def read_split(path: str | Path) -> Split:
    """Read a split from json: an object with name, train, test and, if there are any, source, validation and checksum.

    Raises
    ------
    DataError
        If the file is no split, a shape is in two lists or twice in one, or the checksum differs.
    """
    try:
        content = json.loads(Path(path).read_text())
        lists = content["train"], content["test"], content.get("validation", [])
        if not all(isinstance(names, list) and all(isinstance(name, str) for name in names) for names in lists):
            raise TypeError("train, test and validation are not lists of names")
        train, test, validation = map(tuple, lists)
        split = Split(str(content["name"]), train, test, str(content.get("source", "")), validation)
    except (OSError, ValueError, KeyError, TypeError, RecursionError) as error:
        raise DataError(f"{path}: not a split file; wanted json with name, train and test ({error!r})") from error
    every = [*split.train, *split.validation, *split.test]
    if len(set(every)) != len(every):
        twice = sorted({name for name in every if every.count(name) > 1})
        raise DataError(f"{path}: listed more than once: {', '.join(twice[:5])}")
    stated = content.get("checksum", split.checksum)
    if stated != split.checksum:
        raise DataError(f"{path}: the lists have checksum {split.checksum}, the file states {stated}: it was edited")
    return split


def as_split(split: str | Path | Split, known: Sequence[Split] = ()) -> Split:
    """Return a split: as it is given, one of the known ones by its name, or read from a json file.

    Raises
    ------
    DataError
        If there is no such name or file.

    Examples
    --------
    >>> as_split("tiny", [Split("tiny", ("a", "b"), ("c",))]).test
    ('c',)
    """
    if isinstance(split, Split):
        return split
    named = {entry.name: entry for entry in known}
    if str(split) in named:
        return named[str(split)]
    if not Path(split).is_file():
        raise DataError(
            f"split={split}: there is no such file; wanted {' or '.join(named)}, or the path of a json file"
            if named
            else f"split={split}: there is no such file; wanted the path of a json file"
        )
    return read_split(split)
