"""A result as MCAP, read back by mcap's own reader, against the Parquet of the same replay."""

import json
import sys
from collections import defaultdict
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader

from brakelab.replay.command import replay
from brakelab.results.files import ResultWriter, read_result
from ecu.errors import UserError
from ecu.settings.config import load_config, new_params

ROOT = Path(__file__).parents[3]
LOG = ROOT / "tests/data/mustang.log"  # two seconds, a braking
CONFIG, MAP = ROOT / "config/mustang.toml", ROOT / "config/maps/mustang.toml"


@pytest.fixture(scope="module")
def both(tmp_path_factory):
    """The same replay as MCAP, by topic, and as Parquet."""
    folder = tmp_path_factory.mktemp("results")
    for name in ("drive.parquet", "drive.mcap"):
        replay([LOG], CONFIG, MAP, None, None, folder / name)
    assert {path.name for path in folder.iterdir()} == {"drive.parquet", "drive.brakes.parquet", "drive.mcap"}
    topics, schemas = defaultdict(list), {}
    with (folder / "drive.mcap").open("rb") as stream:
        reader = make_reader(stream)
        metadata = {record.name: record.metadata for record in reader.iter_metadata()}
        for schema, channel, message in reader.iter_messages():
            assert (schema.encoding, channel.message_encoding) == ("jsonschema", "json")
            schemas[channel.topic] = json.loads(schema.data)
            topics[channel.topic].append((message.log_time, json.loads(message.data)))
    return topics, schemas, metadata, read_result(folder / "drive.parquet"), folder


def test_rows_are_those_of_the_parquet_file(both):
    topics, _, _, parquet, _ = both
    start_ns = int(parquet.metadata["start_time_ns"])
    expected_ns = start_ns + np.rint(parquet.columns["t"] * 1e9).astype(np.int64)
    for topic, name, column in (
        ("/ecu", "vehicle_speed", "vehicle_speed"),
        ("/corner/fl", "mu_b", "mu_b_fl"),
        ("/corner/fl", "mode", "mode_fl"),
        ("/corner/rr", "disc_temperature", "disc_temperature_rr"),
    ):
        assert [time_ns for time_ns, _ in topics[topic]] == expected_ns.tolist()
        values = [content.get(name, np.nan) for _, content in topics[topic]]
        np.testing.assert_array_equal(values, parquet.columns[column], column)


def test_no_column_is_lost_and_each_has_its_unit(both):
    topics, schemas, _, parquet, _ = both
    units = {("/ecu", "t"): "s"}
    for topic, schema in schemas.items():
        for name, about in schema["properties"].items():
            units[topic, name] = about["description"]
    for column, unit in parquet.units.items():
        corner = column[-2:] if column[-3:] in ("_fl", "_fr", "_rl", "_rr") else ""
        place = (f"/corner/{corner}", column[:-3]) if corner else ("/ecu", column)
        assert units[place] == unit, column
    for topic, messages in topics.items():
        allowed = schemas[topic]["properties"]
        kinds = {"number": (int, float), "integer": int, "string": str, "boolean": bool}
        for _, content in messages[::50]:
            assert all(isinstance(value, kinds[allowed[name]["type"]]) for name, value in content.items())


def test_frames_are_those_of_the_log(both):
    topics, _, _, _, _ = both
    lines = [line.split() for line in LOG.read_text().splitlines()]
    frames = topics["/frames"]
    assert len(frames) == len(lines)
    for (time_ns, frame), (stamp, bus, text) in list(zip(frames, lines, strict=True))[::97]:
        identifier, _, data = text.partition("#")
        assert (frame["id"], frame["data"], frame["bus"]) == (int(identifier, 16), data.lower(), bus)
        assert time_ns == pytest.approx(float(stamp[1:-1]) * 1e9, abs=1000)
        assert (frame["length"], frame["extended"], frame["fd"]) == (
            len(data) // 2,
            len(identifier) > 3,
            False,
        )


def test_all_topics_are_in_order_of_time(both):
    for messages in both[0].values():
        times = [time_ns for time_ns, _ in messages]
        assert times == sorted(times)


def test_provenance(both):
    _, _, metadata, parquet, _ = both
    about = metadata["brake-ecu"]
    assert about["vehicle"] == parquet.metadata["vehicle"]
    assert json.loads(about["inputs"])[0]["name"] == "mustang.log"
    assert "quality" in about


def test_two_logs_are_one_drive(tmp_path):
    replay([LOG, LOG], CONFIG, MAP, None, None, tmp_path / "two.mcap")
    with (tmp_path / "two.mcap").open("rb") as stream:
        times = [m.log_time for _, _, m in make_reader(stream).iter_messages(topics=["/frames"])]
        stream.seek(0)
        rows = [m.log_time for _, _, m in make_reader(stream).iter_messages(topics=["/ecu"])]
    half = len(times) // 2
    first, second = np.array(times[:half]), np.array(times[half:])
    assert set(second - first) == {rows[len(rows) // 2] - rows[0]}


def test_it_is_not_read_here(both):
    with pytest.raises(UserError, match=r"results are read from Parquet"):
        read_result(both[4] / "drive.mcap")


def test_without_mcap(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "mcap.writer", None)
    params = new_params(load_config(CONFIG))
    with pytest.raises(UserError, match=r"drive\.mcap: MCAP needs mcap: pip install mcap$"):
        ResultWriter(tmp_path / "drive.mcap", params)
