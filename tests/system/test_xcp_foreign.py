"""`run --xcp` with a foreign master, pyxcp: what it reads, what it may not, what it measures."""

import hmac
import struct
import time

import numpy as np
import pytest

from brakelab.bench.xcp_master import VARIABLES
from brakelab.testing.daemon import wait_for
from ecu.settings.config import load_config
from ecu.xcp.memory import EPK

from .conftest import ROOT, driven, free_port
from .test_xcp_udp import GROUP, SIGNALS

pyxcp = pytest.importorskip("pyxcp", reason="pyxcp is not installed: pip install pyxcp")

pytestmark = [pytest.mark.study, pytest.mark.multicast]

SECONDS = 2.0


@pytest.fixture(params=["UDP", "TCP"])
def settings(request, daemon, car):
    """An application of pyxcp for the slave of a daemon whose car drives."""
    from pyxcp.config import create_application_from_config, set_application

    port = free_port()
    one = daemon(
        *("--config", ROOT / "config" / "suv.toml", "-i", "udp_multicast", "-c", GROUP),
        *("--xcp", f"{request.param.lower()}:{port}"),
    )
    one.wait_for("ready")
    place = {"host": "127.0.0.1", "port": port, "protocol": request.param, "ipv6": False}
    application = create_application_from_config({"Transport": {"Eth": place}})
    set_application(application)
    with driven(car):
        yield application
        assert one.end() == 0


def opened(settings, **policy):
    """Return a master of pyxcp as soon as there is somebody at the port."""
    found = []

    def opens():
        try:
            found.append(pyxcp.Master("eth", config=settings, **policy))
            found[-1].__enter__()
            found[-1].connect()
        except Exception:  # pyxcp's are of many kinds
            return False
        return True

    wait_for(opens)
    return found[-1]


def test_a_foreign_master_reads_what_it_may(settings):
    from pyxcp.master.errorhandler import SystemExit  # not Python's

    master = opened(settings)
    try:
        assert master.identifier(1) == "brake_ecu"
        assert master.identifier(5) == EPK
        mass, _ = VARIABLES["parameters.vehicle.mass"]
        assert np.frombuffer(master.shortUpload(8, mass)).tolist() == [2105.0]
        (event,) = master.getDaqInfo()["channels"]
        assert (event["name"], event["cycle"]) == ("cycle", 10)
        with pytest.raises(SystemExit) as refused:
            master.shortUpload(8, 0)
        assert "ERR_ACCESS_DENIED" in repr(refused.value)
        master.setMta(mass)
        with pytest.raises(SystemExit) as refused:
            master.download(bytes(8))
        assert "ERR_WRITE_PROTECTED" in repr(refused.value)
        master.disconnect()
    finally:
        master.close()


def test_a_foreign_master_calibrates_stores_and_is_refused(daemon, car, tmp_path):
    from pyxcp.config import create_application_from_config, set_application
    from pyxcp.master.errorhandler import SystemExit  # not Python's

    key, port = tmp_path / "key", free_port()
    key.write_text(bytes(32).hex())
    key.chmod(0o600)
    one = daemon(
        *("--config", ROOT / "config" / "suv.toml", "-i", "udp_multicast", "-c", GROUP),
        *("--xcp", f"udp:{port}", "--xcp-key", key, "--xcp-save", tmp_path / "saved.toml"),
    )
    one.wait_for("ready")
    place = {"host": "127.0.0.1", "port": port, "protocol": "UDP", "ipv6": False}
    application = create_application_from_config({"Transport": {"Eth": place}})
    application.general.seed_n_key_function = lambda _, seed: hmac.digest(bytes(32), seed, "sha256")[:16]
    set_application(application)
    rate, _ = VARIABLES["parameters.control.max_pressure_rate"]
    with driven(car):
        master = opened(application)
        try:
            assert master.getPagProcessorInfo().maxSegments == 1
            master.cond_unlock("calpag")
            for value, code in ((100.0, "ERR_OUT_OF_RANGE"), (2000.0, None)):
                master.setMta(rate)
                master.download(struct.pack("<d", value))
                if code:
                    with pytest.raises(SystemExit) as refused:
                        master.setCalPage(1, 0, 1)
                    assert code in repr(refused.value)
                else:
                    master.setCalPage(1, 0, 1)
            assert master.getCalPage(1, 0) == 1
            master.setRequest(1, 0)
            assert np.frombuffer(master.shortUpload(8, rate)).tolist() == [2000.0]
            master.disconnect()
        finally:
            master.close()
        assert load_config(tmp_path / "saved.toml").control.max_pressure_rate == 2000.0
        assert one.end() == 0


def test_a_foreign_master_measures_200_signals_and_none_is_lost(settings):
    from pyxcp.daq_stim import DaqList, DaqOnlinePolicy

    class Kept(DaqOnlinePolicy):
        """Keeps what comes."""

        def initialize(self):
            self.rows = []

        def finalize(self):
            pass

        def on_daq_list(self, daq_list, timestamp0, timestamp1, payload):
            self.rows.append((timestamp1, list(payload)))

    wanted = [(name.replace(".", "_"), VARIABLES[name][0], 0, "F64") for name in SIGNALS]
    policy = Kept([DaqList("cycle", 0, False, True, wanted, 0, 1)])
    master = opened(settings, policy=policy)
    try:
        policy.setup()
        policy.start()
        time.sleep(SECONDS)
        policy.stop()
        master.disconnect()
    finally:
        master.close()
    stamps = np.array([stamp for stamp, _ in policy.rows])
    assert len(stamps) > 50 * SECONDS
    assert set(np.diff(stamps)) <= {10_000_000 * periods for periods in range(1, 100)}
    assert len(policy.rows[0][1]) == len(SIGNALS)
