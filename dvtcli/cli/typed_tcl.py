"""Tcl that is typed, as prompt and session know it; `dvt.tcl_mode` is it. Knows no Tcl."""

from __future__ import annotations

from typing import Protocol


class TypedTcl(Protocol):
    """Lines of Tcl, and the mode in which every line is one."""

    on: bool

    @property
    def continues(self) -> bool:
        """Whether the next line goes on with the last one."""

    def run(self, text: str) -> int:
        """Run a whole line; its exit code."""

    def typed(self, text: str) -> int:
        """Run a line that was typed in the mode, or keep it until it is whole; its exit code."""

    def leave(self) -> None:
        """Leave the mode."""

    def forget(self) -> None:
        """Throw away the lines of a command that is not whole."""

    def close(self) -> None:
        """End Tcl, and with it what the lines have set."""
