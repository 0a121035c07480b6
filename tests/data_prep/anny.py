"""The mark of tests that need the body model."""

from __future__ import annotations

import importlib.util

import pytest

needs_anny = pytest.mark.skipif(
    importlib.util.find_spec("anny") is None, reason='anny is not installed: pip install "csm-correspondence[prep]"'
)
