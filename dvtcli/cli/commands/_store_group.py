"""Words of `store` and `restore`: which group of objects, and how a store is proved."""

from __future__ import annotations

import click

from dvtcli.cli.params import CanopenType, NumberType
from dvtcli.errors import UsageError

_GROUPS = {"all": 1, "communication": 2, "application": 3}


class StoreGroup(CanopenType):
    """`all`, `communication`, `application`, or a sub-index 1…127."""

    name = "group"

    def parse(self, text: str, ctx: click.Context | None) -> int:
        """The sub-index of 0x1010 or 0x1011."""
        if text.lower() in _GROUPS:
            return _GROUPS[text.lower()]
        return int(NumberType(1, 127, "all, communication, application, or a sub-index").parse(text, ctx))


class ProofWay(CanopenType):
    """`reset` or `power`; a group's word belongs to the command, where `--prove` stands alone before it."""

    name = "way"

    def parse(self, text: str, ctx: click.Context | None) -> str | int:
        """The word, or the sub-index of the group that it is."""
        if text.lower() in ("reset", "power"):
            return text.lower()
        try:
            return StoreGroup().parse(text, ctx)
        except ValueError as wrong:
            raise ValueError(f"power, or nothing for a reset; {wrong}") from wrong


def way_and_group(prove: str | int | None, group: int | None) -> tuple[str | None, int | None]:
    """How to prove, None for not at all, and the group; UsageError where two groups are named."""
    if not isinstance(prove, int):
        return prove, group
    if group is not None:
        raise UsageError("two groups are named; one at a time")
    return "reset", prove
