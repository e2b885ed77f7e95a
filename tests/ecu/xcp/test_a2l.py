"""The A2L file: its grammar, and that every address in it is one of the slave."""

import re

import pytest

from ecu.errors import UserError
from ecu.runtime.xcp import parse_transport
from ecu.xcp.a2l import USUAL, a2l, a2l_text
from ecu.xcp.memory import EPK, place_of
from ecu.xcp.slave import OPTIONAL_COMMANDS
from ecu.xcp.variables import RECORDS

TOKEN = re.compile(r'"(?:[^"\\]|\\.)*"|/begin|/end|[^\s"]+')
SIZES = {"FLOAT64_IEEE": 8, "A_INT64": 8, "ULONG": 4, "UBYTE": 1}


def blocks(text):
    """Return the blocks of a file as (name, words and blocks in it); raises where they do not nest."""
    root = ("", [])
    stack, tokens = [root], iter(TOKEN.findall(text))
    for token in tokens:
        if token == "/begin":
            stack.append((next(tokens), []))
            stack[-2][1].append(stack[-1])
        elif token == "/end":
            name, _ = stack.pop()
            assert next(tokens) == name
        else:
            stack[-1][1].append(token)
    assert stack == [root]
    return root


def within(block, name):
    """Return what blocks of a name directly in another one have."""
    return [content for kind, content in (one for one in block if isinstance(one, tuple)) if kind == name]


@pytest.fixture(scope="module")
def module():
    (project,) = within(blocks(a2l_text(USUAL, None))[1], "PROJECT")
    (found,) = within(project, "MODULE")
    return found


def test_every_variable_is_at_its_address_with_its_type_unit_and_limits(module):
    conversions = {one[0]: one for one in within(module, "COMPU_METHOD")}
    measured = {one[0]: one for one in within(module, "MEASUREMENT")}
    given = {one[0]: one for one in within(module, "CHARACTERISTIC")}
    assert len(measured) + len(given) == sum(len(record.variables) for record in RECORDS)
    for record in RECORDS:
        for one in record.variables:
            name = f"{record.name}.{one.name}"
            if record.name == "parameters":
                _, _, kind, address, layout, _, conversion, low, high, *rest = given[name]
                assert ("READ_ONLY" in rest) == (not one.writable)
                assert (kind == "VAL_BLK") == (one.length > 1) == ("MATRIX_DIM" in rest)
            else:
                _, _, layout, conversion, _, _, low, high, keyword, address = measured[name]
                assert keyword == "ECU_ADDRESS"
            assert int(address, 16) == record.base + one.offset
            assert SIZES[layout] == one.kind.itemsize
            assert place_of(int(address, 16), one.length * SIZES[layout]) is not None
            assert (float(low), float(high)) == (one.low, one.high)
            unit = conversions[conversion][4]
            assert unit == ('""' if one.unit == "-" or one.texts else f'"{one.unit}"')


def test_groups_list_every_variable(module):
    for record, group in zip(RECORDS, within(module, "GROUP"), strict=True):
        assert group[0] == record.name
        (listed,) = [content for kind, content in (one for one in group if isinstance(one, tuple))]
        assert listed == [f"{record.name}.{one.name}" for one in record.variables]


def test_words_are_tables_of_the_configuration(module):
    tables = {one[0]: one for one in within(module, "COMPU_VTAB")}
    table = tables["CM.second_order_inverse_off.VTAB"]
    assert table[2:] == ["TAB_VERB", "3", "0", '"second-order"', "1", '"inverse"', "2", '"off"']


def test_names_are_used_once_and_references_lead_somewhere(module):
    kinds = ("COMPU_METHOD", "COMPU_VTAB", "MEASUREMENT", "CHARACTERISTIC", "RECORD_LAYOUT", "GROUP")
    named = [one[0] for kind in kinds for one in within(module, kind)]
    assert len(named) == len(set(named))
    assert all(re.fullmatch(r"[A-Za-z_][\w.]*", name) for name in named), named
    used = {one[6] for one in within(module, "CHARACTERISTIC")}
    used |= {one[3] for one in within(module, "MEASUREMENT")}
    assert used <= {one[0] for one in within(module, "COMPU_METHOD")}


def test_xcp_is_described(module):
    (xcp,) = within(module, "IF_DATA")
    assert xcp[0] == "XCP"
    (layer,) = within(xcp, "PROTOCOL_LAYER")
    assert layer[8:10] == ["248", "1400"]
    assert [one for one in layer[12:] if one != "OPTIONAL_CMD"] == [one.name for one in OPTIONAL_COMMANDS]
    (daq,) = within(xcp, "DAQ")
    assert daq[0] == "DYNAMIC"
    (event,) = within(daq, "EVENT")
    assert event == ['"cycle"', '"cycle"', "0", "DAQ", "255", "10", "6", "0", "CONSISTENCY", "EVENT"]
    for kind in ("XCP_ON_UDP_IP", "XCP_ON_TCP_IP"):
        assert within(xcp, kind) == [["0x0105", "5555", "ADDRESS", '"127.0.0.1"']]


@pytest.mark.parametrize(
    ("transport", "block", "content", "sizes"),
    [
        ("udp:10.0.0.7:1234", "XCP_ON_UDP_IP", ["1234", "ADDRESS", '"10.0.0.7"'], ["248", "1400"]),
        ("can:7A0:7A8", "XCP_ON_CAN", ["CAN_ID_MASTER", "0x7A0", "CAN_ID_SLAVE", "0x7A8"], ["8", "8"]),
        (
            "can:18DA28F1:18DAF128",
            "XCP_ON_CAN",
            ["CAN_ID_MASTER", "0x98DA28F1", "CAN_ID_SLAVE", "0x98DAF128"],
            ["8", "8"],
        ),
    ],
)
def test_a_transport_is_described(transport, block, content, sizes):
    text = a2l_text([parse_transport(transport)], None)
    (project,) = within(blocks(text)[1], "PROJECT")
    (xcp,) = within(within(project, "MODULE")[0], "IF_DATA")
    assert within(xcp, block) == [["0x0105", *content]]
    assert within(xcp, "PROTOCOL_LAYER")[0][8:10] == sizes


def test_of_a_car_only_what_it_gives_is_named(configuration):
    text = a2l_text(USUAL, {**configuration, "name": 'a "car"'})
    assert '/begin PROJECT brake_ecu "a \\"car\\""' in text
    assert "parameters.vehicle.mass" in text
    assert "parameters.control.front_share" not in text
    assert "parameters.front.dust.model" not in text
    every = a2l_text(USUAL, None)
    assert "parameters.control.front_share" in every
    assert {line for line in text.splitlines() if "MEASUREMENT" in line} <= set(every.splitlines())


def test_the_program_is_named(module):
    (parameters,) = within(module, "MOD_PAR")
    assert parameters[:3] == ['""', "EPK", f'"{EPK}"']


def test_the_configuration_is_a_segment_of_two_pages_one_of_them_written(module):
    (segment,) = within(within(module, "MOD_PAR")[0], "MEMORY_SEGMENT")
    parameters = RECORDS[-1]
    assert segment[2:7] == ["DATA", "RAM", "INTERN", "0x40000", f"0x{parameters.dtype.itemsize:X}"]
    (described,) = within(within(segment, "IF_DATA")[0], "SEGMENT")
    assert described[:5] == ["0", "2", "0", "0", "0"]
    assert [page[3] for page in within(described, "PAGE")] == [
        "XCP_WRITE_ACCESS_NOT_ALLOWED",
        "XCP_WRITE_ACCESS_DONT_CARE",
    ]
    (xcp,) = within(module, "IF_DATA")
    assert within(xcp, "PAG") == [["1"]]


def test_the_command_writes_or_prints(tmp_path, capsys):
    a2l(None, ["tcp:5557"], tmp_path / "x.a2l")
    text = (tmp_path / "x.a2l").read_text("utf-8")
    a2l(None, ["tcp:5557"], None)
    assert capsys.readouterr().out == text
    with pytest.raises(UserError, match="--xcp: x: give udp"):
        a2l(None, ["x"], None)


@pytest.mark.study
def test_a_foreign_reader_takes_it(tmp_path):
    """pya2l reads it by a grammar of its own."""
    pya2l = pytest.importorskip("pya2l", reason="pya2ldb is not installed")
    path = tmp_path / "brake_ecu.a2l"
    path.write_text(a2l_text(USUAL, None), encoding="utf-8")
    from pya2l import model

    session = pya2l.import_a2l(str(path), encoding="utf-8", progress_bar=False)
    placed = [(record, one) for record in RECORDS for one in record.variables]
    found = {one.name: one.ecu_address.address for one in session.query(model.Measurement)}
    found |= {one.name: one.address for one in session.query(model.Characteristic)}
    assert found == {f"{record.name}.{one.name}": record.base + one.offset for record, one in placed}
