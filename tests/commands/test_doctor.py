from __future__ import annotations

from importlib import metadata

import pytest

from csm.commands import doctor
from csm.commands.doctor import extras, missing_of, store_in_words
from csm.data.store import Store
from tests.shapes import blob


def test_what_is_found_is_printed_row_by_row(csm, tmp_path):
    status, out, _ = csm("doctor", f"folder={tmp_path}")
    assert status == 0
    rows = dict(line.split("  ", 1) for line in out.splitlines() if "  " in line)
    assert {"machine", "versions", "BLAS", "devices", "store", "networks", "data sets"} <= rows.keys()
    assert "csm 0." in rows["versions"]
    assert rows["devices"].strip().startswith("cpu")
    assert str(tmp_path / ".store") in rows["store"]
    assert "none found: set CSM_DATA" in rows["data sets"]


@pytest.mark.data
def test_data_sets_are_named_with_their_places(csm, data_set):
    folder = data_set("SCAPE_5000")
    assert f"SCAPE_5000 ({folder})" in csm("doctor", f"folder={folder.parent}")[1]


def test_extras_are_told_from_requirements_and_from_other_markers():
    found = missing_of(
        [
            "numpy>=1",
            "numpy>=1; extra == 'there'",
            'nothing-of-this-name>=2; extra == "gone"',
            "numpy>=900; extra == 'gone'",
            "nothing-of-this-name; python_version < '3' and extra == 'old'",
        ]
    )
    assert found == {"there": [], "gone": ["nothing-of-this-name>=2", "numpy>=900"]}
    words = extras(found)
    assert words["there"].endswith("installed")
    assert (
        'not installed (nothing-of-this-name>=2, numpy>=900): pip install "csm-correspondence[gone]"' in words["gone"]
    )


def test_a_source_tree_that_is_not_installed_is_told_so(csm, tmp_path, monkeypatch):
    def not_installed(name):
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr(doctor.metadata, "requires", not_installed)
    status, out, _ = csm("doctor", f"folder={tmp_path}")
    assert status == 0
    assert "runs from a source tree in which csm-correspondence is not installed" in out
    assert "extra dev" not in out


def test_extras_are_those_of_the_distribution_on_the_package_index(csm, tmp_path, monkeypatch):
    wanted = {"csm-correspondence": ["nothing-of-this-name; extra == 'odd'"]}
    monkeypatch.setattr(doctor.metadata, "requires", wanted.__getitem__)
    out = csm("doctor", f"folder={tmp_path}")[1]
    assert 'not installed (nothing-of-this-name): pip install "csm-correspondence[odd]"' in out


def test_the_store_is_counted(tmp_path):
    store = Store(tmp_path / "s")
    assert store_in_words(store).startswith(f"{tmp_path / 's'}: 0 entries, 0 MiB")
    store.fetch("lbo", blob(1), {"k": 1}, lambda: {"a": blob(1).vertices})
    assert ": 1 entry, " in store_in_words(store)
