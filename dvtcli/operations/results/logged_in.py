"""What a login led to, as an answer. Knows no terminal and no session; carries no passcode."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from dvtcli.operations.results.documents import Answer, Document


@dataclass(frozen=True, slots=True)
class LoggedIn(Answer):
    """The access level that the node is at, and the one that was *wanted* (0: to be logged out)."""

    renderer: ClassVar = "login_lines:login_lines"

    node: int
    level: int
    wanted: int
    dry_run: bool
    #: what the level allows, in words
    allows: str = ""
    exit_code: int = 0

    def document(self) -> Document:
        """`dvtcli.login/1`."""
        return {
            "schema": "dvtcli.login/1",
            "node": self.node,
            "level": self.level,
            "wanted": self.wanted,
            "dry_run": self.dry_run,
        }
