"""README.md as a package index shows it: hatchling's metadata hook of pyproject.toml.

The project has no address that links could begin with. Where the README is shown without the repository
around it, its pictures are left out and links into the repository are plain text.
"""

import re
from pathlib import Path
from typing import Any, Final

from hatchling.metadata.plugin.interface import MetadataHookInterface

CODE: Final = r"(?P<code>```.*?```)"
PICTURE: Final = r"!\[[^\]]*\]\((?!https?:)[^)]*\)\n*"
LINK: Final = r"\[(?P<text>[^\]]+)\]\((?!https?:)[^)]+\)"
NOTE: Final = "Pages named here are in the source distribution; read it for pictures and links.\n"


def for_an_index(text: str) -> str:
    """Return a README without pictures and links that lead into the repository; code stays as it is."""
    text = re.sub(
        f"{CODE}|{PICTURE}|{LINK}", lambda found: found["code"] or found["text"] or "", text, flags=re.DOTALL
    )
    heading, _, rest = text.partition("\n")
    return f"{heading}\n\n{NOTE}{rest}"


class LongDescription(MetadataHookInterface):
    """Sets `readme`."""

    def update(self, metadata: dict[str, Any]) -> None:
        """Add the long description to the metadata of the project."""
        text = Path(self.root, "README.md").read_text("utf-8")
        metadata["readme"] = {"content-type": "text/markdown", "text": for_an_index(text)}
