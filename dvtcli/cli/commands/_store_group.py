"""Words of `store` and `restore`: the group of objects, and the proof of a store."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from dvtcli.cli.params import CanopenType, NumberType
from dvtcli.errors import UsageError

if TYPE_CHECKING:
    from dvtcli.domain.store import ProveBy

_GROUPS = {"all": 1, "communication": 2, "application": 3}


class StoreGroup(CanopenType):
    """`all`, `communication`, `application`, or a sub-index 1…127."""

    name = "group"

    def parse(self, text: str, ctx: click.Context | None) -> int:
        """Return the sub-index of 0x1010 or 0x1011."""
        if text.lower() in _GROUPS:
            return _GROUPS[text.lower()]
        return int(NumberType(1, 127, "all, communication, application, or a sub-index").parse(text, ctx))


class ProofWay(CanopenType):
    """`reset` or `power`; a group's word after a bare `--prove` belongs to the command."""

    name = "way"

    def parse(self, text: str, ctx: click.Context | None) -> str | int:
        """Return the word, or the sub-index of a group."""
        if text.lower() in ("reset", "power"):
            return text.lower()
        try:
            return StoreGroup().parse(text, ctx)
        except ValueError as wrong:
            raise ValueError(f"write power, or no value for a reset; {wrong}") from wrong


def way_and_group(prove: ProveBy | int | None, group: int | None) -> tuple[ProveBy | None, int | None]:
    """Return the way of proof, None for none, and the group. Raises UsageError for two groups."""
    if not isinstance(prove, int):
        return prove, group
    if group is not None:
        raise UsageError("two groups are given; store one group at a time")
    return "reset", prove
