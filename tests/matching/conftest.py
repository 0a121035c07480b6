"""Fixtures of the tests of matching."""

from __future__ import annotations

import pytest

from csm.data.store import Store


@pytest.fixture(scope="session")
def store(tmp_path_factory: pytest.TempPathFactory) -> Store:
    """A store of its own, so that nothing in the user's is used or changed."""
    return Store(tmp_path_factory.mktemp("store"))
