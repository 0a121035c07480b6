"""Whether the values of a configuration can work, before anything is read or computed.

What an option may be stands where it is used: the annotations of the class that a node of the configuration makes say
its names and types.  Only ranges that annotations cannot say are in the table here.
"""

from __future__ import annotations

import inspect
import logging
import math
import types
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, Literal, NamedTuple, Union, get_args, get_origin, get_type_hints

from hydra.utils import get_object
from omegaconf import DictConfig, OmegaConf

from csm.commands.groups import FILLED_IN
from csm.commands.words import PATHS, nearest_names
from csm.errors import ConfigError


class Range(NamedTuple):
    """The numbers that an option takes: whole or not, from `low` (or above it) to `high`, and perhaps none."""

    whole: bool
    low: float
    high: float = math.inf
    above: bool = False
    none: bool = False

    def holds(self, value: Any) -> bool:
        """Tell whether a value is in the range."""
        if value is None:
            return self.none
        if isinstance(value, bool) or not isinstance(value, int if self.whole else (int, float)):
            return False
        return math.isfinite(value) and (value > self.low if self.above else value >= self.low) and value <= self.high

    def __str__(self) -> str:
        kind = "a whole number" if self.whole else "a number"
        bound = f"above {self.low:g}" if self.above else f"from {self.low:g}"
        end = f" to {self.high:.0f}" if self.high < math.inf else ""
        return f"{kind} {bound}{end}" + ", or null" * self.none


_COUNT, _SOME = Range(True, 0), Range(True, 1)

RANGES: Mapping[str, Range] = {
    "seed": Range(True, 0, 2**32 - 1),
    "workers": Range(True, 0, none=True),
    "shards": _SOME,
    "shard": _COUNT,
    "unused_days": Range(False, 0, none=True),
    "debris": Range(False, 0, 1, none=True),
    "tolerance": Range(False, 0, 1),
    "count": _SOME,
    "trainer.max_epochs": _COUNT,
    "trainer.accumulate_grad_batches": _SOME,
    "trainer.num_nodes": _SOME,
    "trainer.check_val_every_n_epoch": _SOME,
    "trainer.log_every_n_steps": _COUNT,
    "trainer.num_sanity_val_steps": Range(True, -1),
    "trainer.gradient_clip_val": Range(False, 0, above=True, none=True),
    "optimizer.lr": Range(False, 0, above=True),
    "optimizer.weight_decay": Range(False, 0),
    "learning.loss_rows": Range(True, 1, none=True),
    "learning.vary": Range(False, 0, 10),
    "learning.mirror": Range(False, 0, 1),
    "learning.places": _COUNT,
    "model.ks": _SOME,
    "model.terms": _SOME,
    "model.dropout": Range(False, 0, 1),
    "data.basis_k": _COUNT,
    "data.holdout": _COUNT,
    "metric.seed": Range(True, 0, 2**32 - 1),
    "metric.sample": Range(True, 1, none=True),
    "metric.points": Range(True, 1, none=True),
}
"""Keys -> the numbers that they take, wherever they occur in a configuration."""

_FLAGS = ("debug", "test", "train", "overwrite", "weld", "split", "orient")
_TYPES = {bool: "true or false", int: "a whole number", float: "a number", str: "text", type(None): "null"}


def require_valid(cfg: DictConfig) -> None:
    """Raise if a value of a configuration has the wrong type or is out of range, or an option is unknown.

    Raises
    ------
    ConfigError
        Naming the key, what came and what is wanted.
    """
    plain: Any = OmegaConf.to_container(cfg, resolve=True)
    require_in_ranges(plain)
    _require_texts(plain)
    for group, node in plain.items():
        if isinstance(node, Mapping):
            _require_node(group, node)
    if "optimizer" in plain and "learning" in plain:
        from csm.learning.module import CSMModule

        for group in ("optimizer", "learning"):
            _require_options(group, plain[group] or {}, CSMModule)
    if isinstance(plain.get("model"), Mapping):
        _require_network(plain["model"])
    if isinstance(plain.get("metric"), Mapping):
        from csm.evaluation.protocol import EvaluationProtocol

        _require_options("metric", plain["metric"], EvaluationProtocol)


def require_in_ranges(plain: Mapping[str, Any]) -> None:
    """Raise if a number is out of its range, or a flag is none; keys that are not there are passed over."""
    for key, wanted in RANGES.items():
        there, value = _lookup(plain, key)
        if there and value != "???" and not wanted.holds(value):
            raise ConfigError(f"{key}={_shown(value)}: wanted {wanted}")
    there, widths = _lookup(plain, "model.channels")
    if there and isinstance(widths, list) and not (widths and all(map(_SOME.holds, widths))):
        raise ConfigError(f"model.channels={_shown(widths)}: wanted one or more of: {_SOME}")
    for key in _FLAGS:
        if key in plain and not isinstance(plain[key], bool):
            raise ConfigError(f"{key}={_shown(plain[key])}: wanted true or false")


def _require_texts(plain: Mapping[str, Any]) -> None:
    for key in ("name", "table"):
        if key in plain and plain[key] is not None and not (isinstance(plain[key], str) and plain[key]):
            raise ConfigError(f"{key}={_shown(plain[key])}: wanted a text")
    if "table" in plain and plain["table"] is None:
        raise ConfigError("table=null: wanted a text")
    for key in PATHS - {"data.test_roots", "paths"}:
        there, value = _lookup(plain, key)
        if there and value is not None and not isinstance(value, str):
            raise ConfigError(f"{key}={_shown(value)}: wanted a path")


def _lookup(plain: Mapping[str, Any], key: str) -> tuple[bool, Any]:
    node: Any = plain
    for part in key.split("."):
        if not isinstance(node, Mapping) or part not in node:
            return False, None
        node = node[part]
    return True, node


def _require_node(group: str, node: Mapping[str, Any]) -> None:
    """Check a node that makes an object, and those below it."""
    target = node.get("_target_")
    if isinstance(target, str):
        logging.getLogger("hydra._internal.utils").disabled = True  # the error says all that it logs
        try:
            cls = get_object(target)
        except Exception as error:
            why = str(error).splitlines()[0]
            raise ConfigError(f"{group}._target_={target}: there is no such class or function ({why})") from None
        _require_options(group, {key: value for key, value in node.items() if not key.startswith("_")}, cls)
    for key, below in node.items():
        if isinstance(below, Mapping):
            _require_node(f"{group}.{key}", below)


def _require_network(node: Mapping[str, Any]) -> None:
    from csm.networks import NETWORKS

    name = node.get("name")
    if name not in NETWORKS:
        near = nearest_names(str(name), NETWORKS)
        raise ConfigError(f"model.name={_shown(name)}: there is no such network{near}; there are {', '.join(NETWORKS)}")
    _require_options("model", {key: value for key, value in node.items() if key != "name"}, NETWORKS[str(name)])


def _require_options(group: str, given: Mapping[str, Any], cls: Callable[..., Any]) -> None:
    """Check names and types of options against the arguments of a class and, where it passes them on, of its bases."""
    hints, open_ended = arguments_of(cls)
    for key, value in given.items():
        if key not in hints:
            if open_ended:
                continue
            near = nearest_names(key, hints)
            raise ConfigError(f"{group}.{key}: there is no such option{near}; there are {', '.join(hints)}")
        if value == "???":
            raise ConfigError(f"{group}.{key} has to be given: {group}.{key}=VALUE")
        if not fits(value, hints[key]):
            raise ConfigError(f"{group}.{key}={_shown(value)}: wanted {described(hints[key])}")


def arguments_of(cls: Callable[..., Any]) -> tuple[dict[str, Any], bool]:
    """Return the types of the arguments of a class, and whether it takes any others.

    Examples
    --------
    >>> from csm.mesh.check import Finding
    >>> arguments_of(Finding)[0]["count"]
    <class 'int'>
    """
    found: dict[str, Any] = {}
    bases: Iterable[Any] = inspect.getmro(cls) if inspect.isclass(cls) else (cls,)
    for base in bases:
        function = base.__init__ if inspect.isclass(base) else base
        try:
            parameters = inspect.signature(function).parameters
        except (TypeError, ValueError):
            return found, True
        types_ = _hints(function)
        for name, parameter in parameters.items():
            if name not in FILLED_IN and parameter.kind not in (parameter.VAR_KEYWORD, parameter.VAR_POSITIONAL):
                found.setdefault(name, types_.get(name, Any))
        if not any(p.kind is p.VAR_KEYWORD for p in parameters.values()):
            return found, False
    return found, True


def _hints(function: Callable[..., Any]) -> dict[str, Any]:
    try:
        return get_type_hints(function)
    except Exception:  # names that are imported for type checkers only
        return {}


def fits(value: Any, hint: Any) -> bool:
    """Tell whether a plain value has an annotated type; what the configuration cannot hold counts as fitting.

    Examples
    --------
    >>> fits(3, float), fits(True, int), fits("a", Literal["a", "b"]), fits(None, int | None)
    (True, False, True, True)
    """
    origin, inner = get_origin(hint), get_args(hint)
    if origin in (Union, types.UnionType):
        return any(fits(value, one) for one in inner)
    if origin is Literal:
        return value in inner
    if hint in (bool, str, type(None)):
        return isinstance(value, hint)
    if hint in (int, float):
        number = isinstance(value, int if hint is int else (int, float)) and not isinstance(value, bool)
        return number and math.isfinite(value)
    if inspect.isclass(origin) and issubclass(origin, Sequence):
        return isinstance(value, list | tuple) and all(fits(one, inner[0]) for one in value if inner)
    return True


def described(hint: Any) -> str:
    """Return a phrase for an annotated type.

    Examples
    --------
    >>> described(Literal["exact", "heat"] | None)
    'exact, heat or null'
    """
    names = list(dict.fromkeys(_names(hint)))
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} or {names[-1]}"


def _names(hint: Any) -> list[str]:
    origin, inner = get_origin(hint), get_args(hint)
    if origin in (Union, types.UnionType):
        return [name for one in inner for name in _names(one)]
    if origin is Literal:
        return [str(one) for one in inner]
    if inspect.isclass(origin) and issubclass(origin, Sequence):
        return [f"a list ([...]) of: {described(inner[0])}" if inner else "a list"]
    return [_TYPES.get(hint, getattr(hint, "__name__", str(hint)))]


def _shown(value: Any) -> str:
    return "null" if value is None else str(value)
