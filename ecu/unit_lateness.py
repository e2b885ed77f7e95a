"""Line on pressures that followed their demands later, or sooner, than CONFIG says."""

from typing import Any, Final

from ecu.algorithm.hydraulics import ALLOWED

VERBS: Final = ("rise", "fall")


def lateness_line(params: Any, outputs: Any) -> str:
    """Return the line on a run that braked, or empty; one `PARAMS`, and its last `OUTPUTS`."""
    found = []
    for place, verb in enumerate(VERBS):
        expected = float(params["dead_time"][place] + params["pressure_lag"][place])
        shown = float(outputs[f"pressure_lateness_{verb}"])
        if abs(shown - expected) > ALLOWED:
            found.append(f"{verb} {1e3 * shown:.0f} ms after their demands (CONFIG: {1e3 * expected:.0f} ms)")
    return f"pressures {' and '.join(found)}: correct dead times and lags of [hydraulics]" if found else ""
