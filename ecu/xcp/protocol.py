"""Numbers of the protocol layer (ASAM MCD-1 XCP 1.5): packets, commands, errors; a command refused."""

from enum import IntEnum
from typing import Final

RESPONSE: Final = 0xFF
ERROR: Final = 0xFE
EVENT: Final = 0xFD

EV_STORE_CAL: Final = 0x03
EV_DAQ_OVERLOAD: Final = 0x06
EV_SESSION_TERMINATED: Final = 0x07

CAL_PAG_RESOURCE: Final = 0x01
DAQ_RESOURCE: Final = 0x04


class Command(IntEnum):
    """First byte of a command, of those that the slave knows."""

    CONNECT = 0xFF
    DISCONNECT = 0xFE
    GET_STATUS = 0xFD
    SYNCH = 0xFC
    GET_COMM_MODE_INFO = 0xFB
    GET_ID = 0xFA
    SET_REQUEST = 0xF9
    GET_SEED = 0xF8
    UNLOCK = 0xF7
    SET_MTA = 0xF6
    UPLOAD = 0xF5
    SHORT_UPLOAD = 0xF4
    DOWNLOAD = 0xF0
    SHORT_DOWNLOAD = 0xED
    SET_CAL_PAGE = 0xEB
    GET_CAL_PAGE = 0xEA
    GET_PAG_PROCESSOR_INFO = 0xE9
    GET_SEGMENT_INFO = 0xE8
    GET_PAGE_INFO = 0xE7
    COPY_CAL_PAGE = 0xE4
    CLEAR_DAQ_LIST = 0xE3
    SET_DAQ_PTR = 0xE2
    WRITE_DAQ = 0xE1
    SET_DAQ_LIST_MODE = 0xE0
    START_STOP_DAQ_LIST = 0xDE
    START_STOP_SYNCH = 0xDD
    GET_DAQ_CLOCK = 0xDC
    GET_DAQ_PROCESSOR_INFO = 0xDA
    GET_DAQ_RESOLUTION_INFO = 0xD9
    GET_DAQ_EVENT_INFO = 0xD7
    FREE_DAQ = 0xD6
    ALLOC_DAQ = 0xD5
    ALLOC_ODT = 0xD4
    ALLOC_ODT_ENTRY = 0xD3
    WRITE_DAQ_MULTIPLE = 0xC7


class Error(IntEnum):
    """Second byte of a negative response."""

    CMD_SYNCH = 0x00
    DAQ_ACTIVE = 0x11
    CMD_UNKNOWN = 0x20
    CMD_SYNTAX = 0x21
    OUT_OF_RANGE = 0x22
    WRITE_PROTECTED = 0x23
    ACCESS_DENIED = 0x24
    ACCESS_LOCKED = 0x25
    PAGE_NOT_VALID = 0x26
    MODE_NOT_VALID = 0x27
    SEGMENT_NOT_VALID = 0x28
    SEQUENCE = 0x29
    DAQ_CONFIG = 0x2A
    MEMORY_OVERFLOW = 0x30
    GENERIC = 0x31
    RESOURCE_TEMPORARY_NOT_ACCESSIBLE = 0x33


class Refused(Exception):
    """A negative response."""

    def __init__(self, error: Error) -> None:
        self.error = error
        super().__init__(error.name)
