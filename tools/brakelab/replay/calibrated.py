"""Changes in a recorded run: parameters that took the place of CONFIG's, work on the learned values."""

from brakelab.replay.engine import Change, Ecu
from ecu.contract.params import PARAMS
from ecu.contract.records import RecordArray
from ecu.recording.calibration import KEPT
from ecu.recording.recorder import Recording
from ecu.settings.config import config_of, new_params


def changes_of(recording: Recording, ecu: Ecu) -> tuple[list[Change], str]:
    """Return what was taken over and done, and a line for the user where parameters are left out, or empty.

    They are left out where `ecu` has other parameters than the recorded run began with: it repeats nothing.
    New pads are new all the same.

    Raises:
        UserError: the recorded configuration is none of this version.
    """
    if not recording.calibrations:
        return [], ""
    given, where = recording.about["configuration"], str(recording.folder)
    recorded = _as_run(new_params(config_of(given, where)), ecu)
    if any(recorded[name].tobytes() != ecu.params[name].tobytes() for name in PARAMS.names or ()):
        works = [Change(note.cycle, ecu.params, note.work) for note in recording.calibrations if note.work]
        count = len(recording.calibrations) - len(works)
        line = f"{where}: {count} calibrations left out, for CONFIG is not the recorded one"
        return works, line if count else ""
    changes = []
    for note in recording.calibrations:
        params = new_params(config_of({**given, **note.tables}, where))
        changes.append(Change(note.cycle, _as_run(params, ecu), note.work))
    return changes, ""


def _as_run(params: RecordArray, ecu: Ecu) -> RecordArray:
    for name in KEPT:
        params[name] = ecu.params[name]
    return params
