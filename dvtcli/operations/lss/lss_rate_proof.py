"""Proving that nodes stored a bit rate: all are reset at once, and seen at it again.

A node that did not store it comes back at its old one, where it can be told again: then all go back. Does not know how
they changed (`lss_rate_change`).
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING

from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.nmt import UNCONFIGURED
from dvtcli.errors import DeviceRefused, DvtcliError, LeftChanged
from dvtcli.operations.consent.reset_consent import refuse_reset
from dvtcli.operations.lss.lss_node_id import BOOT_UP_S, forget
from dvtcli.operations.lss.lss_rate_change import RateChange, names

if TYPE_CHECKING:
    from dvtcli.operations.results.lss_nodes import LssGiven
    from dvtcli.operations.session.session import Session

#: NMT: every node
_ALL = 0


def refuse_resets(session: Session, nodes: Sequence[LssGiven]) -> None:
    """SafetyRefusal where one of *nodes* is a drive that its reset may let go of."""
    refuse_reset(session, [node.node_id for node in nodes if node.node_id != UNCONFIGURED])


def prove_by_resets(session: Session, change: RateChange, stored: Sequence[LssGiven]) -> list[LssGiven]:
    """Reset all nodes of the bus, and see that those that *stored* are back at the new bit rate, as they were heard.

    One without a node-ID says nothing when it boots: it is seen, and not proved. Where one is back at the old bit rate
    all go back to that, and store it; LeftChanged where that fails. DeviceRefused where one was not heard to boot up.
    """
    named = [stored_slave for stored_slave in stored if stored_slave.node_id != UNCONFIGURED]
    seen = {named_slave.node_id: change.bus.boot_ups(named_slave.node_id) for named_slave in named}
    session.tell.progress("LSS: all are reset", 0, 0)
    change.master.let_wait()
    change.master.reset_node(_ALL)
    until_s = change.bus.now_s() + BOOT_UP_S
    booted = {
        named_slave.node_id
        for named_slave in named
        if change.bus.wait_boot_up(
            named_slave.node_id, seen[named_slave.node_id], max(0.0, until_s - change.bus.now_s())
        )
    }
    for slave in named:
        forget(session, slave)
    missing = change.missing(stored)
    if missing:
        raise _not_kept(change, missing)
    unheard = [named_slave for named_slave in named if named_slave.node_id not in booted]
    if unheard:
        raise DeviceRefused(
            f"{names(unheard)}: no boot-up was heard after the reset: nothing is proved",
            state="unknown",
            why=f"all answer at {change.after} bit/s, and said that they stored it",
            hint=Hint(Action.FIND_NODES, why="switch them off and on, then {}"),
        )
    return [replace(stored_slave, proved=stored_slave.node_id in booted) for stored_slave in stored]


def _not_kept(change: RateChange, missing: Sequence[LssGiven]) -> DvtcliError:
    """What is to be said where *missing* did not come back, once all have the old bit rate again, if that can be."""
    text = f"{names(missing)} said that it stored {change.after} bit/s, and did not come back at it after a reset"
    if change.before == change.after:
        return LeftChanged(
            text,
            why="what it had stored before is not known",
            state="left_changed",
            hint=Hint(
                Action.LISTEN_BIT_RATE,
                why="listens for the one that it came back at; switch it on meanwhile, and take the others off",
            ),
        )
    failed = DeviceRefused(text, why=f"it came back at {change.before} bit/s")
    try:
        change.fetch(missing)
    except DvtcliError as lost:
        with suppress(DvtcliError):  # where the others are; that it fails is not what there is to say
            change.go_to(change.after)
        return LeftChanged(
            text,
            why=f"nor is it found at {change.before} bit/s: {lost.text}",
            state="left_changed",
            hint=Hint(
                Action.LISTEN_BIT_RATE,
                why=f"the others run at {change.after} bit/s, and said that they stored it; {{}} listens for it",
            ),
        )
    error = change.unstored(change.nodes, failed)
    if error is failed:
        error.hint = Hint(
            Action.LSS_BIT_RATE,
            {"rate": change.after},
            f"does it without storing: it is lost with the power, and then {change.before} bit/s is back",
        )
    return error
