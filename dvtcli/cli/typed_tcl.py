"""The interface of typed Tcl for prompt and session, implemented by `dvt.tcl_mode`."""

from __future__ import annotations

from typing import Protocol


class TypedTcl(Protocol):
    """Lines of Tcl, and the mode for Tcl lines only."""

    on: bool

    @property
    def continues(self) -> bool:
        """Whether the next line continues the last."""

    def run(self, text: str) -> int:
        """Run a whole line; returns its exit code."""

    def typed(self, text: str) -> int:
        """Run a line typed in the mode, or keep it until complete; returns its exit code."""

    def leave(self) -> None:
        """Leave the mode."""

    def forget(self) -> None:
        """Discard the lines of an incomplete command."""

    def close(self) -> None:
        """End Tcl, and discard its variables."""
