"""The notebooks and the examples of docs/python.md run as they stand, in an empty folder."""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.study

ROOT = Path(__file__).parent.parent
NOTEBOOKS = sorted((ROOT / "docs/notebooks").glob("*.ipynb"))


def run(source: str, folder: Path) -> str:
    done = subprocess.run([sys.executable, "-c", source], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-2000:]
    return done.stdout


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_its_cells_run_in_order(path: Path, tmp_path: Path) -> None:
    cells = json.loads(path.read_text("utf-8"))["cells"]
    code = ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]
    assert len(code) >= 3
    printed = run("\n\n".join(code), tmp_path)
    shown = "".join("".join(out.get("text", [])) for cell in cells for out in cell.get("outputs", []))
    numbers = [[float(one) for one in re.findall(r"-?\d+\.\d+", text)] for text in (printed, shown)]
    assert len(numbers[0]) > 3
    assert numbers[0] == pytest.approx(numbers[1], abs=0.0051, rel=0.01)


PAGE = (ROOT / "docs/python.md").read_text("utf-8")


def test_the_examples_of_the_page_print_what_it_shows(tmp_path: Path) -> None:
    (tmp_path / "tests").symlink_to(ROOT / "tests")
    blocks = re.findall(r"```(python|text)\n(.*?)```", PAGE, re.DOTALL)
    code = "\n".join(text for kind, text in blocks if kind == "python")
    shown = "".join(text for kind, text in blocks if kind == "text")
    printed = run(code, tmp_path)
    numbers = [[float(one) for one in re.findall(r"-?\d+\.\d+", text)] for text in (printed, shown)]
    assert numbers[0] == pytest.approx(numbers[1], abs=0.0051, rel=0.01)
