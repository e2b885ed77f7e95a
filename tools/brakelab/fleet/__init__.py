"""Thousands of recorded drives through the code of the ECU, on this machine or a Dask cluster."""
