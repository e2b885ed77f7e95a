"""Optional modules that a library is not to load."""

import importlib
import os
import sys

import pytest

from ecu.imports import without_modules


def test_what_is_kept_out_is_not_found_and_comes_back_afterwards(monkeypatch, tmp_path):
    (tmp_path / "library_of_nobody.py").write_text("", "utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    with without_modules("library_of_nobody", "os"), pytest.raises(ImportError):
        importlib.import_module("library_of_nobody")
    assert importlib.import_module("library_of_nobody")
    assert sys.modules["os"] is os  # was loaded before
    with without_modules("library_of_nobody"):
        assert importlib.import_module("library_of_nobody")
