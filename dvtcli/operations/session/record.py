"""The record of a session: the script lines of everything that succeeded and changed something, for `save`.

Does not know how a line is run, nor what it means.
"""

from __future__ import annotations


class Record:
    """Script lines in the order they were done, each with the node-ID that it is about (0: all nodes)."""

    def __init__(self) -> None:
        self.lines: list[tuple[int, str]] = []

    def add(self, node_id: int, lines: list[str]) -> None:
        """Remember script *lines* about a node that succeeded and changed something."""
        self.lines += [(node_id, line) for line in lines]

    def take_back(self, node_id: int, lines: list[str]) -> bool:
        """Forget *lines* where they are the last that are remembered about the node; whether they were."""
        own = [number for number, (about, _) in enumerate(self.lines) if about == node_id][-len(lines) :]
        if not lines or [self.lines[number][1] for number in own] != lines:
            return False
        for number in reversed(own):
            del self.lines[number]
        return True

    def of(self, node_id: int) -> list[str]:
        """The lines about one node."""
        return [line for about, line in self.lines if about == node_id]
