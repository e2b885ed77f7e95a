"""What tests need around them: a real SocketCAN bus, the recorded drives; else they skip with a reason."""

import os
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).parent.parent


def shared_folder() -> Path:
    """Folder beside the checkout that holds what is too large for it; BRAKE_ECU_SHARED names another."""
    return Path(os.environ.get("BRAKE_ECU_SHARED") or CHECKOUT.parent / "shared")


@pytest.fixture(scope="session")
def drives() -> Path:
    """Folder of the recorded drives."""
    return shared_folder() / "drives"


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    absent = {}
    if not Path("/sys/class/net/vcan0").exists():
        absent["socketcan"] = "no interface vcan0"
    if not (shared_folder() / "drives").is_dir():
        absent["drives"] = "no recorded drives beside the checkout (BRAKE_ECU_SHARED)"
    for item in items:
        for marker, reason in absent.items():
            if item.get_closest_marker(marker):
                item.add_marker(pytest.mark.skip(reason=reason))
