"""Brake ECU: what runs in the vehicle, and nothing else."""

__version__ = "0.1.0"
