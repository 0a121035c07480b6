"""``csm prepare``: fill the store for all shapes of a data module, check it, or prune it."""

from __future__ import annotations

from csm.commands.main import run_as_program

if __name__ == "__main__":
    run_as_program(__file__)

import shutil
from typing import Any

from omegaconf import DictConfig

from csm._counts import counted
from csm.commands.app import command
from csm.commands.groups import make_data, register
from csm.data.base import DataModule
from csm.data.prepare import Job, Summary, prepare
from csm.data.store import Store
from csm.errors import ConfigError, DataError

register("data", "descriptor", "model")


def run(cfg: DictConfig) -> dict[str, Any]:
    """Fill, check or prune the store, and return counts."""
    if cfg.action == "check":
        return check_store(_existing_store(cfg.store))
    if cfg.action == "prune":
        return prune_store(_existing_store(cfg.store), _days(cfg.unused_days))
    if cfg.action != "fill":
        raise ConfigError(f"action={cfg.action}: wanted fill, check or prune")
    data = make_data(cfg)
    summary = fill_store(data, shard_of(all_jobs(data), cfg.shard, cfg.shards), cfg.workers)
    if summary.failures:
        raise DataError(
            f"{counted(len(summary.failures), 'shape')} cannot be prepared; the others are in the "
            f"store.\n{summary.table()}"
        )
    return {"present": summary.present, "made": summary.made, "seconds": summary.seconds}


def _existing_store(root: str | None) -> Store:
    store = Store(root)
    if root is not None and not store.root.is_dir():
        raise DataError(f"store={root}: there is no such folder")
    return store


def all_jobs(data: DataModule) -> list[Job]:
    """Return every training and test shape of a data module, each once, in an order that is always the same."""
    train = [Job(data.train_set, name) for name in data.train_names()]
    train += [Job(more.shapes, name) for more in data.also for name in more.names]
    test = [Job(shapes, name) for shapes in data.test_sets.values() for name in data.test_names(shapes)]
    return list({job.label: job for job in [*train, *test]}.values())


def shard_of(jobs: list[Job], shard: int, shards: int) -> list[Job]:
    """Return the part of all shapes that one of several jobs prepares: every `shards`-th, from number `shard` on.

    Raises
    ------
    ConfigError
        If there is no such part.

    Examples
    --------
    >>> [shard_of([0, 1, 2, 3], shard, 3) for shard in range(3)]  # type: ignore[list-item]
    [[0, 3], [1], [2]]
    """
    if shard >= shards:
        raise ConfigError(
            f"shard={shard}: the first of {counted(shards, 'part')} is 0 and the last {shards - 1}; all of them are "
            f"made by csm prepare -m shards={shards} 'shard=range({shards})'"
        )
    return jobs[shard::shards]


def fill_store(data: DataModule, jobs: list[Job], workers: int | None) -> Summary:
    """Prepare the shapes and print an account; DataError, before any work, if the store cannot be written."""
    root = data.store.root
    if why := data.store.why_not_writable():
        raise DataError(why)
    print(f"preparing {counted(len(jobs), 'shape')} into {root} ({_gigabytes(_existing(root))} GB free there)")
    summary = prepare(jobs, [data.recipe], data.store, workers=workers)
    print(
        f"{summary.made} made, {summary.present} already there, {len(summary.failures)} failed, "
        f"in {summary.seconds / 60:.1f} minutes"
    )
    return summary


def check_store(store: Store) -> dict[str, Any]:
    """Read the whole store and print what is in it; DataError if a file is faulty."""
    sound, faults = store.check()
    for kind in sorted({entry.kind for entry in sound}):
        entries = [entry for entry in sound if entry.kind == kind]
        print(f"{kind:<12} {len(entries):>6} entries  {sum(e.bytes for e in entries) / 1e6:>10.1f} MB")
    if faults:
        raise DataError(
            f"{len(faults)} faulty files in {store.root}; what is needed of them is computed again, and csm prepare "
            "action=prune deletes those that csm wrote:\n" + "\n".join(faults)
        )
    print(f"{store.root}: {counted(len(sound), 'entry')}, all sound")
    return {"entries": len(sound), "bytes": sum(entry.bytes for entry in sound)}


def prune_store(store: Store, unused_days: float | None) -> dict[str, Any]:
    """Delete faulty and, if asked, long unused entries, and print them."""
    gone = store.prune(unused_days=unused_days)
    for path in gone:
        print(f"deleted {path}")
    print(f"{store.root}: {counted(len(gone), 'file')} deleted")
    return {"deleted": len(gone)}


def _days(value: Any) -> float | None:
    if value is None or (isinstance(value, (int, float)) and not isinstance(value, bool) and 0 <= value < float("inf")):
        return value
    raise ConfigError(f"unused_days={value}: wanted a number of days from 0, or null to keep sound entries of any age")


def _existing(folder: Any) -> Any:
    return next(path for path in (folder, *folder.parents) if path.exists())


def _gigabytes(folder: Any) -> int:
    return int(shutil.disk_usage(folder).free // 10**9)


main = command("prepare")(run)
