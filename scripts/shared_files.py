"""Build hook of the wheel: adds the manual page and the shells' completions, made from the same source as `help`.

`pip install` puts them below `share/` of the environment: where man, bash-completion, zsh and fish look if that is
`/usr` or `/usr/local`. An editable installation has none.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

#: path in the wheel's data folder -> the words of dvtcli that print it
SHARED_FILES = {
    "share/man/man1/dvtcli.1": ("help", "--man"),
    "share/bash-completion/completions/dvtcli": ("completion", "bash"),
    "share/zsh/site-functions/_dvtcli": ("completion", "zsh"),
    "share/fish/vendor_completions.d/dvtcli.fish": ("completion", "fish"),
    "share/dvtcli/completions/dvtcli.ps1": ("completion", "powershell"),
}


def printed_by(root: Path, words: tuple[str, ...]) -> bytes:
    """Return what the dvtcli in *root* prints for *words*, with no settings of the user; SystemExit if it fails."""
    needed = {name: value for name, value in os.environ.items() if name in ("PATH", "SYSTEMROOT", "TEMP", "TMP")}
    with TemporaryDirectory(prefix="dvtcli-home-") as home:
        variables = needed | {"PYTHONPATH": os.pathsep.join([str(root), *filter(None, sys.path)]), "HOME": home}
        variables |= {"PYTHONIOENCODING": "utf-8", "PYTHONDONTWRITEBYTECODE": "1", "COLUMNS": "80"}
        done = subprocess.run([sys.executable, "-m", "dvtcli", *words], env=variables, cwd=home, capture_output=True)  # noqa: PLW1510, S603 - our own words
    if done.returncode != 0:
        raise SystemExit(f"dvtcli {' '.join(words)} failed: {done.stderr.decode('utf-8', 'replace')}")
    return done.stdout.replace(b"\r\n", b"\n")


class SharedFiles(BuildHookInterface):  # type: ignore[type-arg, misc]
    """Write the shared files to a temporary folder while the wheel is built."""

    PLUGIN_NAME = "custom"

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Add the files to *build_data*, unless *version* is an editable installation's."""
        if version == "editable":
            return
        self._folder = TemporaryDirectory(prefix="dvtcli-shared-")
        for number, (place, words) in enumerate(SHARED_FILES.items()):
            file = Path(self._folder.name, str(number))
            file.write_bytes(printed_by(Path(self.root), words))
            build_data["shared_data"][str(file)] = place

    def finalize(self, version: str, _build_data: dict[str, Any], _artifact: str) -> None:
        """Remove the temporary folder."""
        if version != "editable":
            self._folder.cleanup()
