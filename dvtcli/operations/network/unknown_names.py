"""Names in a network file that nothing known without the bus says the objects of. Reads no node."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from typing import TYPE_CHECKING

from dvtcli.domain.network.wanted_state import FileNote
from dvtcli.operations.meanings.named_objects import is_name
from dvtcli.operations.network.described_network import simulated_word

if TYPE_CHECKING:
    from dvtcli.domain.network.wanted_state import NetworkWish


def unknown_names(file: str, wish: NetworkWish, known: Collection[int] = ()) -> Iterator[FileNote]:
    """A note for each node of *wish*, from *file*, whose names nothing says the objects of, at the first of them.

    Not for the nodes in *known*, of which a dictionary is known otherwise.
    """
    for node in wish.nodes:
        words = [word for pdo in node.pdos for word in pdo.mapping or ()]
        words += [value.object for value in node.values]
        names = [word for word in words if is_name(word.text)]
        if names and node.node_id not in known and simulated_word(file, node) is None:
            text = (
                f"nothing here says which object {names[0].text!r} of node {node.node_id} is: its `dcf:`, its "
                "`profile:`, or a file of the library with its identity does"
            )
            yield FileNote(text, names[0].mark, len(names))
