"""Where a server of a run listens: opened again, for as long as it takes, when it cannot be or has gone."""

import time
from collections.abc import Callable
from typing import Final, Generic, Protocol, TypeVar

import structlog

from ecu.errors import UserError

AGAIN_S: Final = 5.0


class _Closable(Protocol):
    def close(self) -> None: ...


End = TypeVar("End", bound=_Closable)


class Place(Generic[End]):
    """One end of a connection, by what opens it (raises UserError: it cannot be opened)."""

    def __init__(
        self, server: str, open_end: Callable[[], End], now_s: Callable[[], float] = time.monotonic
    ) -> None:
        """`server`: what the log calls it that is not there without an end."""
        self._server, self._open, self._now_s = server, open_end, now_s
        self._end: End | None = None
        self._again_s = 0.0
        self._reported = False

    def end(self) -> End | None:
        """Return the open end, None: it is not there; it is tried every 5 s."""
        if self._end is None and self._now_s() >= self._again_s:
            try:
                self._end = self._open()
                self._reported = False
            except UserError as error:
                self.lose(error)
        return self._end

    def lose(self, error: Exception) -> None:
        """Close an end that failed; say why, once until it is back."""
        if not self._reported:
            structlog.get_logger(self._server).error(
                f"no_{self._server}", reason=str(error), remedy="it is tried again every 5 s"
            )
        self._reported, self._again_s = True, self._now_s() + AGAIN_S
        self.close()

    def close(self) -> None:
        """Close the end, if it is open."""
        if self._end is not None:
            self._end.close()
            self._end = None
