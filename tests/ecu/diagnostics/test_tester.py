"""The small tester against the services: what it prints, its exit codes, one line for what goes wrong."""

import json

import can
import numpy as np
import pytest

from ecu import cli
from ecu.contract.faults import WHEEL_SPEED_LOST
from ecu.diagnostics import tester as tester_module
from ecu.diagnostics.identifiers import BY_NAME, BY_NUMBER, PAD_THICKNESS, TEXTS, snapshot, to_bytes
from ecu.diagnostics.transport import Request
from ecu.diagnostics.trouble_codes import TROUBLE_CODES
from ecu.recording.ring import RECORDED

from .conftest import SECRET


class Wire:
    """A `Link` whose other end answers at once, by a function of the request; `hears` what it is said to."""

    def __init__(self, answer):
        self.answer, self.is_busy, self.asked, self.waiting = answer, False, [], []

    def send(self, data):
        self.asked.append(data.hex(" ").upper())
        self.waiting += self.answer(data)

    def turn(self, timeout_s):
        pass

    def next(self):
        return Request(self.waiting.pop(0), False) if self.waiting else None

    def close(self):
        pass


@pytest.fixture
def diag(monkeypatch, capsys):
    """Run `brake-ecu diag` with an ECU that answers by a function; return code, output, errors."""

    def run(words, answer):
        monkeypatch.setattr(tester_module, "Link", lambda *_: Wire(answer))
        clock = iter(range(1000))
        real = tester_module.Tester
        monkeypatch.setattr(
            tester_module, "Tester", lambda link, ids: real(link, ids, now_s=lambda: 0.2 * next(clock))
        )
        code = cli.main(["diag", *words.split(), "-i", "virtual", "-c", "x"])
        monkeypatch.setattr(tester_module, "Tester", real)
        return code, *capsys.readouterr()

    return run


@pytest.fixture
def ecu(tester, world):
    """An ECU with a fault that was there twice and is gone."""
    record = np.zeros(1, RECORDED)
    record["cycle"]["t_ns"] = 1_700_000_000_000_000_000
    record["outputs"]["vehicle_speed"], record["outputs"]["mu_b"] = 20.0, 0.4
    bits = sum(code.fault.bit for code in TROUBLE_CODES)
    for speed in (20.0, 10.0):
        record["outputs"]["vehicle_speed"] = speed
        for failed in (WHEEL_SPEED_LOST, 0):
            for _ in range(120):
                world.memory.add(failed, bits, lambda: snapshot(record))
    values = {one.name: np.full(4 if one.name == "mu_b" else 1, 0.4) for one in BY_NAME.values()}
    world.read = {
        number: to_bytes(one, values) for number, one in BY_NUMBER.items() if one.name in ("mu_b", "speaks")
    }
    world.read |= {number: text.encode() for number, text in TEXTS.items()}
    one = tester()
    return lambda request: [bytes.fromhex(one.ask(request.hex()))]


def test_faults_with_their_snapshots(diag, ecu):
    code, out, _ = diag("faults", ecu)
    assert code == 1
    assert out.splitlines() == [
        "C1000-08  wheel speed lost: not active now",
        "  2 times, ageing 0 of 40 starts; check the sender of WheelSpeed*",
        "  first: 2023-11-14T22:13:20Z, vehicle_speed 20 m/s, decel_demand_total 0 m/s^2, mode 0,"
        " calliper_pressure 0/0/0/0 bar, mu_b 0.4/0.4/0.4/0.4",
        "  last: 2023-11-14T22:13:20Z, vehicle_speed 10 m/s, decel_demand_total 0 m/s^2, mode 0,"
        " calliper_pressure 0/0/0/0 bar, mu_b 0.4/0.4/0.4/0.4",
    ]
    found = json.loads(diag("faults --json", ecu)[1])["faults"]
    assert [(fault["code"], fault["occurrences"], fault["active"]) for fault in found] == [
        ("C1000-08", 2, False)
    ]
    assert found[0]["first"]["vehicle_speed"] == [20.0]


def test_clearing_one_and_all(diag, ecu):
    assert diag("clear C1010-88 c1001-08", ecu) == (0, "cleared: C1010-88, C1001-08\n", "")
    assert diag("faults", ecu)[0] == 1
    assert diag("clear 500108", ecu) == (0, "cleared: C1001-08\n", ""), (
        "its bytes, as docs/diagnostics.md lists them"
    )
    assert diag("clear", ecu) == (0, "cleared: all\n", "")
    assert diag("faults", ecu) == (0, "no confirmed fault\n", "")


@pytest.mark.parametrize(
    ("words", "out"),
    [
        ("read mu_b", "mu_b 0.4/0.4/0.4/0.4\n"),
        ("read 0x0110", "mu_b 0.4/0.4/0.4/0.4\n"),
        ("read 123 vehicle", "speaks 0\nvehicle vehicle\n"),
        ("read F186", "0xF186 01\n"),
        ("info", "software software\nsystem system\nconfiguration configuration\nvehicle vehicle\n"),
    ],
)
def test_reading(words, out, diag, ecu):
    assert diag(words, ecu) == (0, out, "")


@pytest.fixture
def key(tmp_path):
    """A file with the secret of the ECU of the tests."""
    path = tmp_path / "key"
    path.write_text(SECRET.hex())
    path.chmod(0o600)
    return path


@pytest.mark.parametrize(
    ("words", "done"),
    [
        ("new-pads front rl", ("NEW_PADS", {"fl": 0.0, "fr": 0.0, "rl": 0.0})),
        ("new-pads all", ("NEW_PADS", dict.fromkeys(("fl", "fr", "rl", "rr"), 0.0))),
        ("measured fl=9.8 rr=7.25", ("MEASURED_PADS", {"fl": 9.8, "rr": 7.25})),
        ("measured fl=9.8,rr=7.25", ("MEASURED_PADS", {"fl": 9.8, "rr": 7.25})),
        ("forget", ("FORGET", {})),
    ],
)
def test_work_of_a_workshop(words, done, diag, tester, world, key):
    world.read = {PAD_THICKNESS.number: b"\x03\xd4" * 4}
    one = tester()
    code, out, errors = diag(f"{words} --key {key}", lambda request: [bytes.fromhex(one.ask(request.hex()))])
    assert (code, errors, world.works) == (0, "", [done])
    pads = "" if words == "forget" else "pad_thickness 9.8/9.8/9.8/9.8 mm\n"
    assert out == f"done and stored: {words.split()[0]}\n{pads}"
    assert (one.session.kind, one.session.unlocked) == (1, False)


@pytest.mark.parametrize(
    ("fields", "refuses", "says"),
    [
        ({"secret": b""}, None, "0x27 refused: conditionsNotCorrect: the ECU has no key"),
        ({"secret": bytes(16)}, None, "0x27 refused: invalidKey: --key is another file"),
        ({}, 0x22, "0x31 refused: conditionsNotCorrect: stop, release the brake"),
        ({}, 0x21, "0x31 refused: busyRepeatRequest: another change"),
        ({}, 0x72, "0x31 refused: generalProgrammingFailure: done, but not stored"),
    ],
)
def test_work_that_is_refused(fields, refuses, says, diag, tester, world, key):
    world.refuses = refuses
    one = tester(**fields)
    code, out, errors = diag(f"forget --key {key}", lambda request: [bytes.fromhex(one.ask(request.hex()))])
    assert (code, out, world.works) == (1, "", [])
    assert says in errors
    assert errors.count("\n") == 1
    assert one.session.kind == 1


def test_an_ecu_of_another_program_is_read_as_far_as_it_is_known(diag):
    answers = {
        "19 02 08": b"\x59\x02\xff\xc1\x00\x87\x09",
        "19 06 C1 00 87 FF": b"\x59\x06\xc1\x00\x87\x09",
        "19 04 C1 00 87 01": b"\x59\x04\xc1\x00\x87\x09\x01\x01\xab\xcd\x00",
        "19 04 C1 00 87 02": b"\x59\x04\xc1\x00\x87\x09",
    }
    code, out, _ = diag("faults", lambda request: [answers[request.hex(" ").upper()]])
    assert code == 1
    assert out.splitlines()[0] == "U0100-87  not known to this program: active"


def refused_by_the_bus(request):
    raise can.CanOperationError("network is down")


@pytest.mark.parametrize(
    ("words", "answer", "code", "says"),
    [
        ("clear", lambda request: [], 1, "no answer within 1 s on 0x7E8 to a request on 0x7E0"),
        ("clear", lambda request: [b"\x7f\x14\x78"], 1, "no answer within 5 s"),
        ("clear", lambda request: [b"\x7f\x14\x78", b"\x54"], 0, ""),
        ("clear", lambda request: [b"\x62\x01", b"", b"\x54"], 0, ""),  # another's answer
        ("clear", lambda request: [b"\x7f\x14\x22"], 1, "service 0x14 refused: conditionsNotCorrect"),
        ("clear", lambda request: [b"\x7f\x14\xf0"], 1, "service 0x14 refused: 0xF0"),
        ("clear", refused_by_the_bus, 1, "the bus failed: network is down"),
        ("read mu_b", lambda request: [b"\x62\x99\x99\x00"], 1, "asked for 0x0110, the answer is of another"),
        ("forgot", None, 2, "not known; take faults, clear, read, info, new-pads, measured, forget; did you"),
        ("forget", None, 2, "diag: forget: give --key FILE, that of --diagnostics-key"),
        ("forget fl --key x", None, 2, "diag: fl: forget takes no name"),
        ("faults --key x", None, 2, "diag: --key: is for new-pads, measured, forget; leave it out"),
        ("new-pads --key x", None, 2, "diag new-pads: name front, rear, all, fl, fr, rl, rr"),
        ("new-pads frnt --key x", None, 2, "did you mean front?"),
        ("measured --key x", None, 2, "diag measured: give corner=mm, corners fl, fr, rl, rr"),
        ("measured fl=thin --key x", None, 2, "diag measured: fl=thin: give corner=mm"),
        ("forget --key /nowhere/key", None, 2, "/nowhere/key: cannot be read: No such file or directory"),
        ("fault", None, 2, "did you mean faults?"),
        ("faults mu_b", None, 2, "diag: mu_b: faults takes no name"),
        ("read mu_q", None, 2, "diag read: mu_q: give a name or a number such as 0x0110; did you mean mu_b?"),
        ("read 0x12345", None, 2, "give a name or a number"),
        ("clear C1FFF-08", None, 2, "diag clear: C1FFF-08: no trouble code of this ECU"),
        ("clear --ids 7E0", None, 2, "--ids: 7E0: give the identifiers of request and response"),
    ],
)  # fmt: skip
def test_what_goes_wrong_is_one_line(words, answer, code, says, diag):
    found, _, errors = diag(words, answer)
    assert found == code
    assert says in errors
    assert errors.count("\n") == (1 if says else 0)
