"""The diagnostic server as bytes: what is asked, what is answered."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ecu.contract.faults import BUS_OFF, WHEEL_SPEED_LOST
from ecu.diagnostics.fault_memory import CONFIRMED, FaultMemory
from ecu.diagnostics.identifiers import OF_SNAPSHOT, length_of
from ecu.diagnostics.services import SERVICES, pending, respond
from ecu.diagnostics.session import REASONS, SILENT_WHEN_FUNCTIONAL, Ecu, Session, key_of
from ecu.diagnostics.trouble_codes import TROUBLE_CODES

from .conftest import SECRET

EXTENDED = "10 03"
LOCKED, UNLOCKED = (EXTENDED,), (EXTENDED, "27 01", "key")
ON_SHADOW = {"armed": False}
NO_KEY = {"secret": b""}

# what -> requests before, request, response, what the ECU is otherwise
EXCHANGES = {
    # 0x10 DiagnosticSessionControl
    "default session": ((), "10 01", "50 01 00 32 01 F4", {}),
    "extended session, with P2 50 ms and P2* 5 s": ((), "10 03", "50 03 00 32 01 F4", {}),
    "a session, quietly": ((), "10 83", "", {}),
    "programming session": ((), "10 02", "7F 10 12", {}),
    "no session": ((), "10", "7F 10 13", {}),
    "a session too long": ((), "10 03 00", "7F 10 13", {}),
    # 0x11 ECUReset
    "reset while armed": ((), "11 01", "7F 11 22", {}),
    "reset of a shadow": ((), "11 01", "51 01", ON_SHADOW),
    "soft reset": ((), "11 03", "7F 11 12", ON_SHADOW),
    "reset too long": ((), "11 01 00", "7F 11 13", ON_SHADOW),
    # 0x14 ClearDiagnosticInformation
    "clear all": ((), "14 FF FF FF", "54", {}),
    "clear one": ((), "14 50 00 08", "54", {}),
    "clear another's group": ((), "14 00 00 00", "7F 14 31", {}),
    "clear too short": ((), "14 FF FF", "7F 14 13", {}),
    "clear too long": ((), "14 FF FF FF 00", "7F 14 13", {}),
    # 0x19 ReadDTCInformation: wheel speed lost is confirmed, was there twice; passed are all others
    "number by status": ((), "19 01 08", "59 01 7F 00 00 01", {}),
    "number by status of none": ((), "19 01 80", "59 01 7F 00 00 00", {}),
    "by status": ((), "19 02 FF", "59 02 7F 50 00 08 2F", {}),
    "by status, quietly": ((), "19 82 FF", "", {}),
    "occurrences and ageing": ((), "19 06 50 00 08 FF", "59 06 50 00 08 2F 01 02 02 00", {}),
    "occurrences": ((), "19 06 50 00 08 01", "59 06 50 00 08 2F 01 02", {}),
    "ageing": ((), "19 06 50 00 08 02", "59 06 50 00 08 2F 02 00", {}),
    "no such extended data": ((), "19 06 50 00 08 03", "7F 19 31", {}),
    "snapshot of the first": ((), "19 04 50 00 08 01", "59 04 50 00 08 2F 01 06 AA BB", {}),
    "snapshot of the last": ((), "19 04 50 00 08 02", "59 04 50 00 08 2F 02 06 CC DD", {}),
    "snapshots": ((), "19 04 50 00 08 FF", "59 04 50 00 08 2F 01 06 AA BB 02 06 CC DD", {}),
    "snapshot of a code without": ((), "19 04 50 10 88 FF", "59 04 50 10 88 00", {}),
    "no such snapshot": ((), "19 04 50 00 08 03", "7F 19 31", {}),
    "no such code": ((), "19 04 50 00 09 FF", "7F 19 31", {}),
    "no mask": ((), "19 02", "7F 19 13", {}),
    "no sub-function": ((), "19", "7F 19 13", {}),
    "another sub-function": ((), "19 03", "7F 19 12", {}),
    # 0x22 ReadDataByIdentifier
    "read": ((), "22 01 03", "62 01 03 00 27 10", {}),
    "read two": ((), "22 F1 89 01 03", "62 F1 89 31 2E 32 2E 33 01 03 00 27 10", {}),
    "read one that there is not": ((), "22 F1 90", "7F 22 31", {}),
    "read one of two that there are": ((), "22 F1 90 01 03", "62 01 03 00 27 10", {}),
    "read half": ((), "22 01", "7F 22 13", {}),
    "read none": ((), "22", "7F 22 13", {}),
    "read too many": ((), "22" + " 01 03" * 33, "7F 22 13", {}),
    "read too much": ((), "22" + " F1 A1" * 32, "7F 22 14", {}),
    "active session": ((), "22 F1 86", "62 F1 86 01", {}),
    "active session, extended": (LOCKED, "22 F1 86", "62 F1 86 03", {}),
    # 0x27 SecurityAccess
    "seed": (LOCKED, "27 01", "67 01" + " 01" * 16, {}),
    "seed in the default session": ((), "27 01", "7F 27 7F", {}),
    "seed without a key file": (LOCKED, "27 01", "7F 27 22", NO_KEY),
    "seed asked for twice": ((*LOCKED, "27 01"), "27 01", "67 01" + " 01" * 16, {}),
    "after a wrong key": ((*LOCKED, "27 01", "27 02" + " 00" * 16), "27 01", "67 01" + " 02" * 16, {}),
    "seed when unlocked": (UNLOCKED, "27 01", "67 01" + " 00" * 16, {}),
    "right key": ((*LOCKED, "27 01"), "key", "67 02", {}),
    "wrong key": ((*LOCKED, "27 01"), "27 02" + " 00" * 16, "7F 27 35", {}),
    "key without a seed": (LOCKED, "27 02" + " 00" * 16, "7F 27 24", {}),
    "key too short": ((*LOCKED, "27 01"), "27 02 00", "7F 27 13", {}),
    "key of another level": (LOCKED, "27 03", "7F 27 12", {}),
    "second key for one seed": ((*LOCKED, "27 01", "27 02" + " 00" * 16), "key", "7F 27 24", {}),
    # 0x28 CommunicationControl
    "silence the ECU": (LOCKED, "28 03 01", "7F 28 22", {}),
    "let the ECU speak": (LOCKED, "28 00 01", "7F 28 22", {}),
    "silence, what it hears": (LOCKED, "28 01 01", "7F 28 22", {}),
    "silence, what it sends": (LOCKED, "28 02 01", "7F 28 22", {}),
    "silence a shadow": (LOCKED, "28 03 01", "7F 28 22", ON_SHADOW),
    "silence in the default session": ((), "28 03 01", "7F 28 7F", {}),
    "silence, too short": (LOCKED, "28 03", "7F 28 13", {}),
    "silence, another kind": (LOCKED, "28 05 01", "7F 28 12", {}),
    # 0x2E WriteDataByIdentifier
    "pads measured": (UNLOCKED, "2E 01 18 03 D4 FF FF FF FF 04 4C", "6E 01 18", {}),
    "write, locked": (LOCKED, "2E 01 18" + " 03 D4" * 4, "7F 2E 33", {}),
    "write in the default session": ((), "2E 01 18" + " 03 D4" * 4, "7F 2E 7F", {}),
    "write what is read alone": (UNLOCKED, "2E 01 03 00 00 00", "7F 2E 31", {}),
    "write what there is not": (LOCKED, "2E F1 90 00", "7F 2E 31", {}),
    "write, no data": (UNLOCKED, "2E 01 18", "7F 2E 13", {}),
    "write, too short": (UNLOCKED, "2E 01 18 03 D4", "7F 2E 13", {}),
    "write, too long": (UNLOCKED, "2E 01 18" + " 03 D4" * 4 + " 00", "7F 2E 13", {}),
    "write of no corner": (UNLOCKED, "2E 01 18" + " FF FF" * 4, "7F 2E 31", {}),
    # another that there is not
    "upload": (UNLOCKED, "35 00 44", "7F 35 11", {}),
    # 0x31 RoutineControl
    "self-test": (LOCKED, "31 01 02 00", "71 01 02 00 00 00 00 00", {}),
    "its result": ((*LOCKED, "31 01 02 00"), "31 03 02 00", "71 03 02 00 00 00 00 00", {}),
    "its result before it": (LOCKED, "31 03 02 00", "7F 31 24", {}),
    "stop it": (LOCKED, "31 02 02 00", "7F 31 12", {}),
    "self-test in the default session": ((), "31 01 02 00", "7F 31 7F", {}),
    "new pads, locked": (LOCKED, "31 01 02 01", "7F 31 33", {}),
    "new pads in front": (UNLOCKED, "31 01 02 01 03", "71 01 02 01", {}),
    "new pads, quietly": (UNLOCKED, "31 81 02 01 0F", "", {}),
    "new pads nowhere": (UNLOCKED, "31 01 02 01 00", "7F 31 31", {}),
    "new pads of a fifth wheel": (UNLOCKED, "31 01 02 01 11", "7F 31 31", {}),
    "new pads, no corners": (UNLOCKED, "31 01 02 01", "7F 31 13", {}),
    "new pads, too long": (UNLOCKED, "31 01 02 01 03 00", "7F 31 13", {}),
    "new pads, their result": (UNLOCKED, "31 03 02 01", "7F 31 12", {}),
    "forget, locked": (LOCKED, "31 01 02 02", "7F 31 33", {}),
    "forget": (UNLOCKED, "31 01 02 02", "71 01 02 02", {}),
    "forget, too long": (UNLOCKED, "31 01 02 02 00", "7F 31 13", {}),
    "no such routine": (LOCKED, "31 01 03 00", "7F 31 31", {}),
    "half a routine": (LOCKED, "31 01 02", "7F 31 13", {}),
    # 0x3E TesterPresent, 0x85 ControlDTCSetting
    "tester present": ((), "3E 00", "7E 00", {}),
    "tester present, quietly": ((), "3E 80", "", {}),
    "tester present, another": ((), "3E 01", "7F 3E 12", {}),
    "setting off": (LOCKED, "85 02", "C5 02", {}),
    "setting on": (LOCKED, "85 01", "C5 01", {}),
    "setting in the default session": ((), "85 02", "7F 85 7F", {}),
    "setting, another": (LOCKED, "85 03", "7F 85 12", {}),
    # neither
    "nothing": ((), "", "", {}),
    "another ECU's response": ((), "50 03 00 32 01 F4", "", {}),
    "another ECU's refusal": ((), "7F 10 12", "", {}),
}  # fmt: skip


def ask(tester, request):
    if request == "key":
        return tester.ask("27 02" + key_of(SECRET, tester.session.seed).hex())
    return tester.ask(request)


@pytest.mark.parametrize(("before", "request_", "response", "ecu"), EXCHANGES.values(), ids=EXCHANGES)
def test_what_is_asked_and_what_is_answered(before, request_, response, ecu, tester, world):
    codes = sum(code.fault.bit for code in TROUBLE_CODES)
    snapshots = iter([b"\xaa\xbb", b"\xcc\xdd"])
    for failed in (0, WHEEL_SPEED_LOST, 0, WHEEL_SPEED_LOST):
        for _ in range(120):
            world.memory.add(failed, codes, lambda: next(snapshots))
    one = tester(**ecu)
    for earlier in before:
        assert not ask(one, earlier).startswith("7F 10")
    assert ask(one, request_) == response


def test_supported_codes_are_all_with_their_status(tester):
    answer = bytes.fromhex(tester().ask("19 0A"))
    rows = [answer[at : at + 4] for at in range(3, len(answer), 4)]
    assert answer[:3] == bytes.fromhex("59 0A 7F")
    assert [int.from_bytes(row[:3], "big") for row in rows] == [code.number for code in TROUBLE_CODES]
    assert {row[3] for row in rows} == {0x50}


@pytest.mark.parametrize(
    "request_",
    [request for _, request, answer, _ in EXCHANGES.values() if answer[:2] == "7F" and request != "key"],
)
def test_to_all_ecus_what_one_alone_refuses_is_not_said(request_, tester):
    one, other = tester(), tester()
    physical = ask(one, request_)
    functional = other.ask(request_, functional=True)
    silent = int(physical[6:8] or "0", 16) in SILENT_WHEN_FUNCTIONAL
    assert functional == ("" if silent else physical)


def test_a_quiet_request_of_another_subfunction_is_refused_aloud(tester):
    assert tester().ask("10 82") == "7F 10 12"


def test_a_session_ends_after_five_seconds_of_silence(tester):
    one = tester()
    ask(one, EXTENDED)
    one.now_s += 5.0
    assert ask(one, "22 F1 86") == "62 F1 86 03"
    one.now_s += 4.9
    assert one.ask("3E 80", functional=True) == ""
    one.now_s += 4.9
    assert ask(one, "22 F1 86") == "62 F1 86 03"
    one.now_s += 5.1
    assert ask(one, "22 F1 86") == "62 F1 86 01"


@pytest.mark.parametrize("ends", ["10 01", "silence"])
def test_with_the_session_ends_all_that_came_with_it(ends, tester):
    one = tester()
    for request in (*UNLOCKED, "85 02", "31 01 02 00"):
        ask(one, request)
    assert not one.session.dtc_setting
    if ends == "silence":
        one.now_s += 6
        ask(one, "3E 00")
    else:
        ask(one, ends)
    assert one.session.dtc_setting
    assert ask(one, EXTENDED)
    assert ask(one, "31 01 02 01") == "7F 31 33"
    assert ask(one, "31 03 02 00") == "7F 31 24"


def test_a_new_extended_session_is_locked_and_keeps_setting_and_result(tester):
    one = tester()
    for request in (*UNLOCKED, "85 02", "31 01 02 00", EXTENDED):
        ask(one, request)
    assert ask(one, "31 03 02 00") == "71 03 02 00 00 00 00 00"
    assert not one.session.dtc_setting
    assert ask(one, "31 01 02 01") == "7F 31 33"


def test_three_wrong_keys_cost_ten_seconds(tester):
    one, wrong = tester(), "27 02" + " 00" * 16
    ask(one, EXTENDED)
    answers = []
    for _ in range(3):
        ask(one, "27 01")
        answers.append(ask(one, wrong))
    assert answers == ["7F 27 35", "7F 27 35", "7F 27 36"]
    for _ in range(2):
        assert ask(one, "27 01") == "7F 27 37"
        one.now_s += 4.9
        ask(one, "10 01")  # a new session does not shorten it
        ask(one, EXTENDED)
    one.now_s += 0.3
    for _ in range(2):  # a right key, or the delay, forgives the wrong ones
        answers = []
        for request in ("27 01", wrong, "27 01", wrong, "27 01", "key"):
            answers.append(ask(one, request)[:8])
        assert answers == ["67 01 " + answers[0][6:], "7F 27 35", answers[2], "7F 27 35", answers[4], "67 02"]
        ask(one, EXTENDED)


def test_a_reset_is_only_for_who_is_started_again(tester, world):
    one = tester(armed=False)
    assert ask(one, "11 01") == "51 01"
    assert one.session.restarts
    world.restartable = False
    assert ask(tester(armed=False), "11 01") == "7F 11 22"


def test_a_clear_that_cannot_be_stored_is_no_success(tester, world):
    world.stores = False
    assert tester().ask("14 FF FF FF") == "7F 14 72"


@pytest.mark.parametrize(
    ("request_", "lasts", "first"),
    [
        ("14 FF FF FF", True, "7F 14 78"),
        ("14 50 00 08", True, "7F 14 78"),
        ("14 FF FF FF", False, ""),
        ("14 00 00 00", True, ""),
        ("14", True, ""),
        ("19 02 FF", True, ""),
        ("22 50 00 08", True, ""),
        ("", True, ""),
    ],
)
def test_a_response_that_may_be_late_is_preceded_by_pending(request_, lasts, first, tester):
    ecu = tester(clearing_lasts=lasts).ecu
    assert pending(Session(), bytes.fromhex(request_), ecu) == bytes.fromhex(first)


@pytest.mark.parametrize(("before", "request_", "response", "ecu"), EXCHANGES.values(), ids=EXCHANGES)
def test_pending_comes_before_the_loop_is_asked_and_only_then(before, request_, response, ecu, tester, world):
    one = tester(**ecu)
    for earlier in before:
        ask(one, earlier)
    first = pending(one.session, bytes.fromhex(request_) if request_ != "key" else b"", one.ecu)
    ask(one, request_)
    assert (first[:1] + first[2:] == b"\x7f\x78" and request_[:2] != "14") == bool(world.works)


@pytest.mark.parametrize(
    ("request_", "works"),
    [
        ("2E 01 18 03 D4 FF FF FF FF 04 4C", ("MEASURED_PADS", {"fl": 9.8, "rr": 11.0})),
        ("31 01 02 01 06", ("NEW_PADS", {"fr": 0.0, "rl": 0.0})),
        ("31 01 02 02", ("FORGET", {})),
    ],
)
def test_what_a_workshop_asks_for_is_done_or_refused_by_the_loop(request_, works, tester, world):
    one = tester()
    for request in UNLOCKED:
        ask(one, request)
    ask(one, request_)
    assert world.works == [works]
    for code in (0x21, 0x22, 0x31, 0x72):
        world.refuses = code
        assert ask(one, request_) == f"7F {request_[:2]} {code:02X}"


def test_a_snapshot_names_its_quantities_as_the_server_counts_them():
    assert len(OF_SNAPSHOT) == 6
    assert sum(2 + length_of(one) for one in OF_SNAPSHOT) == 40


REQUEST = st.one_of(
    st.binary(max_size=12),
    st.builds(
        lambda service, rest: bytes([service]) + rest,
        st.sampled_from(sorted(SERVICES)),
        st.binary(max_size=20),
    ),
    st.builds(
        lambda request, rest: bytes.fromhex(request.replace("key", "27 02")) + rest,
        st.sampled_from([request for _, request, _, _ in EXCHANGES.values()]),
        st.binary(max_size=2),
    ),
)


@given(st.lists(st.tuples(REQUEST, st.booleans(), st.sampled_from([0.0, 0.1, 3.0, 6.0])), max_size=12))
def test_any_bytes_give_a_valid_response_or_none(requests):
    memory, worked = FaultMemory(), []
    ecu = Ecu(
        memory,
        armed=False,
        read=lambda number: b"x" if number & 1 else None,
        clear=lambda number: (memory.clear(number), True)[1],
        clearing_lasts=False,
        self_test=lambda: b"\x00",
        work=lambda kind, values: worked.append((kind, values)),
        can_restart=lambda: True,
        new_seed=lambda: bytes(range(16)),
        secret=SECRET,
    )
    session, now_s = Session(), 0.0
    for request, functional, pause_s in requests:
        now_s += pause_s
        before = len(worked)
        session, response = respond(session, request, ecu, now_s, functional)
        assert len(worked) == before or session.unlocked
        assert is_valid(request, response), (request.hex(" "), response.hex(" "))
        assert session.kind in (1, 3)
        assert not (session.unlocked and session.kind == 1)


def is_valid(request, response):
    """Whether a response is one to this request by the format of ISO 14229-1."""
    if not response:
        return True
    if response[0] == 0x7F:
        return len(response) == 3 and response[1] == request[0] and response[2] in REASONS
    return response[0] == request[0] + 0x40 and len(response) <= 4095


def test_a_confirmed_code_is_gone_once_cleared(tester, world):
    bits = sum(code.fault.bit for code in TROUBLE_CODES)
    for _ in range(20):
        world.memory.add(BUS_OFF | WHEEL_SPEED_LOST, bits, lambda: b"")
    one = tester()
    assert ask(one, "19 02 08") == "59 02 7F 50 00 08 2F 50 10 88 2F"
    assert ask(one, "14 50 10 88") == "54"
    assert ask(one, "19 02 08") == "59 02 7F 50 00 08 2F"
    assert ask(one, "14 FF FF FF") == "54"
    assert not any(entry.status & CONFIRMED for entry in world.memory.entries.values())
