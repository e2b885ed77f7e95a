"""Fleet replay: thousands of recorded drives through the code of the ECU, locally or on a Dask cluster."""
