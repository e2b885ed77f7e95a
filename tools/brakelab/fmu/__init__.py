"""ECU and simulated vehicle as FMUs (FMI 3.0, co-simulation): the compiled kernels in C, without Python."""
