from __future__ import annotations

import errno
import os
from importlib.util import find_spec

import pytest
from hydra import compose, initialize_config_dir
from hydra.core.global_hydra import GlobalHydra
from hydra.errors import InstantiationException
from hydra.utils import instantiate

from csm.commands.choices import config_folder
from csm.commands.explain import explained, known_keys
from csm.commands.groups import register
from csm.errors import ConfigError, MeshError

register("data", "descriptor", "model")

LAUNCHERS = {"joblib": "joblib", "ray": "ray", "submitit_local": "submitit", "submitit_slurm": "submitit"}
MISSING = [name for name, library in LAUNCHERS.items() if find_spec(library) is None]


@pytest.mark.parametrize(
    ("override", "said"),
    [
        ("optimizer.lrr=1", "there is no option 'optimizer.lrr'; did you mean optimizer.lr"),
        ("optimizr.lr=1", "there is no option 'optimizr.lr'; did you mean optimizer.lr"),
        ("optimizer.loss_rows=3", "optimizer.loss_rows is now learning.loss_rows"),
        ("descriptor=adc", "descriptor=adc: there is no such option; did you mean"),
        ("experiment=human", "did you mean humans"),
        ("descriptor=null", "a group takes the name of one of its options"),
        *((f"hydra/launcher={name}", 'pip install "csm-correspondence[sweep]"') for name in MISSING),
        *[("hydra/launcher=ray_cluster", "hydra/launcher=ray needs an extra")] * ("ray" in MISSING),
        *[("hydra/sweeper=optuna", 'pip install "csm-correspondence[sweep]"')] * (find_spec("optuna") is None),
        ("~foo", "~foo: there is no such key to leave out"),
        ("seed==1", "'seed==1' is not of the form key=value"),
        ("seed=[1", "not of the form key=value"),
    ],
)
def test_what_hydra_refuses_is_one_paragraph(override, said):
    GlobalHydra.instance().clear()
    with initialize_config_dir(str(config_folder()), version_base="1.3"), pytest.raises(Exception) as refused:  # noqa: PT011
        compose("train", [override])
    text = explained(refused.value, "train")
    assert text is not None
    assert said in text
    assert "\n" not in text


def test_errors_of_csm_are_found_in_the_chain():
    outer = RuntimeError("outer")
    outer.__cause__ = MeshError("a.off: the file is empty")
    assert explained(outer, "match") == "a.off: the file is empty"


@pytest.mark.parametrize(
    ("number", "said"),
    [
        (errno.ENOSPC, "out/x.ply: the disk is full"),
        (errno.EACCES, "permission denied"),
        (errno.EROFS, "read-only"),
        (errno.ENAMETOOLONG, "too long"),
        (errno.ENOTDIR, "a file stands where a folder is wanted"),
        (errno.EIO, os.strerror(errno.EIO)),
    ],
)
def test_the_operating_system_is_put_into_words(number, said):
    text = explained(OSError(number, os.strerror(number), "out/x.ply"), "match")
    assert text is not None
    assert said in text
    assert "out/x.ply" in text


def test_missing_extras_and_memory_are_named():
    assert "csm-correspondence[viz]" in str(explained(ModuleNotFoundError("No module", name="polyscope"), "match"))
    assert "not enough memory" in str(explained(MemoryError("8 GiB"), "match"))
    assert "no graphics card" in str(explained(RuntimeError("Found no NVIDIA driver on your system"), "match"))


def test_errors_of_launchers_say_what_to_do():
    slurm = RuntimeError('Could not detect "srun", are you indeed on a slurm cluster?')
    assert "submitit_local, joblib or ray" in str(explained(slurm, "train"))
    slow = Exception("The current node timed out during startup. This could happen because some of the raylet failed")
    assert "RAY_raylet_start_wait_time_s" in str(explained(slow, "train"))
    killed = type("TerminatedWorkerError", (Exception,), {})()
    assert "the same folder (hydra.sweep.dir) goes on" in str(explained(killed, "train"))
    parted = RuntimeError("[gloo/transport/tcp/pair.cc:534] Connection closed by peer [127.0.0.1]:5")
    assert "another process that trains together with this one has ended" in str(explained(parted, "train"))


@pytest.mark.parametrize("error", [KeyError("x"), ValueError("odd"), ZeroDivisionError(), ModuleNotFoundError("x")])
def test_a_defect_is_not_explained_away(error):
    assert explained(error, "match") is None


def test_keys_of_a_command_are_listed_with_dots():
    keys = known_keys("match")
    assert {"source", "descriptor.alpha", "overwrite"} <= set(keys)
    assert known_keys("no_such_command") == []


def test_a_config_error_is_itself():
    assert explained(ConfigError("seed=-1"), "train") == "seed=-1"


@pytest.mark.parametrize(
    ("overrides", "said"),
    [
        (["descriptor.damping=-1"], "descriptor.damping=-1: wanted 0 or more"),
        (["descriptor.cuts=200"], "descriptor.cuts=200: wanted fewer than k=11, so that the last cut has 2 eigenpairs"),
        (["descriptor.k=4"], "descriptor.k=4: wanted more than cuts=4, so that the last cut has 2 eigenpairs"),
        (["descriptor=awft", "descriptor.taus=[0]"], "descriptor.taus=[0]: wanted one number or more, all above 0"),
        (["descriptor=acd_two_bands", "descriptor.parts.low.order=-2"], "descriptor.parts.low.order=-2: wanted 0 or"),
        (["descriptor=hks", "descriptor.last=3"], "descriptor.last=3: wanted two times with 0 < first < last"),
    ],
)
def test_a_parameter_out_of_range_is_named_as_it_was_typed(overrides, said):
    GlobalHydra.instance().clear()
    with initialize_config_dir(str(config_folder()), version_base="1.3"):
        cfg = compose("describe", overrides)
    with pytest.raises(InstantiationException) as caught:
        instantiate(cfg.descriptor)
    text = explained(caught.value, "describe")
    assert text.startswith(said)
    assert "ACD(" not in text
