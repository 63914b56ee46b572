"""Which frames a file knows: a DBC file's messages, or the PDOs of a network file's nodes."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dvtcli.operations.user.telling import Teller
    from dvtcli.watch.decoder import Address, Layout

_NETWORK = (".yaml", ".yml")


def file_layouts(file: str, tell: Teller) -> Mapping[Address, Layout]:
    """The layouts in *file*, a network file by its suffix, else a DBC file; errors as those of reading either.

    *tell* is told which names in a network file nothing says the objects of, so that frames with them stay bytes.
    """
    if Path(file).suffix.lower() not in _NETWORK:
        from dvtcli.files.dbc import read_dbc

        return read_dbc(file)
    return _network_layouts(file, tell)


def _network_layouts(file: str, tell: Teller) -> Mapping[Address, Layout]:
    """What the nodes of the network *file* send and hear once it is applied, with what it says of their values."""
    from dvtcli.files.network.physical_keys import rules_by_node
    from dvtcli.operations.meanings.physical_meanings import meanings_of
    from dvtcli.operations.network.described_network import described_network
    from dvtcli.operations.network.unknown_names import unknown_names
    from dvtcli.operations.wanted.network_wish import read_wish
    from dvtcli.watch.decoder import Decoder, pdo_layouts

    wish = read_wish(file)
    for note in unknown_names(file, wish):
        place = f"{file}:{note.mark.line}:{note.mark.column}"
        tell.note(f"{place}: {note.text}; frames with such a name stay bytes")
    said = rules_by_node(wish.nodes)
    decoder = Decoder()
    for node in described_network(file).nodes:
        meanings = meanings_of(node.profile, node.dictionary, [said.get(node.node_id, {})])
        decoder.add(
            pdo_layouts(node.node_id, node.pdos, node.dictionary, meanings, f"the mapping in {Path(file).name}")
        )
    return decoder.layouts
