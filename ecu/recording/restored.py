"""Restored state of a run: learned values of this car and its brakes, and wear of its linings."""

from pathlib import Path

from ecu.algorithm.step import new_state
from ecu.contract.records import RecordArray
from ecu.recording.rest import cool_discs, rest_of
from ecu.recording.store import PARTS, open_to_read, restore, restore_part, saved_at
from ecu.settings.config import Config, store_key


def restored(
    folder: Path, config: Config, params: RecordArray, now: float | None = None
) -> tuple[int, RecordArray] | None:
    """Return revision and record (`LEARNED`, shape (1,)) of the store in `folder`, None if it is empty.

    Revision 0: unadapted for these brakes or this version, but wear and dust continue. `now`: Unix time [s],
    the discs have cooled since the store was written; None: nobody knows how long ago that was.

    Raises:
        UserError: the store can be neither opened nor read.
    """
    key = store_key(config)
    with open_to_read(folder) as store:
        found = restore(store, key, params["mu_nominal"][0])
        kept = {} if found else {part: restore_part(store, key, part) for part in PARTS}
        if found and now is not None:
            cool_discs(found[1], params, rest_of(saved_at(store, key, found[0]), now))
    if not any(record is not None for record in kept.values()):
        return found
    learned: RecordArray = new_state(params)["learned"].copy()
    for part, record in kept.items():
        if record is not None:
            learned[part] = record
    return 0, learned
