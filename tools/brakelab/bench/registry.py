"""All that `brake-ecu bench` runs, by what it measures: the module whose `STUDY` it is."""

from typing import Final

TIMES: Final = ("step", "codec", "plant", "cycle")
"""Of one page, see `bench/times.py`."""
ENTRIES: Final = "entries"
STUDIES: Final = {
    "times": {"lateness": "bench.lateness", "replay": "bench.replay", "play": "bench.play"},
    "accuracy": {
        "stops": "studies.accuracy.stops",
        "observers": "bench.observers",
        ENTRIES: "studies.entries.command",
        "ablation": "studies.accuracy.ablation",
        "bound": "studies.accuracy.bound",
        "loggers": "studies.accuracy.loggers",
        "recorded": "studies.accuracy.recorded",
        "vehicle": "studies.accuracy.vehicle",
        "tuning": "studies.accuracy.tuning",
        "figures": "studies.accuracy.figures",
    },
    "control": {
        "compensation": "studies.control.compensation_study",
        "margins": "studies.control.margins",
        "blending": "studies.control.blending",
        "failures": "studies.control.failures",
        "lies": "studies.lies_table",
    },
    "physics": {
        "friction": "studies.physics.friction",
        "lab": "studies.lab.study",
        "energy": "studies.physics.energy",
        "wear": "studies.wear.wear",
        "dust": "studies.dust.dust",
        "thermal": "studies.thermal.thermal",
        "blocks": "studies.wear.blocks",
        "cycles": "studies.dust.cycles",
    },
}
MODULES: Final = {name: module for group in STUDIES.values() for name, module in group.items()}
NAMES: Final = {group: [*(TIMES if group == "times" else ()), *found] for group, found in STUDIES.items()}
"""Of benches."""
