"""The last minutes as a recording, in the form of `run --record`.

One that does not begin with the run's first cycle says so (`first_cycle` in `recording.json`): the state
before it is not known, so `replay` takes its frames as it takes any log's.
"""

from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path

from ecu.errors import UserError
from ecu.output import argument
from ecu.recording.calibration import add_note, in_force
from ecu.recording.recorder import start_recording, write_batch
from ecu.recording.ring import Batch, RingReader
from ecu.watch.watcher import Watcher


def keep(batches: Sequence[Batch], reader: RingReader, folder: Path) -> Path:
    """Write `batches`, read by `reader`, as a recording into a new folder of `folder`; return it.

    Raises:
        UserError: nothing was watched yet, or the folder cannot be written.
    """
    if not batches:
        raise UserError(str(folder), "", "nothing to keep yet: no cycle was seen")
    batches = _since_known(batches, reader)
    first = batches[0].records["cycle"][0]
    about = {**reader.description, "first_cycle": int(first["number"])}
    calibration = in_force(reader.ring)
    if calibration is not None and (about["first_cycle"] or calibration.number > 1):
        about["configuration"] = {**about["configuration"], **calibration.tables}
        calibration = None
    if about["first_cycle"]:
        about["start_ns"] = int(first["t_ns"])
    files = start_recording(folder, about, reader.initial)
    try:
        if calibration is not None:
            add_note(files.folder, calibration)
        for batch in batches:
            write_batch(files, batch, str(about["channel"]))
    except OSError as error:
        raise UserError(str(files.folder), "", f"not kept whole: {error.strerror}; free the disk") from None
    finally:
        files.frames.close()
        files.cycles.close()
    return files.folder


def _since_known(batches: Sequence[Batch], reader: RingReader) -> Sequence[Batch]:
    """Leave out what was before the last calibration, if others were before: their values are gone."""
    found = in_force(reader.ring)
    if found is None or found.number == 1:
        return batches
    return [one for one in batches if one.records["cycle"]["number"][0] >= found.cycle] or batches[-1:]


def keep_now(watcher: Watcher, folder: Path, lock: AbstractContextManager[object] | None = None) -> str:
    """Keep the last minutes of `watcher`; return the line for the user.

    `lock` is held while its memory is looked at, not while files are written.
    """
    with lock or nullcontext():
        batches, source = list(watcher.history.batches), watcher.source
    if source is None:
        return "nothing to keep yet: no cycle was seen"
    try:
        kept = keep(batches, source, folder)
    except UserError as error:
        return str(error)
    kept_s = sum(len(batch.records) for batch in batches) / 100
    again = f"brake-ecu replay {argument(kept)} --config CONFIG --out RESULT.parquet"
    return f"{kept_s:.0f} s kept in {kept}; next: {again}"
