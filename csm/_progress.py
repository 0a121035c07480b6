"""Progress bars that redraw themselves in a terminal and write a line now and then into a log."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterable
from typing import Any, TextIO

from tqdm import tqdm

SECONDS = 60.0
"""Least time between two lines of a bar, and before its first one, where there is no terminal."""


class Lines:
    """A stream for tqdm that passes a redrawn bar on as whole lines, and few of them."""

    def __init__(self, stream: TextIO, seconds: float) -> None:
        self.stream, self.seconds = stream, seconds
        self._due = time.monotonic() + seconds

    def write(self, text: str) -> None:
        """Write the text as one line if the last one is long enough ago; else drop it."""
        line = text.replace("\x1b[A", "").strip()
        if line and time.monotonic() >= self._due:
            self.stream.write(line + "\n")
            self.stream.flush()
            self._due = time.monotonic() + self.seconds

    def flush(self) -> None:
        """Do nothing: every line is flushed as it is written."""


def progress_bar(items: Iterable[Any] | None = None, **options: Any) -> tqdm[Any]:
    """Make a tqdm bar on stderr; with no terminal there, it becomes a line a minute."""
    file: Any = sys.stderr if sys.stderr.isatty() else Lines(sys.stderr, SECONDS)
    return tqdm(items, file=file, **options)
