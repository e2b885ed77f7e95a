"""What `ecu/build.py` is made of: which kernels Python calls, and their machine code."""
