"""The PDX file, read back by odxtools where it is installed, and as XML everywhere."""

from xml.etree import ElementTree
from zipfile import ZipFile

import pytest

from ecu.cli import main
from ecu.diagnostics.identifiers import MEASURED, PAD_THICKNESS, to_bytes, to_values
from ecu.diagnostics.trouble_codes import TROUBLE_CODES


@pytest.fixture
def file(tmp_path):
    assert main(["pdx", "--out", str(tmp_path / "ecu.pdx")]) == 0
    return tmp_path / "ecu.pdx"


def test_every_reference_leads_to_an_identifier_and_each_is_unique(file):
    with ZipFile(file) as archive:
        assert set(archive.namelist()) == {"index.xml", "brake_ecu.odx-d"}
        document = ElementTree.fromstring(archive.read("brake_ecu.odx-d"))
        listed = ElementTree.fromstring(archive.read("index.xml")).findtext(".//FILE")
    identifiers = [one.get("ID") for one in document.iter() if one.get("ID")]
    assert len(identifiers) == len(set(identifiers))
    assert {one.get("ID-REF") for one in document.iter() if one.get("ID-REF")} <= set(identifiers)
    assert all(name.replace("_", "").isalnum() for name in map(str, texts(document, "SHORT-NAME")))
    assert listed == "brake_ecu.odx-d"


def texts(document, tag):
    return [one.text for one in document.iter(tag)]


def test_a_foreign_reader_codes_and_decodes_as_the_server_does(file):
    odxtools = pytest.importorskip("odxtools")
    ecu = odxtools.load_pdx_file(str(file)).diag_layers["brake_ecu"]
    for one in MEASURED:
        service = getattr(ecu.services, f"read_{one.name}")
        key = b"\x22" + one.number.to_bytes(2, "big")
        assert bytes(service.encode_request()) == key
        data = to_bytes(one, {one.name: [2.0] * (4 if one is PAD_THICKNESS else 1)})
        if len(to_values(one, data)) == len(service.positive_responses[0].parameters) - 2:
            found = list(service.decode_message(b"\x62" + key[1:] + data).param_dict.values())
            assert found[2:] == pytest.approx(to_values(one, data))
    thickness = dict.fromkeys([f"pad_thickness_{corner}" for corner in ("fl", "fr", "rl", "rr")], 9.8)
    assert bytes(ecu.services.write_pad_thickness.encode_request(**thickness)).hex() == "2e0118" + "03d4" * 4
    assert bytes(ecu.services.start_new_pads.encode_request(corners=3)).hex() == "3101020103"
    answer = bytes.fromhex("59027F5000082F5010882F")
    faults = ecu.services.read_faults.decode_message(answer).param_dict["faults"]
    assert [one["code"].display_trouble_code for one in faults] == ["C1000-08", "C1010-88"]
    assert len(ecu.diag_data_dictionary_spec.dtc_dops[0].dtcs) == len(TROUBLE_CODES)
