"""The laboratory's commands of `brake-ecu`, a file for each group."""

from brakelab.cli.main import app

__all__ = ["app"]
