"""Which frames a file knows: a DBC file's messages, or the PDOs of a network file's nodes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dvtcli.domain.meanings import Rules
    from dvtcli.domain.network.network_state import NodeState
    from dvtcli.domain.pdo import Pdo, PdoConfig
    from dvtcli.operations.user.reporter import Reporter
    from dvtcli.watch.decoder import Address, Layout

_NETWORK = (".yaml", ".yml")


def file_layouts(file: str, tell: Reporter) -> Mapping[Address, Layout]:
    """The layouts in *file*, a network file by its suffix, else a DBC file; errors as those of reading either.

    *tell* is told which names in a network file nothing says the objects of, so that frames with them stay bytes.
    """
    if Path(file).suffix.lower() not in _NETWORK:
        from dvtcli.files.dbc import read_dbc

        return read_dbc(file)
    return _network_layouts(file, tell)


def _network_layouts(file: str, tell: Reporter) -> Mapping[Address, Layout]:
    """What the nodes of the network *file* send and hear once it is applied, with what it says of their values.

    What the file itself says goes before what is only the default of a node's file.
    """
    from dvtcli.files.network.physical_keys import rules_by_node
    from dvtcli.operations.network.described_network import described_network
    from dvtcli.operations.network.unknown_names import unknown_names
    from dvtcli.operations.wanted.network_wish import read_wish
    from dvtcli.watch.decoder import Decoder

    wish = read_wish(file)
    state = described_network(file, wish=wish)
    for note in unknown_names(file, wish):
        place = f"{file}:{note.mark.line}:{note.mark.column}"
        tell.note(f"{place}: {note.text}; frames with such a name stay bytes")
    rules, decoder = rules_by_node(wish.nodes), Decoder()
    for node in state.nodes:
        said = {pdo: config for pdo, config in node.pdos.items() if pdo not in node.guessed}
        decoder.add(_layouts(node, said, rules.get(node.node_id, {}), f"the mapping in {Path(file).name}"))
    for node in state.nodes:
        for pdo, whose in node.guessed.items():
            layouts = _layouts(node, {pdo: node.pdos[pdo]}, rules.get(node.node_id, {}), whose)
            decoder.add({address: _as_guess(file, layout) for address, layout in layouts.items()})
    return decoder.layouts


def _layouts(node: NodeState, pdos: Mapping[Pdo, PdoConfig], rules: Rules, source: str) -> Mapping[Address, Layout]:
    from dvtcli.operations.meanings.physical_meanings import meanings_of
    from dvtcli.watch.decoder import pdo_layouts

    return pdo_layouts(node.node_id, pdos, node.dictionary, meanings_of(node.profile, node.dictionary, [rules]), source)


def _as_guess(file: str, layout: Layout) -> Layout:
    """*layout*, which *file* does not say."""
    who = f"{layout.service.label} of node {layout.service.node}"
    said = f"{Path(file).name} does not say what {who} maps: read by {layout.source}, which the node need not hold"
    return replace(layout, guess=said)
