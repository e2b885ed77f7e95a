import pytest

from ecu.errors import UserError
from ecu.watch.daemons import choose, is_held, running


def test_running_daemons_in_the_order_of_their_starts(loop, rings):
    second, first = loop(2, start_ns=20, channel="can1"), loop(3, start_ns=10)
    (rings / "brake-ecu.1.9.ring").write_bytes(b"left over")
    (rings / "brake-ecu.1.8.ring.77.new").write_bytes(b"being made")
    assert [daemon.pid for daemon in running()] == [3, 2]
    assert running()[0].label == "suv on socketcan can0, process 3"
    second.close()
    assert [daemon.pid for daemon in running()] == [3]
    assert is_held(first.ring.path)


def test_looking_removes_nothing(loop, rings):
    """A ring that is being made is not locked yet: whoever took its lock or name would stop a daemon."""
    loop(1)
    left = [rings / "brake-ecu.1.8.ring.77.new", rings / "brake-ecu.1.9.ring"]
    for path in left:
        path.write_bytes(b"")
    running()
    assert all(path.exists() for path in left)


@pytest.mark.parametrize(
    ("wanted", "pid"), [("2", 2), ("can1", 2), ("lcv", 3), ("7", None), ("can", None), ("ring", 2)]
)
def test_a_daemon_answers_to_its_process_channel_car_and_ring(loop, wanted, pid):
    kept = [loop(2, channel="can1"), loop(3, name="lcv")]
    if wanted == "ring":
        wanted = str(kept[0].ring.path)
    found = choose(running(), wanted)
    assert (found and found.pid) == pid


def test_of_several_one_is_to_be_named(loop):
    kept = [loop(2, channel="can1"), loop(3)]
    with pytest.raises(UserError, match=r"2 daemons run \(suv on .*process 2; .*process 3\).*name one"):
        choose(running(), None)
    assert choose([], None) is None
    assert kept
