"""The error of a node that does not answer, whichever way it was asked."""

from __future__ import annotations

from dvtcli.errors import NoAnswer


def no_answer(node_id: int, place: str, timeout_s: float, why: str | None = None) -> NoAnswer:
    """Node *node_id* did not answer for the object at *place* (`1018:01`) within *timeout_s* (s)."""
    return NoAnswer(
        f"node {node_id} did not answer for 0x{place} within {timeout_s:g} s",
        node=node_id,
        place=place,
        why=why,
        hint="power, node-ID, bit rate? A node in STOPPED answers no SDO; `scan` shows who does",
    )
