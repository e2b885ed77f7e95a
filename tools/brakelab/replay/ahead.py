"""Input that another thread prepares: reading, parsing and receiving beside the algorithm.

Both spend most of their time where other threads of Python run (`ecu.jit.batch_kernel`).
"""

from collections.abc import Iterator
from queue import Queue
from threading import Event, Thread
from typing import Final, NamedTuple, TypeVar

Block = TypeVar("Block")

DEPTH: Final = 4
"""Blocks that wait at most."""


class _End(NamedTuple):
    error: BaseException | None


def read_ahead(blocks: Iterator[Block]) -> Iterator[Block]:
    """Yield `blocks` in their order, and raise what they raise in its place.

    The thread ends with the iteration, also with one that is given up.
    """
    waiting: Queue[Block | _End] = Queue(DEPTH)
    given_up = Event()

    def prepare() -> None:
        error: BaseException | None = None
        try:
            for block in blocks:
                waiting.put(block)
                if given_up.is_set():
                    return
        except BaseException as raised:
            error = raised
        waiting.put(_End(error))

    thread = Thread(target=prepare, name="brake-ecu reads ahead", daemon=True)
    thread.start()
    try:
        while not isinstance(block := waiting.get(), _End):
            yield block
    finally:
        given_up.set()
        while thread.is_alive():
            while not waiting.empty():
                waiting.get()
            thread.join(0.01)
    if block.error is not None:
        raise block.error
