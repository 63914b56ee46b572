"""The text of logins."""

from __future__ import annotations

from collections.abc import Iterator

from dvtcli.cli.view.lines import Cell, Line
from dvtcli.operations.results.logged_in import LoggedIn


def login_lines(result: LoggedIn, _width: int) -> Iterator[Line]:
    """The level that the node is at, and what it allows."""
    if result.dry_run:
        yield [
            Cell("dry run: ", "cyan"),
            Cell("the twin believes any passcode, and none was asked for. Nothing was sent."),
        ]
    elif not result.wanted:
        yield f"node {result.node} logged out: access level {result.level}"
    else:
        yield [Cell(f"node {result.node} is at access level {result.level}"), Cell(f": {result.allows}", "dim")]
