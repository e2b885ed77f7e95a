"""The rig's exit code and words, in memory."""

from pathlib import Path

import pytest

from ecu import cli

STOP = """
plant = "suv"
initial_speed = 8.0
draw = "nominal"
[[phase]]
kind = "brake"
decel = 4.0
until_speed = 0.0
"""


@pytest.mark.parametrize(
    ("config", "plant", "code", "told"),
    [
        ("suv", (), 0, ""),
        ("lcv", (), 1, "brake-ecu: plant suv is another car than lcv (mass +11 %"),
        ("lcv", ("--plant", "lcv"), 0, ""),
        ("lcv", ("--plant", "as-config"), 0, ""),
    ],
)
def test_a_rig_with_another_car_than_the_configured_one_has_failed(
    config: str,
    plant: tuple[str, ...],
    code: int,
    told: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    (tmp_path / "stop.toml").write_text(STOP)
    arguments = ["rig", str(tmp_path / "stop.toml"), "--config", config, "--lock-step", *plant]
    assert cli.main([*arguments, "--out", str(tmp_path / "out")]) == code
    lines = [line for line in capsys.readouterr().err.splitlines() if line.startswith("brake-ecu:")]
    assert len(lines) == bool(told)
    assert all(line.startswith(told) for line in lines)
