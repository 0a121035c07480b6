"""Errors of maps: the protocol that makes them comparable, the engine that measures them, rows and tables."""

from csm.evaluation.engine import evaluate
from csm.evaluation.protocol import EvaluationProtocol
from csm.evaluation.results import Evaluation

__all__ = ["Evaluation", "EvaluationProtocol", "evaluate"]
