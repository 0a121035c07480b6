"""Errors of maps: the protocol that makes them comparable, the engine that measures them, rows and tables."""

from typing import TYPE_CHECKING

from csm._places import lazily

if TYPE_CHECKING:
    from csm.evaluation.engine import evaluate
    from csm.evaluation.protocol import EvaluationProtocol
    from csm.evaluation.results import Evaluation

__all__ = ["Evaluation", "EvaluationProtocol", "evaluate"]

_PLACES = {
    "csm.evaluation.engine": ("evaluate",),
    "csm.evaluation.protocol": ("EvaluationProtocol",),
    "csm.evaluation.results": ("Evaluation",),
}

if not TYPE_CHECKING:
    __getattr__, __dir__ = lazily(__name__, _PLACES)
