"""Calibrations of a recorded run: the parameters that took the place of CONFIG's, and before which cycle."""

from brakelab.replay.engine import Change, Ecu
from ecu.contract.params import PARAMS
from ecu.contract.records import RecordArray
from ecu.recording.calibration import KEPT
from ecu.recording.recorder import Recording
from ecu.settings.config import config_of, new_params


def changes_of(recording: Recording, ecu: Ecu) -> tuple[list[Change], str]:
    """Return the parameters that were taken over, and a line for the user where they are left out, or empty.

    They are left out where `ecu` has other parameters than the recorded run began with: it repeats nothing.

    Raises:
        UserError: the recorded configuration is none of this version.
    """
    if not recording.calibrations:
        return [], ""
    given, where = recording.about["configuration"], str(recording.folder)
    recorded = _as_run(new_params(config_of(given, where)), ecu)
    if any(recorded[name].tobytes() != ecu.params[name].tobytes() for name in PARAMS.names or ()):
        count = len(recording.calibrations)
        return [], f"{where}: {count} calibrations left out, for CONFIG is not the recorded one"
    changes = []
    for note in recording.calibrations:
        params = new_params(config_of({**given, **note.tables}, where))
        changes.append(Change(note.cycle, _as_run(params, ecu)))
    return changes, ""


def _as_run(params: RecordArray, ecu: Ecu) -> RecordArray:
    for name in KEPT:
        params[name] = ecu.params[name]
    return params
