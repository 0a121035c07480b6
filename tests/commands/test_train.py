"""What a test wants is checked before the training, not after it."""

from __future__ import annotations

import pytest

from tests.commands.test_pipeline import SMALL, Bench

TOYS = [*SMALL, "data.root=toys"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([*TOYS, "matching=[nope]"], "matching='nope'"),
        ([*TOYS, "device=meta"], "device=meta"),
        ([*TOYS, "metric.distance=nope"], "metric.distance=nope"),
        (["recipe=acscnn", "experiment=humans_paper"], "experiment=humans_paper chooses csmcnn"),
    ],
)
def test_an_error_comes_before_the_training(tmp_path, monkeypatch, capsys, arguments, message):
    bench = Bench(tmp_path, monkeypatch)
    with pytest.raises(SystemExit) as stopped:
        bench.run("train", *arguments, "hydra.run.dir=run")
    assert stopped.value.code == 2
    assert message in capsys.readouterr().err
    assert not (tmp_path / "run/model.ckpt").exists()
