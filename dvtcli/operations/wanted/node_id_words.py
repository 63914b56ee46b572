"""Values of a network file that follow a node's node-ID: `$NODEID+0x80`, as an EDS writes them (CiA 306, 4.6.3)."""

from __future__ import annotations

import re

from dvtcli.domain.datatypes import parse_number

_FOLLOWS = re.compile(r"\$NODEID\s*(?:\+\s*(?P<more>\S+))?|(?P<first>\S+)\s*\+\s*\$NODEID", re.IGNORECASE)


def following(number: int) -> str:
    """The value that is *number* more than the node-ID."""
    return f"$NODEID+0x{number:X}"


def of_node(text: str, node_id: int) -> str:
    """What the value *text* is on the node with *node_id*; *text* itself where it does not follow it.

    ValueError where something else than a number is added to `$NODEID`.
    """
    found = _FOLLOWS.fullmatch(text.strip())
    return str(parse_number(found["more"] or found["first"] or "0") + node_id) if found else text
