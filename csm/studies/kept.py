"""Answers that a study keeps in files, so that a killed study goes on where it was."""

from __future__ import annotations

import json
import logging
import os
import platform
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from csm.mesh.io import atomic_path

_log = logging.getLogger(__name__)


def kept(path: Path, question: Mapping[str, Any], make: Callable[[], Mapping[str, Any]]) -> dict[str, Any]:
    """Return the answer that a file holds if it is to this question; else make it and keep it there.

    Parameters
    ----------
    path
        A json file: the entries of the answer, and the question as the entry of that name.
    question, make
        Plain data (no answer may have an entry "question"), and what answers it.

    Returns
    -------
    dict
        The answer as json gives it back, so that it is the same whether it was made or read.
    """
    answer = recall(path, question)
    return keep(path, question, make()) if answer is None else answer


def recall(path: Path, question: Mapping[str, Any]) -> dict[str, Any] | None:
    """Return the answer that a file holds if there is one to this question."""
    if not path.exists():
        return None
    content: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    if content.pop("question", None) == json.loads(json.dumps(dict(question))):
        return content
    _log.warning("%s answers another question (its parameters are in the file); it is made again", path)
    return None


def keep(path: Path, question: Mapping[str, Any], answer: Mapping[str, Any]) -> dict[str, Any]:
    """Write an answer with its question, under a temporary name first, and return it as `recall` will."""
    text = json.dumps({"question": dict(question), **answer}, indent=1)
    with atomic_path(path) as temporary:
        temporary.write_text(text + "\n", encoding="utf-8")
    content: dict[str, Any] = json.loads(text)
    del content["question"]
    return content


def this_machine() -> str:
    """Return what a time depends on besides the question, such as "x86_64, 2 processors"."""
    return f"{platform.machine()}, {os.cpu_count()} processors"
