"""Files for those who install, build and report: they parse, and agree with pyproject.toml and with each other."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path
from typing import Any

import pytest
import yaml
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet

import csm
from csm._extras import DISTRIBUTION
from csm.commands.explain import _EXTRAS
from tests.conftest import ROOT

try:
    import tomllib
except ModuleNotFoundError:  # Python 3.10; pytest brings the same library there
    import tomli as tomllib

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
PYTHONS = [f"3.{minor}" for minor in range(30) if f"3.{minor}" in SpecifierSet(PROJECT["requires-python"])]
WORKFLOW = yaml.safe_load((ROOT / ".github/workflows/ci.yml").read_text(encoding="utf-8"))
ON_CONDA = {"torch": "pytorch", "matplotlib": "matplotlib-base", "qdldl": "qdldl-python"}
"""Name on the package index -> name on conda-forge, where they differ."""


def recipe() -> dict[str, Any]:
    """Return the recipe for conda with its variables filled in."""
    text = (ROOT / "packaging/conda/meta.yaml").read_text(encoding="utf-8")
    values = dict(re.findall(r'^{% set (\w+) = "(.+)" %}$', text, re.MULTILINE))
    text = re.sub(r"^{%.*%}$", "", text, flags=re.MULTILINE)
    return yaml.safe_load(re.sub(r"{{ (\w+) }}", lambda found: values.get(found[1], found[1]), text))


def pinned(requirements: list[str]) -> dict[str, SpecifierSet]:
    return {found.name: found.specifier for found in map(Requirement, requirements)}


def commands(job: str) -> str:
    return "\n".join(step.get("run", "") for step in WORKFLOW["jobs"][job]["steps"])


@pytest.mark.parametrize("path", sorted((ROOT / ".github/ISSUE_TEMPLATE").glob("*.yml")), ids=lambda path: path.name)
def test_a_template_asks_for_something_under_names_of_its_own(path):
    form = yaml.safe_load(path.read_text(encoding="utf-8"))
    if path.name == "config.yml":
        assert form["blank_issues_enabled"] is True
        return
    assert {"name", "description", "body"} <= form.keys()
    names = [field["id"] for field in form["body"]]
    assert len(names) == len(set(names)) > 0
    assert all(field["attributes"]["label"] for field in form["body"])


def test_a_report_of_a_fault_holds_what_csm_says_of_machine_and_mesh():
    form = yaml.safe_load((ROOT / ".github/ISSUE_TEMPLATE/bug.yml").read_text(encoding="utf-8"))
    required = [field["attributes"]["label"] for field in form["body"] if field.get("validations", {}).get("required")]
    assert any("csm doctor" in label for label in required)
    assert any("csm check" in label for label in required)


def test_the_version_is_the_same_everywhere():
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert str(citation["version"]) == recipe()["package"]["version"] == csm.__version__


def test_every_python_that_is_promised_is_tested_on_three_systems():
    classified = [name.rpartition(" ")[2] for name in PROJECT["classifiers"] if "Python :: 3." in name]
    matrix = WORKFLOW["jobs"]["test"]["strategy"]["matrix"]
    assert matrix["python"] == classified == PYTHONS
    assert [name.partition("-")[0] for name in matrix["os"]] == ["ubuntu", "macos", "windows"]


def test_what_takes_long_is_left_out_by_the_workflow():
    assert '-m "not slow and not long"' in commands("test")  # -m replaces the one of pyproject.toml


def test_only_a_release_that_passed_everything_may_upload():
    jobs = WORKFLOW["jobs"]
    assert set(jobs["release"]["needs"]) == jobs.keys() - {"release"}
    assert jobs["release"]["if"] == "startsWith(github.ref, 'refs/tags/v')"
    assert [name for name, job in jobs.items() if "permissions" in job] == ["release"]
    assert WORKFLOW["permissions"] == {"contents": "read"}
    assert f"dist/{DISTRIBUTION.replace('-', '_')}-${{GITHUB_REF_NAME#v}}-py3-none-any.whl" in commands("release")
    assert "twine check --strict" in commands("dist")


def test_the_recipe_asks_for_what_the_project_asks_for():
    found, (python, *run) = recipe(), recipe()["requirements"]["run"]
    assert found["package"]["name"] == PROJECT["name"] == DISTRIBUTION
    wanted = {ON_CONDA.get(name, name): bound for name, bound in pinned(PROJECT["dependencies"]).items()}
    assert pinned(run) == wanted
    assert pinned([python]) == {"python": SpecifierSet(PROJECT["requires-python"])}
    build = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["build-system"]["requires"]
    assert pinned(build).items() <= pinned([one for one in found["requirements"]["host"] if ">=" in one]).items()
    assert found["build"]["entry_points"] == [f"{name} = {place}" for name, place in PROJECT["scripts"].items()]


def test_every_extra_that_is_named_exists_and_none_goes_by_the_name_of_the_other_program():
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=False)
    if listed.returncode:
        pytest.skip("not a checkout")
    kinds = {".py", ".md", ".yaml", ".yml", ".toml", ".ipynb", ".txt", ""}
    paths = [Path(name) for name in listed.stdout.split("\0") if name and name != "CHANGELOG.md"]
    texts = {p: (ROOT / p).read_text("utf-8", "replace") for p in paths if p.suffix in kinds and (ROOT / p).is_file()}
    extras = PROJECT["optional-dependencies"].keys()
    named = {(p, name) for p, text in texts.items() for name in re.findall(rf"{DISTRIBUTION}\[(\w+)\]", text)}
    assert {name for _, name in named} >= {"prep", "sweep", "peers"}
    assert [(str(p), name) for p, name in named if name not in extras and p.parts[0] != "tests"] == []
    assert [str(p) for p, text in texts.items() if re.search(r"""pip install ["']?csm(\[\w|["'`\s]|$)""", text)] == []
    assert set(_EXTRAS.values()) <= extras


def test_the_container_is_made_of_what_docker_is_given_and_runs_without_root():
    lines = (ROOT / "packaging/Dockerfile").read_text(encoding="utf-8").splitlines()
    given = {line[1:] for line in (ROOT / ".dockerignore").read_text().splitlines() if line.startswith("!")}
    copied = {name for line in lines if line.startswith("COPY ") for name in line.split()[1:-1]}
    assert copied == given
    assert all((ROOT / name).exists() for name in copied)
    users = [line.split()[1] for line in lines if line.startswith("USER ")]
    assert users[-1] not in ("root", "0")
    assert 'ENTRYPOINT ["csm"]' in lines
    assert lines.index("ARG BASE=python:3.12-slim") < lines.index("FROM ${BASE}")
