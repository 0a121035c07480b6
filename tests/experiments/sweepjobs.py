"""Folders of sweeps for tests."""

from __future__ import annotations

import json
from itertools import product
from pathlib import Path

from torch.utils.tensorboard import SummaryWriter


def write_job(folder: Path, name: str, overrides: list[str], **numbers: object) -> Path:
    place = folder / name
    place.mkdir(parents=True)
    record = {"status": "ok", "seconds": 3.0, "overrides": overrides, **numbers}
    (place / "result.json").write_text(json.dumps(record))
    return place


def write_sweep(folder: Path) -> None:
    """Write twelve jobs whose error is that of ks, plus a little of the rate; the seed does nothing."""
    for k, (ks, rate, seed) in enumerate(product((32, 64, 128), ("0.001", "0.003"), (0, 1))):
        error = 1 / ks + (0.001 if rate == "0.001" else 0.0)
        overrides = [
            "experiment=humans",
            "+trainer.limit_train_batches=2",
            f"model.ks={ks}",
            f"optimizer.lr={rate}",
            f"seed={seed}",
            "data.root='meshes/own'",
        ]
        place = write_job(folder, str(k), overrides, **{"age/a": error, "age/b": 3 * error, "train/loss": 9.0 - k})
        with SummaryWriter(place / "tensorboard") as log:
            for step in range(6):
                log.add_scalar("epoch", step // 2, step)
                log.add_scalar("train/loss", 6.0 - step - 0.1 * k, step)
    write_job(folder, "12", ["experiment=humans", "model.ks=256"], status="failed", error="no memory")
