"""The wheel alone: built, installed into an environment outside the checkout, and used from an empty folder."""

from __future__ import annotations

import email
import importlib.util
import json
import os
import re
import subprocess
import sys
import sysconfig
import tarfile
import venv
import zipfile
from pathlib import Path

import numpy as np
import pytest

import csm
from csm.mesh.io import write_mesh
from tests.shapes import blob

ROOT = Path(__file__).resolve().parent.parent
SHORT = [
    "data.test=[original]",
    "data.basis_k=16",
    "descriptor.angles=2",
    "model.ks=16",
    "trainer.max_epochs=1",
    "trainer.accelerator=cpu",
    "metric.distance=edge",
    "metric.sample=1",
    "metric.points=10",
    "callbacks=none",
    "logger=none",
    "workers=0",
]

pytestmark = pytest.mark.slow


def run(*words: object, cwd: Path, **variables: str) -> str:
    """Run a program without anything of the checkout in its environment; return what it prints."""
    inherited = {k: v for k, v in os.environ.items() if not k.startswith(("PYTHON", "CSM_", "PYTEST", "VIRTUAL_ENV"))}
    ended = subprocess.run(list(map(str, words)), cwd=cwd, env=inherited | variables, capture_output=True, text=True)
    assert ended.returncode == 0, f"{ended.stdout}\n{ended.stderr}"
    return ended.stdout


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder with the wheel and the source archive."""
    folder = tmp_path_factory.mktemp("dist")
    run(sys.executable, "-m", "build", "--wheel", "--sdist", "--no-isolation", "--outdir", folder, ROOT, cwd=folder)
    return folder


@pytest.fixture(scope="module")
def wheel(built: Path) -> Path:
    return built / f"csm_correspondence-{csm.__version__}-py3-none-any.whl"


class Installed:
    """The wheel in an environment of its own, which borrows the dependencies of this one but not its csm."""

    def __init__(self, folder: Path, wheel: Path) -> None:
        self.environment, self.folder = folder / "env", folder / "empty"
        self.folder.mkdir()
        venv.create(self.environment, with_pip=False)
        paths = sysconfig.get_paths(vars={"base": str(self.environment), "platbase": str(self.environment)})
        self.programs, self.library = Path(paths["scripts"]), Path(paths["purelib"])
        python = self.programs / Path(sys.executable).name
        run(sys.executable, "-m", "pip", "--python", python, "install", "--no-deps", "--no-index", wheel, cwd=folder)
        # Paths named in a .pth file come last and their own .pth files are not read, so the checkout stays out.
        (self.library / "borrowed.pth").write_text(sysconfig.get_paths()["purelib"] + "\n")

    def csm(self, *words: object) -> str:
        return run(self.programs / "csm", *words, cwd=self.folder, CSM_CACHE=str(self.folder / "store"))

    def python(self, code: str) -> str:
        return run(self.programs / Path(sys.executable).name, "-c", code, cwd=self.folder).strip()


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory, wheel: Path) -> Installed:
    return Installed(tmp_path_factory.mktemp("alone"), wheel)


def test_the_wheel_carries_configurations_assets_and_the_type_marker(wheel):
    inside = set(zipfile.ZipFile(wheel).namelist())
    for folder, kinds in (
        ("conf", ("*.yaml",)),
        ("csm", ("*.py", "*.html", "*.css", "*.js", "*.npz", "*.md", "py.typed")),
    ):
        for path in (p for kind in kinds for p in (ROOT / folder).rglob(kind)):
            inner = path.relative_to(ROOT) if folder == "csm" else Path("csm") / path.relative_to(ROOT)
            assert inner.as_posix() in inside
    assert not [
        name for name in inside if name.split("/")[0] not in ("csm", wheel.stem.rsplit("-", 3)[0] + ".dist-info")
    ]


def test_the_wheel_has_the_name_on_the_package_index_and_the_command_csm(wheel):
    with zipfile.ZipFile(wheel) as archive:
        info = f"csm_correspondence-{csm.__version__}.dist-info"
        metadata = email.message_from_bytes(archive.read(f"{info}/METADATA"))
        assert metadata["Name"] == "csm-correspondence"
        assert metadata["Version"] == csm.__version__
        assert {"prep", "sweep", "viz", "dev"} <= set(metadata.get_all("Provides-Extra"))
        assert "csm = csm.commands.main:main" in archive.read(f"{info}/entry_points.txt").decode()
        assert f"{info}/licenses/LICENSE" in archive.namelist()


def test_the_source_archive_has_what_tests_and_pages_need(built):
    top = f"csm_correspondence-{csm.__version__}"
    with tarfile.open(built / f"{top}.tar.gz") as archive:
        inside = {name.removeprefix(f"{top}/") for name in archive.getnames()}
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    linked = set(re.findall(r"\]\((?!https?:|#)([^)#]+)\)", readme))
    needed = {"pyproject.toml", "constraints.txt", "mkdocs.yml", "Makefile", ".github/workflows/ci.yml", "SECURITY.md"}
    assert (needed | {link for link in linked if (ROOT / link).is_file()}) - inside == set()
    for folder in ("csm", "conf", "tests", "packaging", "results"):
        found = {p.relative_to(ROOT).as_posix() for p in (ROOT / folder).rglob("*.[pjymc]*") if p.is_file()}
        assert {name for name in found - inside if not name.endswith(".pyc")} == set()
    assert not [name for name in inside if "__pycache__" in name or name.startswith(("outputs", "build", ".venv"))]


@pytest.mark.skipif(importlib.util.find_spec("twine") is None, reason="twine is not installed: pip install twine")
def test_the_package_index_would_take_both(built):
    run(sys.executable, "-m", "twine", "check", "--strict", *built.iterdir(), cwd=built)


def test_the_installed_csm_is_not_the_checkout(installed):
    where = "import csm, csm.commands.app as app; print(csm.__file__); print(app.config_folder())"
    package, configuration = map(Path, installed.python(where).splitlines())
    assert installed.library in package.parents
    assert installed.library in configuration.parents
    assert str(ROOT / "csm") not in installed.python("import sys; print(sys.path)")


def test_help(installed):
    assert "csm train experiment=demo" in installed.csm("--help")


def test_the_demo_trains_and_tests_on_the_humans_that_travel_inside(installed):
    split = {"name": "short", "train": ["s00_p00"], "test": ["s08_p01", "s09_p01"]}
    (installed.folder / "short.json").write_text(json.dumps(split))
    installed.csm("train", "experiment=demo", "data.split=short.json", "hydra.run.dir=run", *SHORT)
    (row,) = json.loads((installed.folder / "run" / "rows.json").read_text())
    assert 0 < row["age"] < 1
    assert row["commit"] == f"csm {csm.__version__}", "the wheel must not ask the checkout for its commit"
    assert (installed.folder / "run" / "model.ckpt").is_file()


def test_two_meshes_are_matched(installed):
    for name, seed in (("a.off", 1), ("b.ply", 2)):
        write_mesh(installed.folder / name, blob(2, seed))
    installed.csm("match", "source=a.off", "target=b.ply", "out=found")
    indices = np.loadtxt(installed.folder / "found" / "map.txt", dtype=int)
    assert indices.shape == (162,)
    assert indices.min() >= 0
    assert indices.max() < 162
