"""A Dask scheduler: which addresses are taken, and drives through a cluster of this process."""

from collections.abc import Iterator

import dask
import pytest
from distributed import KilledWorker, LocalCluster

from brakelab.fleet import cluster
from brakelab.fleet.cluster import connect
from ecu.errors import UserError


@pytest.fixture(scope="module")
def scheduler() -> Iterator[str]:
    with LocalCluster(
        n_workers=1, threads_per_worker=2, processes=False, dashboard_address=None, protocol="tcp"
    ) as one:
        yield one.scheduler_address


def test_a_scheduler_s_workers_run_tasks_and_say_how_many(scheduler: str) -> None:
    with connect(scheduler, None) as workers:
        assert [workers.executor.submit(pow, 2, k).result() for k in (3, 3)] == [8, 8]
        assert workers.room() == 4
        assert isinstance(workers.executor.submit(int, "x").exception(), ValueError)
        assert workers.died is KilledWorker


def test_workers_of_another_version_are_one_line(scheduler: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster, "__version__", "9.9")
    monkeypatch.setattr(cluster, "_version", lambda: "0.0")
    with pytest.raises(UserError, match=r"cannot run brake-ecu 9\.9 \(version 0\.0\)"), connect(scheduler, 1):
        pass


OPEN = [
    *("tcp://head:8786", "head:8786", "tcp://192.0.2.1:8786", "ws://head:8786", "tcp://127.0.0.1.example:1"),
    *("tcp://user@head:8786", "localhost@head:8786", "tcp://", "[::2]:8786", "tcp://[", "tlsx://head:8786"),
]


@pytest.mark.parametrize("address", OPEN)
def test_an_address_elsewhere_has_to_be_encrypted(address: str) -> None:
    with pytest.raises(UserError) as refused, connect(address, None):
        pass
    assert str(refused.value) == (
        f"--scheduler: {address}: is not encrypted: whoever reaches it or listens has code run by its"
        " workers; give tls://…, or say that nobody can by DASK_DISTRIBUTED__COMM__REQUIRE_ENCRYPTION=false"
        " (docs/fleet.md)"
    )


@pytest.mark.parametrize(
    "address", ["tcp://127.0.0.1:9", "localhost:9", "tcp://[::1]:9", "tls://127.0.0.1:9"]
)
def test_this_machine_and_tls_are_asked(address: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster, "TIMEOUT_S", 0.5)
    with (
        pytest.raises(UserError, match=r"no Dask scheduler answers|without a certificate"),
        connect(address, 1),
    ):
        pass


def test_who_says_that_nobody_listens_may_go_without(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster, "TIMEOUT_S", 0.5)
    with (
        dask.config.set({"distributed.comm.require-encryption": False}),
        pytest.raises(UserError, match="no Dask scheduler answers"),
        connect("tcp://192.0.2.1:8786", None),
    ):
        pass
