"""MATLAB v7.3 files, which are HDF5, and HDF5 files in the same spirit that were written by hand.

The HDF5 library is run in a process of its own with limits: of 40 000 damaged files, one kept it busy without end, and
such a library cannot be interrupted from within.  That costs about a third of a second per file.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np

from csm.errors import MeshError
from csm.mesh.io.matlab5 import Value

_MAGIC = b"\x89HDF\r\n\x1a\n"
_PROGRAM = Path(__file__).with_name("_hdf5.py")
_LONGEST = 120.0
"""Seconds; the limit that a machine under heavy load meets.  The process itself has a limit of processor time."""


def is_hdf5(data: bytes) -> bool:
    """Tell whether the bytes are an HDF5 file, perhaps behind a header of 512 bytes or more, as MATLAB writes it."""
    return any(data[at : at + 8] == _MAGIC for at in (0, 512, 1024, 2048, 4096))


def read_hdf5(data: bytes) -> dict[str, Value]:
    """Return the variables of an HDF5 file by name; arrays are transposed, since MATLAB is column-major.

    Raises
    ------
    MeshError
        If the file is damaged, announces more than it holds, or refers to other files (external links, external
        storage, virtual data sets), which could be any of the user's.
    """
    # HDF5 loads its filters from folders that this variable names; it needs none of them.
    surroundings = {**os.environ, "HDF5_PLUGIN_PRELOAD": "::", "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    command = [sys.executable, str(_PROGRAM)]
    try:
        done = subprocess.run(command, input=data, capture_output=True, timeout=_LONGEST, env=surroundings, check=False)
    except subprocess.TimeoutExpired:
        raise MeshError(f"reading it as HDF5 took more than {_LONGEST:.0f} seconds: it is damaged") from None
    if -done.returncode == getattr(signal, "SIGPROF", None):
        raise MeshError("the HDF5 library was still busy with it when its time was over: it is damaged")
    if done.returncode < 0:
        raise MeshError(f"reading it ended the HDF5 library (signal {-done.returncode}): it is damaged")
    if done.returncode or len(done.stdout) < 8:
        last = done.stderr.decode(errors="replace").strip().rpartition("\n")[2]
        raise MeshError(f"the HDF5 library cannot read it ({last[:200] or 'it ended early'})")
    return _unpacked(done.stdout)


def _unpacked(output: bytes) -> dict[str, Value]:
    """Turn what the program wrote back into variables: the length of a json text, that text, the arrays' bytes."""
    start = 8 + int.from_bytes(output[:8], "little")
    answer = json.loads(output[8:start])
    if "refused" in answer:
        raise MeshError(answer["refused"])
    value = _value(answer["tree"], memoryview(output)[start:])
    assert isinstance(value, dict)
    return value


def _value(node: Any, blobs: memoryview) -> Value:
    if node is None:
        return None
    if "struct" in node:
        return {key: _value(item, blobs) for key, item in node["struct"].items()}
    if "list" in node:
        return [_value(item, blobs) for item in node["list"]]
    dtype, at = np.dtype(node["dtype"]), node["at"]
    flat = np.frombuffer(blobs, dtype, int(np.prod(node["shape"], dtype=np.int64)), at)
    return flat.reshape(node["shape"], order="F")
