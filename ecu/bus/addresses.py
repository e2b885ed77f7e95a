"""Addresses: identifiers of the diagnostic connection, request, response, to all (ISO 15765-2); IPv4."""

import re
import sys
from collections.abc import Iterable
from ipaddress import IPv4Address
from typing import Any, Final, NamedTuple

from ecu.contract.records import EXTENDED_ID
from ecu.errors import UserError

STANDARD: Final = 0x7FF
FUNCTIONAL: Final = 0x7DF
FUNCTIONAL_29: Final = 0x18DB33F1
"""To all ECUs: ISO 15765-4, with 11 and with 29 bits."""
NEEDS: Final = f"needs can-isotp: {sys.executable} -m pip install can-isotp"


class Addresses(NamedTuple):
    """Identifiers of the diagnostic connection; beyond 11 bits they have 29."""

    request: int
    response: int
    functional: int
    """Of requests to all ECUs."""

    def __str__(self) -> str:
        """Return them as they are given."""
        return ":".join(f"0x{one:X}" for one in self)


def parse_addresses(option: str, text: str) -> Addresses:
    """Return the identifiers of `0x7E0:0x7E8`, or with a third one for requests to all ECUs.

    Raises:
        UserError: it names the option, and what is wrong.
    """
    words = text.split(":")
    if len(words) not in (2, 3) or not all(re.fullmatch(r"(0[xX])?[0-9A-Fa-f]{1,8}", word) for word in words):
        raise UserError(option, text, "give the identifiers of request and response: 0x7E0:0x7E8")
    numbers = [int(word, 16) for word in words]
    if len(words) == 2:
        numbers.append(FUNCTIONAL if numbers[0] <= STANDARD else FUNCTIONAL_29)
    if any(number >= 1 << 29 for number in numbers):
        raise UserError(option, text, "an identifier has 29 bits at most")
    if len(set(numbers)) < 3:
        raise UserError(option, text, "request, response and requests to all ECUs need an identifier each")
    return Addresses(*numbers)


def check_ipv4(option: str, text: str, address: str) -> None:
    """Raise UserError for an `option`, given as `text`, whose address is none."""
    try:
        IPv4Address(address)
    except ValueError:
        raise UserError(option, text, "give an IPv4 address, 127.0.0.1 or 0.0.0.0") from None


def refuse_taken(option: str, numbers: Iterable[int], taken: set[int]) -> None:
    """Raise UserError for an identifier of a message that the ECU sends or receives.

    Args:
        option: named in the error.
        numbers: identifiers of a connection.
        taken: identifiers, those of 29 bits with `EXTENDED_ID`.
    """
    for number in numbers:
        if in_table(number) in taken:
            raise UserError(option, f"0x{number:X}", "another message has it; choose one that is free")


def in_table(number: int) -> int:
    """Return an identifier with `EXTENDED_ID` where it has 29 bits."""
    return number | EXTENDED_ID if number > STANDARD else number


def can_filters(numbers: Iterable[int]) -> list[dict[str, Any]]:
    """Return python-can's filters for these identifiers alone."""
    return [
        {"can_id": one, "can_mask": 0x1FFFFFFF if one > STANDARD else STANDARD, "extended": one > STANDARD}
        for one in numbers
    ]
