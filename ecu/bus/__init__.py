"""Bus access: the only package of `ecu` that uses python-can, whose import is prepared here.

Where asammdf is installed, python-can loads it for log files that the bus never sees: `import can` then takes
0.9 s of processor time instead of 0.17 s. It is hidden from python-can alone; the laboratory may import it.
"""

from ecu.imports import without_modules

with without_modules("asammdf"):
    import can  # noqa: F401
