import itertools
import math
import multiprocessing
import random
import resource
import sqlite3
from contextlib import closing, contextmanager, suppress
from multiprocessing.connection import Connection
from pathlib import Path

import numpy as np
import pytest
from structlog.testing import capture_logs

from ecu.algorithm.estimation.joint.whole_filter import HIGHEST_STATE, LOWEST_STATE
from ecu.contract.records import DUST, LEARNED, N_KEPT, N_MEASURED, WEAR, new_record
from ecu.errors import UserError
from ecu.recording import revisions
from ecu.recording.revisions import REVISIONS_KEPT
from ecu.recording.store import (
    FILE,
    alone,
    first_keeper,
    in_use,
    is_due,
    open_store,
    open_to_read,
    restore,
    restore_part,
    save,
)

NOMINAL = np.full(4, 0.45)
KEY = "suv/1234/1"


def triangle(matrix) -> np.ndarray:
    return matrix[np.tril_indices(N_KEPT)]


NEGATIVE, TIED_TOO_MUCH, NOT_FINITE = (0.01 * np.eye(N_KEPT) for _ in range(3))
NEGATIVE[3, 3] = -1e-4
TIED_TOO_MUCH[5, 4] = 0.011
NOT_FINITE[7, 2] = np.nan


def learned(brakings: int = 1, **values: object):
    record = new_record(LEARNED)
    record["mu_b"], record["sigma_mu_b"], record["observed_s"] = 0.40, 0.03, 5.0
    record["radius_sigma"], record["brakings"] = 0.002, brakings
    record["joint_known"], record["joint_covariance"] = 1, triangle(0.01 * np.eye(N_KEPT))
    for name, value in values.items():
        record[name] = value
    return record


def test_what_was_saved_comes_back_bit_by_bit(tmp_path):
    store = open_store(tmp_path)
    record = learned(mu_b=[[0.38, 0.41, 0.5, 0.3]])
    save(store, KEY, record)
    store.close()
    revision, found = restore(open_store(tmp_path), KEY, NOMINAL)
    assert (revision, found.tobytes()) == (1, record.tobytes())


@pytest.mark.parametrize(
    ("key", "events"),
    [("suv/1234/2", ["learned_by_another_version"]), ("suv/5678/1", []), ("van/1234/1", [])],
    ids=["version", "brakes", "vehicle"],
)
@pytest.mark.requirement("REQ-KEEP-3")
def test_another_vehicle_or_version_knows_nothing_of_it(tmp_path, key, events):
    store = open_store(tmp_path)
    save(store, KEY, learned())
    with capture_logs() as lines:
        assert restore(store, key, NOMINAL) is None
    assert [line["event"] for line in lines] == events
    assert restore(store, KEY, NOMINAL) is not None


# what a later version may have done to the file -> whether its values are used
LATER = {
    "a column more": (["ALTER TABLE learned ADD COLUMN extra"], True),
    "one with a default": (["ALTER TABLE learned ADD COLUMN extra INTEGER NOT NULL DEFAULT 3"], True),
    "an index": (["CREATE INDEX i ON learned (saved_at)"], True),
    "another table": (["CREATE TABLE more (a)"], True),
    "a view": (["CREATE VIEW latest AS SELECT * FROM learned"], True),
    "its number alone": (["PRAGMA user_version = 2"], True),
    "all of it": (
        [
            "PRAGMA user_version = 7",
            "ALTER TABLE learned ADD COLUMN extra",
            "CREATE INDEX i ON learned (saved_at)",
        ],
        True,
    ),
    "a trigger": (
        [
            "PRAGMA user_version = 2",
            "CREATE TRIGGER t AFTER INSERT ON learned BEGIN DELETE FROM learned; END",
        ],
        False,
    ),
    "another name": (["PRAGMA user_version = 2", "ALTER TABLE learned RENAME TO taught"], False),
    "a column without which no row is": (
        ["PRAGMA user_version = 2", "ALTER TABLE learned RENAME COLUMN crc TO sum"],
        False,
    ),
}


@pytest.mark.parametrize(("changes", "used"), LATER.values(), ids=LATER)
def test_a_store_of_a_later_version_is_used_or_left_alone_and_never_set_aside(tmp_path, changes, used):
    with closing(open_store(tmp_path)) as store:
        save(store, KEY, learned(7))
    with closing(sqlite3.connect(tmp_path / FILE)) as later:
        for change in changes:
            later.execute(change)
        version = later.execute("PRAGMA user_version").fetchone()
    content = (tmp_path / FILE).read_bytes()
    with capture_logs() as lines:
        if used:
            with closing(open_store(tmp_path)) as store:
                assert restore(store, KEY, NOMINAL)[1]["brakings"][0] == 7
                assert save(store, KEY, learned(8)) == 2
                assert store.execute("PRAGMA user_version").fetchone() == version
        else:
            with pytest.raises(UserError, match="a later version wrote it"):
                open_store(tmp_path)
            assert (tmp_path / FILE).read_bytes() == content
    assert lines == []
    assert not list(tmp_path.glob("*.damaged-*"))


@contextmanager
def files_of_at_most(size: int):
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@pytest.mark.parametrize("size", [0, 4096, 24_576])
def test_a_good_store_that_cannot_be_written_is_not_set_aside(tmp_path, size):
    """The limit stands for a full disk: sqlite's shared memory of 32 kB is the first that has no room."""
    with closing(open_store(tmp_path)) as store:
        save(store, KEY, learned(7))
    with files_of_at_most(size), capture_logs() as lines, pytest.raises(UserError, match="cannot be opened"):
        open_store(tmp_path)
    assert lines == []
    assert [file.name for file in tmp_path.glob("*.damaged-*")] == []
    with closing(open_store(tmp_path)) as store:
        assert restore(store, KEY, NOMINAL)[1]["brakings"][0] == 7


def test_what_was_saved_is_read_where_nothing_can_be_written(tmp_path, monkeypatch):
    """With its write-ahead log: the last daemon was killed."""
    store = open_store(tmp_path)
    save(store, KEY, learned(7))
    assert (tmp_path / f"{FILE}-wal").stat().st_size > 0
    connect = revisions._connect

    def no_room(path):
        if path.parent == tmp_path:
            error = sqlite3.OperationalError("disk I/O error")
            error.sqlite_errorcode = sqlite3.SQLITE_IOERR_SHMSIZE
            raise error
        return connect(path)

    monkeypatch.setattr(revisions, "_connect", no_room)
    with open_to_read(tmp_path) as copy:
        assert restore(copy, KEY, NOMINAL)[1]["brakings"][0] == 7
    (tmp_path / FILE).unlink()
    with pytest.raises(UserError, match="disk I/O error"), open_to_read(tmp_path):
        pass


@pytest.mark.parametrize("columns", ["key TEXT, value BLOB", "revision INTEGER"])
def test_a_file_with_another_table_is_set_aside(tmp_path, columns):
    with closing(sqlite3.connect(tmp_path / FILE)) as other:
        other.execute(f"CREATE TABLE learned ({columns})")
    with capture_logs() as lines:
        store = open_store(tmp_path)
    assert [line["event"] for line in lines] == ["store_damaged"]
    save(store, KEY, learned(9))
    assert restore(store, KEY, NOMINAL)[1]["brakings"][0] == 9


def test_the_last_revisions_are_kept(tmp_path):
    store = open_store(tmp_path)
    for brakings in range(REVISIONS_KEPT + 5):
        save(store, KEY, learned(brakings))
    kept = [row[0] for row in store.execute("SELECT revision FROM learned WHERE key = ? ORDER BY 1", (KEY,))]
    assert kept == list(range(6, REVISIONS_KEPT + 6))


def wear(**values: object):
    record = new_record(WEAR)
    record["odometer"] = 5e6
    for name, value in values.items():
        record[name] = value
    return record


OUT_OF_RANGE = {
    "wear that shrank below nothing": {"wear": wear(regressors=-1.0)},
    "wear is no number": {"wear": wear(temperature_error=np.nan)},
    "odometer that runs backwards": {"wear": wear(odometer=-1.0)},
    "pads from the future": {"wear": wear(fitted_at=6e6)},
    "more measurements than there is room": {"wear": wear(measurements=N_MEASURED + 1)},
    "a measurement without doubt": {"wear": wear(measurements=1, measured_sigma=0.0)},
    "friction below half of nominal": {"mu_b": 0.22},
    "friction above one and a half": {"mu_b": 0.68},
    "friction is no number": {"mu_b": np.nan},
    "deviation of zero": {"sigma_mu_b": 0.0},
    "infinite deviation": {"sigma_mu_b": np.inf},
    "radius off by 4 %": {"radius_error": [[0, 0, 0, -0.04]]},
    "radius is no number": {"radius_error": np.nan},
    "negative time": {"observed_s": -1.0},
    "negative count": {"brakings": -1},
    "drag that no car has": {"whole": [[0.0, 0.0, 2.6, 0.0, 0.0, 0.2]]},
    "motors that drive while they blend": {"whole": [[0.0, 0.0, 0.2, -0.1, 0.0, 0.2]]},
    "negative variance": {"joint_covariance": triangle(NEGATIVE)},
    "correlation above one": {"joint_covariance": triangle(TIED_TOO_MUCH)},
    "covariance is no number": {"joint_covariance": triangle(NOT_FINITE)},
}


@pytest.mark.parametrize("wrong", OUT_OF_RANGE.values(), ids=OUT_OF_RANGE)
@pytest.mark.requirement("REQ-KEEP-3")
def test_a_value_that_cannot_be_falls_back_to_the_revision_before(tmp_path, wrong):
    store = open_store(tmp_path)
    save(store, KEY, learned(7))
    save(store, KEY, learned(**{"brakings": 8, **wrong}))
    revision, found = restore(store, KEY, NOMINAL)
    assert (revision, found["brakings"][0]) == (1, 7)


@pytest.mark.parametrize("bound", [LOWEST_STATE, HIGHEST_STATE])
def test_what_whole_applications_have_learned_comes_back_at_its_bounds(tmp_path, bound):
    store = open_store(tmp_path)
    save(store, KEY, learned(whole=bound))
    assert restore(store, KEY, NOMINAL) is not None


def test_a_corner_that_was_never_observed_needs_no_friction(tmp_path):
    store = open_store(tmp_path)
    save(store, KEY, learned(mu_b=[[0.4, 0.4, 0, 0]], sigma_mu_b=[[1, 1, 0, 0]], observed_s=[[1, 1, 0, 0]]))
    assert restore(store, KEY, NOMINAL) is not None


@pytest.mark.parametrize(
    "damage",
    [
        "UPDATE learned SET crc = crc + 1 WHERE revision = 2",
        "UPDATE learned SET record = zeroblob(length(record)) WHERE revision = 2",
        "UPDATE learned SET record = x'00' WHERE revision = 2",
        "UPDATE learned SET revision = 3 WHERE revision = 2",
    ],
    ids=["CRC", "content", "length", "number"],
)
@pytest.mark.requirement("REQ-KEEP-2")
def test_a_damaged_row_falls_back_to_the_revision_before(tmp_path, damage):
    store = open_store(tmp_path)
    save(store, KEY, learned(7))
    save(store, KEY, learned(8))
    store.execute(f"{damage} AND key = '{KEY}'")
    with capture_logs() as lines:
        revision, found = restore(store, KEY, NOMINAL)
    assert (revision, found["brakings"][0]) == (1, 7)
    assert [line["event"] for line in lines] == ["revision_refused"]


@pytest.mark.parametrize("content", [b"", b"no database at all" * 100, None], ids=["empty", "text", "torn"])
def test_a_damaged_file_is_set_aside_and_a_new_one_made(tmp_path, content):
    path = tmp_path / FILE
    store = open_store(tmp_path)
    for brakings in range(100):
        save(store, f"{KEY}{brakings}", learned())
    store.close()
    torn = path.read_bytes()
    path.write_bytes(torn[: len(torn) // 2] if content is None else content)
    with capture_logs() as lines:
        store = open_store(tmp_path)
    save(store, KEY, learned(9))
    assert restore(store, KEY, NOMINAL)[1]["brakings"][0] == 9
    if content != b"":  # an empty file is a new database
        assert [line["event"] for line in lines] == ["store_damaged"]
        assert len(list(tmp_path.glob("*.damaged-*"))) == 1


def test_a_folder_that_cannot_be_made_is_one_line(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(UserError, match="cannot be opened"):
        open_store(tmp_path / "file")


# changes of the record [s later] -> whether it is due
DUE = {
    "nothing changed": ({}, 3600, False),
    "a braking ended": ({"brakings": 2}, 0, True),
    "a radius was learned, at once": ({"radius_error": 0.001}, 59, False),
    "a radius was learned, a minute ago": ({"radius_error": 0.001}, 60, True),
}


@pytest.mark.parametrize(("change", "later_s", "due"), DUE.values(), ids=DUE)
def test_it_is_saved_after_each_braking_and_at_most_every_minute(change, later_s, due):
    keeper = first_keeper(learned(1), 100.0)
    assert is_due(keeper, learned(**{"brakings": 1, **change}), 100.0 + later_s) is due


def test_wear_outlives_a_new_version_and_another_configuration_of_the_brakes(tmp_path):
    store = open_store(tmp_path)
    save(store, KEY, learned(wear=wear(regressors=3.0)))
    assert restore(store, "suv/9999/2", NOMINAL) is None
    assert restore_part(store, "suv/9999/2", "wear")["regressors"].min() == 3.0
    assert restore_part(store, "van/1234/1", "wear") is None


def test_wear_goes_on_from_where_the_car_is_and_not_from_where_these_brakes_were_last(tmp_path):
    store = open_store(tmp_path)
    save(store, KEY, learned(7, wear=wear(odometer=1e6, regressors=1.0)))
    save(store, "suv/9999/1", learned(8, wear=wear(odometer=2e6, regressors=2.0)))
    _, found = restore(store, KEY, NOMINAL)
    assert (found["brakings"][0], found["wear"]["regressors"][0, 0, 0]) == (7, 2.0)


def test_a_damaged_row_of_wear_leaves_that_of_the_whole_record(tmp_path):
    store = open_store(tmp_path)
    save(store, KEY, learned(7, wear=wear(odometer=1e6, regressors=1.0)))
    save(store, KEY, learned(8, wear=wear(odometer=2e6, regressors=2.0)))
    store.execute("UPDATE learned SET crc = crc + 1 WHERE revision = 2 AND key LIKE '%/wear/%'")
    with capture_logs():
        assert restore(store, KEY, NOMINAL)[1]["wear"]["regressors"].max() == 2.0


def dust(**values: float) -> np.ndarray:
    record = np.zeros(1, DUST)
    for name, value in values.items():
        record[name] = value
    return record


def test_dust_outlives_a_new_version_too(tmp_path):
    store = open_store(tmp_path)
    save(store, KEY, learned(dust=dust(way=5e6, particles=1e13, version=7)))
    found = restore_part(store, "suv/9999/2", "dust")
    assert (found["particles"][0], found["version"][0]) == (1e13, 7)


CANNOT_BE = {"way": -1.0, "particles": math.nan, "told_work": -1.0, "applications": -1}


@pytest.mark.parametrize(("name", "value"), CANNOT_BE.items(), ids=CANNOT_BE)
def test_dust_that_cannot_be_is_refused(tmp_path, name, value):
    store = open_store(tmp_path)
    save(store, KEY, learned(7, dust=dust(way=1e6)))
    save(store, KEY, learned(8, dust=dust(**{"way": 2e6, name: value})))
    with capture_logs() as lines:
        _, found = restore(store, KEY, NOMINAL)
    assert (found["brakings"][0], found["dust"]["way"][0]) == (7, 1e6)
    assert lines[0]["reason"] == name


def test_nobody_changes_it_by_hand_while_a_daemon_keeps_it(tmp_path):
    with in_use(tmp_path), in_use(tmp_path), pytest.raises(UserError, match="stop it first"), alone(tmp_path):
        pass
    with alone(tmp_path):
        pass


def write_until_killed(folder: Path, first: int, saved: Connection) -> None:
    """Save one revision after the other and say which are saved."""
    store = open_store(folder)
    for brakings in itertools.count(first):
        save(store, KEY, learned(brakings))
        saved.send(brakings)


@pytest.mark.requirement("REQ-KEEP-1")
def test_killed_at_fifty_instants_it_opens_and_has_lost_nothing_that_was_saved(tmp_path):
    processes = multiprocessing.get_context("forkserver")
    processes.set_forkserver_preload([__name__])
    draw = random.Random(20)
    kept = 0
    for _ in range(50):
        saved, said = processes.Pipe(duplex=False)
        writer = processes.Process(target=write_until_killed, args=(tmp_path, kept + 1, said))
        writer.start()
        said.close()
        for _ in range(draw.randint(1, 20)):  # killed in the middle of whatever follows this line
            reported = saved.recv()
        for _ in range(draw.randint(0, 20_000)):
            pass
        writer.kill()
        with suppress(EOFError):
            while True:
                reported = saved.recv()
        writer.join()
        with capture_logs() as lines:
            store = open_store(tmp_path)
        kept = int(restore(store, KEY, NOMINAL)[1]["brakings"][0])
        store.close()
        assert lines == []
        assert kept in (reported, reported + 1)


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> bytes:
    """A store's file of two revisions, as sqlite leaves it."""
    folder = tmp_path_factory.mktemp("whole")
    with closing(open_store(folder)) as store:
        save(store, KEY, learned(7))
        save(store, KEY, learned(8))
    return (folder / FILE).read_bytes()


def look_at(folder: Path, content: bytes) -> tuple[int | None, list[str]]:
    """Open a store of that content as the daemon does; return the brakings restored and the lines said."""
    for file in folder.glob(f"{FILE}*"):
        file.unlink()
    (folder / FILE).write_bytes(content)
    with capture_logs() as lines, closing(open_store(folder)) as store:
        found = restore(store, KEY, NOMINAL)
        save(store, KEY, learned(9) if found is None else found[1])
    good = {learned(brakings).tobytes() for brakings in (7, 8)}
    assert found is None or found[1].tobytes() in good
    return None if found is None else int(found[1]["brakings"][0]), [line["event"] for line in lines]


@pytest.mark.requirement("REQ-KEEP-2")
def test_a_single_damaged_byte_costs_one_line_at_most_and_gives_no_wrong_value(whole, tmp_path):
    """The header, every third byte of the schema, and a sample of all (the whole file was tried once)."""
    draw = random.Random(12)
    schema = whole.index(b"CREATE TABLE")
    page = int.from_bytes(whole[16:18], "big")
    places = {*range(100), *range(schema - 60, page, 3), *draw.sample(range(len(whole)), 300)}
    outcomes = []
    for place in sorted(places):
        damaged = bytearray(whole)
        damaged[place] ^= 1 << draw.randrange(8) if place % 2 else 0x8D
        brakings, lines = look_at(tmp_path, bytes(damaged))
        assert brakings is not None or lines, place
        assert len([line for line in lines if line == "store_damaged"]) <= 1
        assert len(lines) <= 2, (place, lines)
        outcomes.append((brakings, tuple(lines)))
    assert len(set(outcomes)) >= 3  # whole, the revision before, set aside


@pytest.mark.requirement("REQ-SEC-1")
def test_the_folder_is_its_owner_s_alone(tmp_path):
    open_store(tmp_path / "state").close()
    assert (tmp_path / "state").stat().st_mode & 0o777 == 0o700
