"""pytest plug-in: ECU and simulated car as fixtures, in virtual and in real time (docs/testing.md)."""
