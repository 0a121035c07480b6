"""Progress bars that redraw themselves in a terminal and write a line now and then into a log."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterable
from typing import Any, TextIO

from tqdm import tqdm

FIRST, SECONDS = 15.0, 60.0
"""Where there is no terminal: least time before the first line of a bar, and between lines in the end.

The time from a line to the next is twice the one before it, up to `SECONDS`.
"""


class Lines:
    """A stream for tqdm that passes a redrawn bar on as whole lines, and few of them."""

    def __init__(self, stream: TextIO, first: float, seconds: float) -> None:
        self.stream, self.seconds = stream, seconds
        self._wait = first
        self._due = time.monotonic() + first

    def write(self, text: str) -> None:
        """Write the text as one line if the last one is long enough ago; else drop it."""
        line = text.replace("\x1b[A", "").strip()
        if line and time.monotonic() >= self._due:
            self.stream.write(line + "\n")
            self.stream.flush()
            self._wait = min(2 * self._wait, self.seconds)
            self._due = time.monotonic() + self._wait

    def flush(self) -> None:
        """Do nothing: every line is flushed as it is written."""


def progress_bar(items: Iterable[Any] | None = None, **options: Any) -> tqdm[Any]:
    """Make a tqdm bar on stderr; with no terminal there, it becomes a line now and then."""
    file: Any = sys.stderr if sys.stderr.isatty() else Lines(sys.stderr, FIRST, SECONDS)
    return tqdm(items, file=file, **options)
