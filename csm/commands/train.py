"""``csm train``: train a network on one set, then test it on every test set of its data module."""

from __future__ import annotations

from typing import Any

from hydra.utils import instantiate
from omegaconf import DictConfig

from csm.commands.app import command, output_folder
from csm.commands.groups import make_data, make_protocol, plain, register
from csm.evaluation.tables import markdown_table
from csm.experiments.report import write_results
from csm.experiments.testing import Tested, measure_all, numbers
from csm.experiments.training import Training, fit
from csm.matching.network import NetworkMethod

register("data", "descriptor", "model")

GROUPS = ("seed", "data", "descriptor", "model", "optimizer", "learning", "trainer")
"""What TensorBoard compares runs by."""


def run(cfg: DictConfig) -> dict[str, Any]:
    """Train and, unless ``test=false``, test; return the numbers of the job."""
    folder = output_folder()
    training = make_training(cfg)
    trained = fit(training, folder, cfg.resume)
    print(f"trained for {trained.seconds / 60:.1f} minutes: {trained.checkpoint}")
    found = {"seconds": trained.seconds, "checkpoint": str(trained.checkpoint), **trained.measured}
    if not cfg.test:
        return found
    method = NetworkMethod(trained.module)
    tested = measure_all(
        method, training.data, make_protocol(cfg), matching=plain(cfg.matching), table=cfg.table, device=cfg.device
    )
    conclude(cfg, tested, f"{cfg.name}: {method.training['protocol']}.")
    if training.logger is not None:
        print(f"log:          {folder}  (tensorboard --logdir {folder})")
    return found | numbers(tested)


def make_training(cfg: DictConfig) -> Training:
    """Make the training of a configuration; a group that was left out (``~logger``, ``callbacks=null``) is empty."""
    logger, callbacks = cfg.get("logger"), cfg.get("callbacks") or {}
    settings = plain(cfg)
    return Training(
        name=str(cfg.name),
        data=make_data(cfg),
        network=plain(cfg.model),
        options={**plain(cfg.optimizer), **plain(cfg.learning)},
        trainer=instantiate(cfg.trainer, _partial_=True),
        seed=int(cfg.seed),
        callbacks=[instantiate(callback) for callback in callbacks.values() if callback],
        logger=instantiate(logger, _partial_=True) if logger else None,
        settings={name: settings[name] for name in GROUPS},
    )


def conclude(cfg: DictConfig, tested: list[Tested], notes: str) -> None:
    """Keep the results of a test in the folder of the job, and print the table and where things are."""
    folder = output_folder()
    page = write_results(tested, folder, cfg.results, notes)
    print(markdown_table([t.row for t in tested]))
    print(f"table:        {folder / 'rows.json'}, rows.csv\nreport:       {page}")


main = command("train")(run)

if __name__ == "__main__":
    main()
