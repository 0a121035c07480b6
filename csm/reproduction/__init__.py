"""The tables and figures of the paper, declared over the evaluation engine, with the published numbers beside ours."""

from csm.reproduction.study import Context, Findings, Study, write_findings

__all__ = ["Context", "Findings", "Study", "write_findings"]
