"""``csm evaluate checkpoint=...``: test a trained network on the test sets of any data module."""

from __future__ import annotations

from csm.commands.main import run_as_program

if __name__ == "__main__":
    run_as_program(__file__)

from typing import Any

from omegaconf import DictConfig

from csm._counts import counted
from csm.commands.app import command, output_folder
from csm.commands.groups import make_data, make_protocol, matching_of, register
from csm.commands.outputs import require_results
from csm.errors import ConfigError

register("data")


def run(cfg: DictConfig) -> dict[str, Any]:
    """Test the checkpoint; descriptor and basis are those it was trained with."""
    from csm.commands.tested import conclude
    from csm.data.inspection import require_sound
    from csm.experiments.testing import measure_all, numbers, require_same_test
    from csm.matching.methods import require_classifier
    from csm.matching.network import load_model
    from csm.matching.registry import matchers

    if cfg.checkpoint is None:
        raise ConfigError(
            "evaluate needs checkpoint=PATH, a .ckpt that csm train wrote, or checkpoint=humans, which csm brings"
        )
    method = load_model(cfg.checkpoint)
    data, protocol, matching = make_data(cfg, method.recipe), make_protocol(cfg), matching_of(cfg)
    if not data.test_sets:
        raise ConfigError("data.test=[]: wanted a set to test on at least")
    require_classifier([method], matchers(matching))
    require_results(cfg.results)
    require_same_test(output_folder(), data, protocol, matching, method)
    require_sound(data, exact=protocol.distance == "exact" and not protocol.fallback, train=False)
    print(
        f"{cfg.checkpoint}: testing on {counted(len(data.split.test), 'shape')} of {', '.join(data.test_sets)}",
        flush=True,
    )
    tested = measure_all(method, data, protocol, matching=matching, table=cfg.table, device=cfg.device)
    trained, split = method.training.get("protocol", "how it was trained is not known"), data.split.label
    if data.split.checksum not in trained:  # the same lists may have another name
        print(
            f"note: tested on the test shapes of split {split}, which is not the split of the training; see data.split"
        )
    conclude(cfg, tested, f"{cfg.checkpoint}: {trained}. Tested on the test shapes of split {split}.")
    return numbers(tested)


main = command("evaluate", folder=True)(run)
