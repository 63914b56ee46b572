"""Changes that stand or fall together, as the lines of an atomic script do, and what a journal says of them.

Knows names only: what the changes are is in `course`.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dvtcli.device.change.plan_document import Identity
    from dvtcli.domain.plan import Change


@dataclass(frozen=True, slots=True)
class Storing:
    """A store that ends a whole, once all of it is verified.

    *group* is as `store` takes it; *is_done* once the node acknowledged it, *is_begun* once it may have been asked, and
    *is_refused* once it refused, and stored nothing. *is_accepted* once the node's journal was closed with what it
    holds: it is not asked any more. *identity* (0x1018) is the device's, None
    if an earlier version did not note it; *holds* what it is to hold, if it was not changed and has no journal.
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
        """Whether the node is still to store."""
        return not (self.is_done or self.is_accepted)


@dataclass(frozen=True, slots=True)
class GroupMember:
    """What a journal belongs to: the id and the name of a whole (None and empty: its change stands alone).

    *entries* are the ids under which `undo` remembers the changes; *final* is the line of the script that was begun
    and that no undo reverts. *asked* are the PDOs that `learn` asks, none where it is a change: the others of its plan
    are only compared. *stores* end a whole whose nodes were all verified; *tests* are what a proof of one changed for a
    moment: they are put back before anything else is stored. *equal* are the nodes that were as wanted already, and
    neither are changed nor store: each with what it is to hold.
    """

    whole: str | None = None
    name: str = ""
    entries: tuple[str, ...] = ()
    final: str = ""
    asked: tuple[str, ...] = ()
    stores: tuple[Storing, ...] = ()
    tests: tuple[Change, ...] = ()
    equal: tuple[Storing, ...] = ()


@dataclass(slots=True)
class ChangeGroup:
    """What the changes that are made now belong to; shared by all nodes of a session. No id: each stands alone."""

    id: str | None = None
    name: str = ""

    def begin(self, name: str) -> None:
        """From now on all changes, of whichever node, stand or fall together; *name* is what they are called."""
        self.id, self.name = os.urandom(16).hex(), name

    def end(self) -> None:
        """Each change stands alone again."""
        self.id, self.name = None, ""
