"""The most memory that this process has held."""

from __future__ import annotations

import sys
from pathlib import Path


def peak_megabytes() -> float:
    """Return the peak of this process's resident memory in MB (2^20 bytes); NaN where it is not known (Windows)."""
    status = Path("/proc/self/status")
    if status.exists():  # on Linux the other count starts from the peak of the process that started this one
        peak = next((line for line in status.read_text().splitlines() if line.startswith("VmHWM")), "")
        return float(peak.split()[1]) / 2**10 if peak else float("nan")
    if sys.platform != "darwin":
        return float("nan")
    import resource

    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
