"""What a calibration is to the run: checked as a CONFIG file, handed to the loop, written into a file.

Everything is made here, in the process of the slave: the loop (`ecu/runtime/calibration.py`) copies a record.
"""

import secrets
import time
from pathlib import Path
from typing import Any, Final

import numpy as np
import structlog

from ecu.contract.records import RecordArray, new_record
from ecu.errors import UserError
from ecu.output import argument
from ecu.recording.calibration import in_force
from ecu.recording.ring import RingReader
from ecu.runtime.asking import Busy, Sleep, taken_over
from ecu.runtime.xcp import SAVE_OPTION, SAVED
from ecu.settings.config import config_of, new_params
from ecu.settings.toml_file import toml_lines
from ecu.xcp.parameters import PARAMETERS, tables_of, to_record
from ecu.xcp.protocol import Error, Refused

WHERE: Final = "calibration"
"""In the place of a file in the line of a mistake."""


class Takeover:
    """Calibrates the run of a ring that was opened to ask (`RingReader`)."""

    def __init__(self, reader: RingReader, save: Path | None, sleep: Sleep = time.sleep) -> None:
        self._reader, self._save, self._sleep = reader, save, sleep
        self._config: dict[str, Any] = reader.description["configuration"]
        self._log = structlog.get_logger("xcp")
        config_of(self._config, WHERE)  # what it needs is loaded before a master waits for it
        self.reference = to_record(self._config).tobytes()
        found = in_force(reader.ring)
        self._tables = {} if found is None else found.tables
        self.pages = new_record(PARAMETERS, 2)
        self.pages[:] = self._record()
        """PARAMETERS, shape (2,): before `begins`, and from there on."""
        self.begins = 0 if found is None else found.cycle
        """The first cycle that goes by the second."""

    def _record(self) -> RecordArray:
        return to_record({**self._config, **self._tables})

    def current(self) -> bytes:
        """Return PARAMETERS that the loop goes by."""
        return self.pages[1].tobytes()

    def parameters_of(self, cycles: RecordArray) -> RecordArray:
        """Return PARAMETERS of each of `cycles` (CYCLE, shape (n,))."""
        found: RecordArray = self.pages[(cycles["number"] >= self.begins).astype(np.intp)]
        return found

    def take_over(self, parameters: bytes) -> None:
        """Check PARAMETERS and have the loop take them over; the operator reads why not. Raises Refused."""
        tables = tables_of(np.frombuffer(parameters, PARAMETERS), self._config)
        try:
            config = config_of({**self._config, **tables}, WHERE)
        except UserError as error:
            raise self._refused(Error.OUT_OF_RANGE, str(error)) from None
        try:
            begins = taken_over(self._reader, new_params(config), tables, sleep=self._sleep)
        except Busy as busy:
            raise self._refused(Error.RESOURCE_TEMPORARY_NOT_ACCESSIBLE, str(busy)) from None
        if begins is None:
            reason = "the car is armed and does not stand; stop, or calibrate a shadow"
            raise self._refused(Error.RESOURCE_TEMPORARY_NOT_ACCESSIBLE, reason)
        self._tables, self.begins = tables, begins
        self.pages[0], self.pages[1] = self.pages[1], self._record()[0]

    def save(self, parameters: bytes) -> None:
        """Write PARAMETERS, which the loop has to go by, as a CONFIG file. Raises Refused."""
        if self._save is None:
            raise self._refused(Error.MODE_NOT_VALID, f"nothing is stored; start with {SAVE_OPTION} FILE")
        if parameters != self.current():
            reason = "not stored: the loop goes by other values; take the working page over first"
            raise self._refused(Error.SEQUENCE, reason)
        given = {**self._config, **self._tables}
        del given["transmit"]  # who drives with it arms it anew
        unfinished = self._save.with_name(f"{self._save.name}.{secrets.token_hex(4)}")
        try:
            unfinished.write_text("\n".join([SAVED, *toml_lines(given), ""]), encoding="utf-8")
            unfinished.replace(self._save)
        except OSError as error:
            reason = f"{self._save}: cannot be written: {error.strerror}"
            raise self._refused(Error.GENERIC, reason) from None
        self._log.info(
            "calibration_saved", file=str(self._save), next=f"brake-ecu config check {argument(self._save)}"
        )

    def _refused(self, error: Error, reason: str) -> Refused:
        self._log.warning("calibration_refused", reason=reason)
        return Refused(error)
