"""Work of a workshop on the running loop: handed over as a calibration is, stored before it is confirmed."""

import time
from typing import Final

import structlog

from ecu.contract.faults import NOT_KEPT, fault_mask
from ecu.contract.signals import CORNERS
from ecu.contract.work import Kind, Work
from ecu.diagnostics.session import Reason, Refused
from ecu.errors import UserError
from ecu.pads import pads, worn_off
from ecu.recording.ring import RingReader
from ecu.runtime.asking import Busy, Sleep, wait, worked
from ecu.settings.config import config_of

WHERE: Final = "diagnostics"
STANDS_NOT: Final = "the car does not stand with released brakes, or nobody knows; stop and wait a second"
NOWHERE: Final = "nothing would be kept; start with --state"
NOT_STORED: Final = "done, but not stored: mend what the line not_kept says, and write again"


class Workshop:
    """Works on the run of a ring that was opened to ask (`RingReader`); `kept`: it has a state folder."""

    def __init__(self, reader: RingReader, *, kept: bool, sleep: Sleep = time.sleep) -> None:
        self._reader, self._kept, self._sleep = reader, kept, sleep
        self._config = config_of(reader.description["configuration"], WHERE)
        self._log = structlog.get_logger("diagnostics")

    def do(self, kind: Kind, values: dict[str, float]) -> None:
        """Do it; `values`: thicknesses [mm] by corner where pads were measured. Raises Refused."""
        if not self._kept:
            raise self._refused(Reason.CONDITIONS_NOT_CORRECT, NOWHERE)
        wear = self._wear(values) if kind == Kind.MEASURED_PADS else values
        ring = self._reader.ring
        try:
            begins = worked(self._reader, Work(kind, wear), self._sleep)
        except Busy as busy:
            raise self._refused(Reason.BUSY, str(busy)) from None
        if begins is None:
            raise self._refused(Reason.CONDITIONS_NOT_CORRECT, STANDS_NOT)
        stored = wait(lambda: ring.header["followed"][0] >= begins, self._sleep)
        reported = ring.header["written"][0] + 1  # the loop's fault bit is a cycle later
        if not stored or not wait(lambda: ring.header["written"][0] > reported, self._sleep) or self._lost():
            raise self._refused(Reason.PROGRAMMING_FAILURE, NOT_STORED)

    def _wear(self, thicknesses: dict[str, float]) -> dict[str, float]:
        """Return the wear [mm] of measured pads by corner. Raises Refused."""
        learned = self._reader.latest("learned")
        if learned is None:
            raise self._refused(Reason.BUSY, "no cycle yet; try again")
        found = {}
        for i, (corner, pad) in enumerate(zip(CORNERS, pads(self._config), strict=True)):
            if corner in thicknesses:
                try:
                    found[corner] = worn_off(learned[0]["wear"], pad, i, thicknesses[corner])
                except UserError as error:
                    raise self._refused(Reason.OUT_OF_RANGE, f"{error.place}: {error.remedy}") from None
        return found

    def _lost(self) -> bool:
        """Return whether the last cycle says that nothing is kept."""
        last = self._reader.newest()
        return last is None or bool(int(fault_mask(last["outputs"])[0]) & NOT_KEPT)

    def _refused(self, code: Reason, reason: str) -> Refused:
        self._log.warning("service_refused", reason=reason)
        return Refused(code)
