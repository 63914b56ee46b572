"""What a script would leave is found by whoever runs lines; operations ask for it through this."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from dvtcli.device.wish import Wish


class Rehearse(Protocol):
    """Finds what a script wishes of each node, by running it on twins; *node_id* is selected when it begins."""

    def __call__(self, file: str, node_id: int | None = None) -> dict[int, Wish]:
        """The wishes of the script *file*, by node-ID; a line that cannot run raises, with FILE:LINE."""
