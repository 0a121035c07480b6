"""Studies: the tables and figures of the paper, made again from data, one module each."""

from __future__ import annotations

from csm.studies.study import Context, Findings, write_findings

__all__ = ["Context", "Findings", "write_findings"]
