"""Brake ECU: the onboard software alone."""

__version__ = "0.1.0"
