"""Commit and configuration behind a page of results."""

import subprocess
from typing import Final

from ecu.settings.config import config_hash, load_config
from ecu.settings.resources import resource

CONFIGURATION: Final = "config/suv.toml"
CODE: Final = ("ecu", "tools/brakelab", "config", "dbc")
"""Paths whose uncommitted changes make a measurement `-dirty`."""


def measured_on() -> str:
    """Return the line of a page that `tools/stale_pages.py` reads.

    "Measured on commit 1a2b3c4, config/suv.toml 0123456789ab.", the commit with `-dirty` after a change of
    code, `unknown` outside a checkout.
    """
    name = resource(CONFIGURATION)
    commit = _git("rev-parse", "--short=7", "HEAD") or "unknown"
    if commit != "unknown" and _git("status", "--porcelain", "--", *CODE):
        commit += "-dirty"
    return f"Measured on commit {commit}, {CONFIGURATION} {config_hash(load_config(name))[:12]}."


def _git(*words: str) -> str:
    """Return the output of a git command in the checkout, "" where it fails."""
    try:
        done = subprocess.run(
            ["git", *words], cwd=resource("."), capture_output=True, text=True, check=True, timeout=20.0
        )
    except (OSError, subprocess.SubprocessError):
        return ""
    return done.stdout.strip()
