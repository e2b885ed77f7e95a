"""Calibration (ASAM MCD-1 XCP 1.5): a working page beside the reference page, behind seed and key.

One segment, the configuration. Page 0 is CONFIG as the run began, and cannot be written. Page 1 is a draft:
what is downloaded changes it alone, in any pieces and any order. SET_CAL_PAGE for the ECU checks it as a
whole and has the loop take it over; a draft that is refused stays, to be mended. A session begins with a
draft that is what the loop goes by.
"""

import hmac
import struct
from collections.abc import Callable
from enum import IntEnum
from typing import Final, Protocol

import numpy as np

from ecu.diagnostics.session import key_of
from ecu.xcp.memory import BEGINS
from ecu.xcp.parameters import PARAMETERS, parameters
from ecu.xcp.protocol import CAL_PAG_RESOURCE, EV_STORE_CAL, EVENT, Error, Refused

SEGMENT: Final = 0
ECU, XCP, ALL_SEGMENTS = 0x01, 0x02, 0x80
"""Mode of SET_CAL_PAGE and GET_CAL_PAGE."""
STORE_CAL: Final = 0x01
READ_ONLY, READ_WRITE = 0x0F, 0x3F
"""PAGE_PROPERTIES: ECU and master read it, each with and without the other; the second is written too."""


class Page(IntEnum):
    """Pages of the segment."""

    REFERENCE = 0
    WORKING = 1


def _writable() -> "np.ndarray[tuple[int], np.dtype[np.bool_]]":
    found = np.zeros(PARAMETERS.itemsize, bool)
    for one in parameters():
        if one.writable:
            kind, offset = PARAMETERS.fields[one.key][:2]  # type: ignore[index]
            found[offset : offset + kind.itemsize] = True
    return found


_WRITABLE: Final = _writable()


class Run(Protocol):
    """The run that is calibrated."""

    reference: bytes
    """PARAMETERS of CONFIG."""

    def current(self) -> bytes:
        """Return PARAMETERS that the loop goes by."""

    def take_over(self, parameters: bytes) -> None:
        """Check them and have the loop take them over. Raises Refused."""

    def save(self, parameters: bytes) -> None:
        """Write them into a file: the loop has to go by them. Raises Refused."""


class Calibration:
    """Lock and pages of one session."""

    def __init__(self, run: Run, secret: bytes, new_seed: Callable[[], bytes]) -> None:
        self._run, self._secret, self._new_seed = run, secret, new_seed
        self.events: list[bytes] = []
        """To be sent after the response."""
        self.begin()

    def begin(self) -> None:
        """Begin a session: locked, with a draft as the loop goes by it."""
        self.locked = True
        self._seed, self._to_give, self._key = b"", b"", b""
        self._page = Page.WORKING
        self._draft = bytearray(self._run.current())

    @property
    def protection(self) -> int:
        """Resource protection status."""
        return CAL_PAG_RESOURCE if self.locked else 0

    def seed(self, mode: int, resource: int, room: int) -> bytes:
        """Return the response to GET_SEED: what of the seed is left, as much of it as there is room for."""
        if mode == 0:
            if resource != CAL_PAG_RESOURCE:
                raise Refused(Error.OUT_OF_RANGE)
            self._seed = self._new_seed() if self.locked else b""
            self._to_give, self._key = self._seed, b""
        elif mode != 1 or not self._to_give:
            raise Refused(Error.SEQUENCE if mode == 1 else Error.OUT_OF_RANGE)
        left, self._to_give = self._to_give, self._to_give[room:]
        return bytes([len(left)]) + left[:room]

    def unlock(self, left: int, part: bytes) -> bytes | None:
        """Return the response to UNLOCK, None: the key is wrong; `left`: bytes of the key, these included."""
        if not self._seed or self._to_give:
            raise Refused(Error.SEQUENCE)
        expected = key_of(self._secret, self._seed)
        if left != len(expected) - len(self._key) or not part:
            raise Refused(Error.SEQUENCE)
        self._key += part[:left]
        if len(self._key) == len(expected):
            right, self._seed = hmac.compare_digest(self._key, expected), b""
            if not right:
                return None
            self.locked = False
        return bytes([self.protection])

    def read(self, place: int, length: int) -> bytes | None:
        """Return bytes of the page that the master reads; None: the place in an image is no parameter."""
        begin = place - BEGINS["parameters"]
        if begin < 0:
            return None
        page = self._draft if self._page is Page.WORKING else self._run.reference
        return bytes(page[begin : begin + length])

    def write(self, place: int, data: bytes) -> None:
        """Write into the draft. Raises Refused."""
        self._need_key()
        begin = place - BEGINS["parameters"]
        end = begin + len(data)
        if begin < 0 or self._page is not Page.WORKING or not _WRITABLE[begin:end].all():
            raise Refused(Error.WRITE_PROTECTED)
        self._draft[begin:end] = data

    def set_page(self, mode: int, segment: int, number: int) -> bytes:
        """Return the response to SET_CAL_PAGE."""
        self._need_key()
        if not mode & (ECU | XCP) or mode & ~(ECU | XCP | ALL_SEGMENTS):
            raise Refused(Error.MODE_NOT_VALID)
        page = _page(SEGMENT if mode & ALL_SEGMENTS else segment, number)
        if mode & ECU:
            wanted = bytes(self._draft) if page is Page.WORKING else self._run.reference
            if wanted != self._run.current():
                self._run.take_over(wanted)
        if mode & XCP:
            self._page = page
        return b""

    def get_page(self, mode: int, segment: int) -> bytes:
        """Return the response to GET_CAL_PAGE."""
        _page(segment, 0)
        if mode not in (ECU, XCP):
            raise Refused(Error.MODE_NOT_VALID)
        by_config = self._run.current() == self._run.reference
        of_ecu = Page.REFERENCE if by_config else Page.WORKING
        return bytes([0, 0, of_ecu if mode == ECU else self._page])

    def copy_page(self, source: int, page: int, target: int, onto: int) -> bytes:
        """Return the response to COPY_CAL_PAGE."""
        self._need_key()
        copied = _page(source, page)
        if _page(target, onto) is not Page.WORKING:
            raise Refused(Error.WRITE_PROTECTED)
        if copied is Page.REFERENCE:
            self._draft[:] = self._run.reference
        return b""

    def page_info(self, segment: int, number: int) -> bytes:
        """Return the response to GET_PAGE_INFO."""
        return bytes([READ_WRITE if _page(segment, number) is Page.WORKING else READ_ONLY, SEGMENT])

    def segment_info(self, mode: int, segment: int, what: int, base: int) -> bytes:
        """Return the response to GET_SEGMENT_INFO; `base`: address of the segment."""
        _page(segment, 0)
        if mode == 0 and what in (0, 1):
            return struct.pack("<BBBL", 0, 0, 0, PARAMETERS.itemsize if what else base)
        if mode == 1:
            return bytes([len(Page), 0, 0, 0, 0])
        raise Refused(Error.OUT_OF_RANGE)

    def request(self, mode: int) -> bytes:
        """Return the response to SET_REQUEST: it is done at once, and an event says so."""
        self._need_key()
        if mode != STORE_CAL:
            raise Refused(Error.MODE_NOT_VALID)
        self._run.save(bytes(self._draft))
        self.events.append(bytes([EVENT, EV_STORE_CAL]))
        return b""

    def _need_key(self) -> None:
        if self.locked:
            raise Refused(Error.ACCESS_LOCKED)


def _page(segment: int, number: int) -> Page:
    """Return the page. Raises Refused."""
    if segment != SEGMENT:
        raise Refused(Error.SEGMENT_NOT_VALID)
    if number not in tuple(Page):
        raise Refused(Error.PAGE_NOT_VALID)
    return Page(number)
