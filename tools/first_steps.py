"""Run the pages of first steps as a newcomer would: seconds a command, and pictures of the result.

    python tools/first_steps.py [FOLDER]

The commands of docs/first-steps-*.md run in FOLDER, default out/first-steps. Prints the seconds of each; with
Chromium docs/images/first-steps-*.png are renewed. Exits with 1 where a command fails.
"""

import os
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path
from typing import Final, NamedTuple

from draw_watch import chromium

CHECKOUT: Final = Path(__file__).resolve().parent.parent
PAGES: Final = sorted((CHECKOUT / "docs").glob("first-steps-*.md"))
ENDS_WITH: Final = {
    "first-steps-log": ("steps/result.html", 1250),
    "first-steps-hil": ("rack/rig/rig.html", 700),
    "first-steps-law": ("law/result.html", 1250),
}
"""Page in the end, and how much of it is shown [pixels]."""
ABOUT_THIS_MACHINE: Final = {"doctor"}
"""Commands whose exit code is about the machine."""


class Block(NamedTuple):
    """A block of a page."""

    kind: str
    """`sh`: commands; `text`: their output."""
    text: str


def blocks(page: Path) -> list[Block]:
    """Return the blocks of a page that are run or compared."""
    found = re.findall(r"```(sh|text)\n(.*?)```", page.read_text("utf-8"), re.DOTALL)
    return [Block(kind, text) for kind, text in found]


def commands(block: Block) -> list[str]:
    """Return the commands of a block; what stands between two of `brake-ecu` is one script of the shell."""
    found: list[str] = []
    for line in block.text.replace("\\\n", " ").splitlines(keepends=True):
        if line.startswith("brake-ecu") or not found or found[-1].startswith("brake-ecu"):
            found.append(line)
        else:
            found[-1] += line
    return found


def is_about_this_machine(command: str) -> bool:
    """Return whether a command may fail on a machine that lacks something."""
    return command.split()[1] in ABOUT_THIS_MACHINE


def prepare(folder: Path) -> dict[str, str]:
    """Make a folder like a checkout for the commands; return their environment."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in ("config", "dbc"):
        if not (folder / name).exists():
            (folder / name).symlink_to(CHECKOUT / name)
    return os.environ | {"PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}"}


def _walk(page: Path, folder: Path) -> bool:
    environment = prepare(folder)
    print(f"\n{page.stem}")
    total = 0.0
    for block in blocks(page):
        for command in commands(block) if block.kind == "sh" else ():
            begin = time.perf_counter()
            done = subprocess.run(
                ["bash", "-ec", command], cwd=folder, env=environment, capture_output=True, text=True
            )
            lasted = time.perf_counter() - begin
            total += lasted
            print(f"{lasted:7.1f} s  {' '.join(command.split())[:100]}", flush=True)
            if done.returncode and not (command.startswith("brake-ecu") and is_about_this_machine(command)):
                print(done.stdout + done.stderr, file=sys.stderr)
                return False
    print(f"{total:7.1f} s  all")
    return True


def _photograph(page: Path, folder: Path) -> None:
    program = chromium()
    shown, height = ENDS_WITH[page.stem]
    if program is None:
        print("no chromium: no picture", file=sys.stderr)
        return
    picture = CHECKOUT / "docs/images" / f"{page.stem}.png"
    options = ["--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars"]
    options += ["--virtual-time-budget=10000", f"--window-size=1000,{height}", f"--screenshot={picture}"]
    subprocess.run([program, *options, f"file://{folder.resolve() / shown}"], check=True, capture_output=True)
    print(f"written: {picture.relative_to(CHECKOUT)}")


def main() -> int:
    """Run the command."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else CHECKOUT / "out/first-steps"
    for page in PAGES:
        shutil.rmtree(folder / page.stem, ignore_errors=True)
        if not _walk(page, folder / page.stem):
            return 1
        _photograph(page, folder / page.stem)
    return 0


if __name__ == "__main__":
    sys.exit(main())
