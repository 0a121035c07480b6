from __future__ import annotations

import sys

import pytest
from hydra.core.global_hydra import GlobalHydra

from csm.commands import bench
from csm.commands.choices import BENCHES
from csm.commands.main import main
from csm.reproduction.registry import STUDIES


@pytest.fixture
def run(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)

    def call(*words: str) -> None:
        monkeypatch.setattr(sys, "argv", ["csm", "bench", *words])
        GlobalHydra.instance().clear()
        main()

    return call


def test_descriptors_are_table_2_with_its_options(run, monkeypatch):
    asked = []
    monkeypatch.setattr(bench, "make_studies", lambda cfg, names: asked.append((names, cfg.table2.sizes)) or {})
    run("descriptors", "table2.sizes=[500]", "hydra.run.dir=job")
    assert asked == [(["table2"], [500])]


def test_matching_is_the_benchmark_of_peers_with_its_options(run, monkeypatch):
    asked = []
    monkeypatch.setattr(bench, "make_studies", lambda cfg, names: asked.append((names, cfg.benchmark_peers)) or {})
    run("matching", "benchmark_peers.sample=2", "benchmark_peers.methods=[acd]", "hydra.run.dir=job")
    (((name,), options),) = asked
    assert (name, options.sample, options.methods, options.repeats) == ("benchmark_peers", 2, ["acd"], 1)


@pytest.mark.parametrize("words", [[], ["meshes"]])
def test_anything_else_is_refused_with_what_there_is(run, capsys, words):
    with pytest.raises(SystemExit) as stopped:
        run(*words, "hydra.run.dir=job")
    assert stopped.value.code == 2
    assert "there is descriptors" in capsys.readouterr().err


def test_a_bench_is_a_study():
    assert set(BENCHES.values()) <= set(STUDIES)
