import pytest

from ecu import cli


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("watch --web --json", "--json gives lines, --web a page"),
        ("watch --port many", "'--port': input should be a valid integer"),
        ("watch --port 99999", "65535"),
        ("watch one two", "unexpected extra argument"),
    ],
)
def test_wrong_arguments(line, says, capsys):
    assert cli.main(line.split()) == 2
    error = capsys.readouterr().err
    assert says.lower() in error.lower()
    assert error.count("\n") == 1


def test_two_daemons(loop, capsys):
    kept = [loop(1), loop(2)]
    assert cli.main(["watch", "--json"]) == 2
    assert "name one by its process" in capsys.readouterr().err
    assert kept
