"""Tag of the wheel, hatchling's build hook: with a library of kernels it is of one platform."""

import sysconfig
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class WheelTag(BuildHookInterface):  # type: ignore[type-arg]
    """Sets `tag` where `python -m ecu.build` has made a library, which serves every Python."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Change what is built."""
        if version == "standard" and Path(self.root, "ecu", "compiled", "manifest.json").exists():
            build_data["pure_python"] = False
            platform = sysconfig.get_platform().replace("-", "_").replace(".", "_")
            build_data["tag"] = f"py3-none-{platform}"
