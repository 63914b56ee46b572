"""Changes that succeed or fail together, like the lines of an atomic script, and their entry in a journal."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from dvtcli.device.change.plan_document import Identity
    from dvtcli.domain.plan import Change


class Storing(NamedTuple):
    """A store at the end of a change group, after all changes are verified.

    *group* is the argument of `store`. *is_begun*: the command may have been sent. *is_done*: the node acknowledged.
    *is_refused*: the node refused and stored nothing. *is_accepted*: the journal was closed with the present values, no
    further request follows. *identity* (0x1018) is None in journals of earlier versions. *holds* are the expected
    values of an unchanged node without a journal.
    """

    node_id: int
    group: str
    is_done: bool = False
    identity: Identity | None = None
    holds: tuple[Change, ...] = ()
    is_begun: bool = False
    is_refused: bool = False
    is_accepted: bool = False

    @property
    def waits(self) -> bool:
        """True if the node is still to store."""
        return not (self.is_done or self.is_accepted)


class GroupMember(NamedTuple):
    """The change group of a journal: id and name of the group (None and empty: a change by itself).

    *entries* are the ids for `undo`; *final* is the script line begun last, which no undo reverts. *asked* are the PDOs
    probed by `learn`, empty for a change; the plan's other PDOs are only compared. *stores* end a group after every
    node is verified. *tests* are temporary changes of a proof, rolled back before any further store. *equal* are nodes
    that matched already, with their expected values: neither changed nor stored.
    """

    group_id: str | None = None
    name: str = ""
    entries: tuple[str, ...] = ()
    final: str = ""
    asked: tuple[str, ...] = ()
    stores: tuple[Storing, ...] = ()
    tests: tuple[Change, ...] = ()
    equal: tuple[Storing, ...] = ()


class OrderedChange(NamedTuple):
    """A change of a session for `undo`: its node-ID, and the id of its change group (None: a change by itself)."""

    node_id: int
    group_id: str | None = None


@dataclass(slots=True, eq=False, repr=False)
class ChangeGroup:
    """The current change group, shared by all nodes of a session; without an id each change is separate."""

    id: str | None = None
    name: str = ""

    def begin(self, name: str) -> None:
        """Start a group called *name*: from now on the changes of all nodes succeed or fail together."""
        self.id, self.name = os.urandom(16).hex(), name

    def end(self) -> None:
        """End the group: each change is separate again."""
        self.id, self.name = None, ""
