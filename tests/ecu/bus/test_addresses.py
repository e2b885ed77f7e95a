"""Identifiers of the diagnostic connection, as they are given and refused."""

import can
import pytest

from ecu.bus.addresses import Addresses, can_filters, check_ipv4, parse_addresses, refuse_taken
from ecu.contract.records import EXTENDED_ID
from ecu.errors import UserError


@pytest.mark.parametrize(
    ("text", "addresses"),
    [
        ("0x7E0:0x7E8", Addresses(0x7E0, 0x7E8, 0x7DF)),
        ("7e0:7E8", Addresses(0x7E0, 0x7E8, 0x7DF)),
        ("0x7E0:0x7E8:0x700", Addresses(0x7E0, 0x7E8, 0x700)),
        ("0x18DA28F1:0x18DAF128", Addresses(0x18DA28F1, 0x18DAF128, 0x18DB33F1)),
    ],
)
def test_identifiers_are_read(text, addresses):
    assert parse_addresses("--diagnostics", text) == addresses
    assert parse_addresses("--diagnostics", str(addresses)) == addresses


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("0x7E0", "give the identifiers of request and response: 0x7E0:0x7E8"),
        ("0x7E0:", "give the identifiers"),
        ("a:b:c:d", "give the identifiers"),
        ("-1:2", "give the identifiers"),
        ("0x7E0:0x7E0", "request, response and requests to all ECUs need an identifier each"),
        ("0x7DF:0x7E8", "need an identifier each"),
        ("0x20000000:0x7E8", "an identifier has 29 bits at most"),
    ],
)
def test_identifiers_that_are_none_are_one_line(text, says):
    with pytest.raises(UserError) as refused:
        parse_addresses("--diagnostics", text)
    assert str(refused.value).startswith(f"--diagnostics: {text}: ")
    assert says in str(refused.value)


@pytest.mark.parametrize(
    ("text", "taken", "named"),
    [
        ("0x50:0x7E8", {0x50}, "0x50"),
        ("0x7E0:0x60", {0x60}, "0x60"),
        ("0x7E0:0x7E8", {0x7DF}, "0x7DF"),
        ("0x18DA28F1:0x18DAF128", {0x18DA28F1 | EXTENDED_ID}, "0x18DA28F1"),
    ],
)
def test_an_identifier_of_another_message_is_refused(text, taken, named):
    with pytest.raises(UserError, match=f"--diagnostics: {named}: another message has it"):
        refuse_taken("--diagnostics", parse_addresses("--diagnostics", text), taken)
    refuse_taken("--diagnostics", parse_addresses("--diagnostics", text), {0x18DA28F1, 0x51})


def test_filters_let_these_identifiers_pass_alone():
    sent = [(0x123, False), (0x123, True), (0x124, False), (0x18DA28F1, True), (0x18DA28F2, True)]
    filters = can_filters([0x123, 0x18DA28F1])
    with (
        can.Bus("filters", interface="virtual") as sender,
        can.Bus("filters", interface="virtual", can_filters=filters) as receiver,
    ):
        for number, extended in sent:
            sender.send(can.Message(arbitration_id=number, is_extended_id=extended))
        heard = [receiver.recv(timeout=0.1) for _ in range(3)]
    assert heard[2] is None
    assert [(one.arbitration_id, one.is_extended_id) for one in heard[:2]] == [sent[0], sent[3]]


@pytest.mark.parametrize("address", ["localhost", "127.0.0", "::1", "256.0.0.1", ""])
def test_an_address_that_is_none_of_ipv4_is_refused(address):
    check_ipv4("--xcp", "udp:0.0.0.0:5555", "0.0.0.0")
    with pytest.raises(UserError, match="--xcp: udp:X:5555: give an IPv4 address"):
        check_ipv4("--xcp", "udp:X:5555", address)
