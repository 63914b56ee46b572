"""Map objects into a PDO: check, disable, write, enable, read back; roll back on failure."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from dvtcli.cli.command import DvtCommand
from dvtcli.cli.commands._pdo_options import pdo_options, request
from dvtcli.cli.effect import Effect
from dvtcli.cli.params import ENTRY, PDO, EntryWord, NodePdo
from dvtcli.domain.object_syntax import MappedObject
from dvtcli.domain.request import mapping_entries, wanted_config
from dvtcli.domain.rules.mappable import missing_object
from dvtcli.errors import RuleError
from dvtcli.operations.change import configure, made

if TYPE_CHECKING:
    from dvtcli.domain.pdo import PdoConfig
    from dvtcli.domain.rules import Proposal
    from dvtcli.operations.results import Changed
    from dvtcli.operations.session import Session

TASK = ("Change PDOs", 10)


@click.command("map", cls=DvtCommand, short_help=__doc__, effect=Effect.CHANGES)
@click.argument("pdo", type=PDO)
@click.argument("objects", type=ENTRY, nargs=-1, required=True, metavar="OBJECT...")
@pdo_options
@click.pass_obj
def command(session: Session, /, pdo: NodePdo, objects: tuple[EntryWord, ...], **options: Any) -> Changed:
    """Map OBJECTs into PDO, in frame order, and enable it.

    \b
    map tpdo1 6C01:1 606C 6041 --cob-id 0x201 --sync 1
    map tpdo2 velocity_actual_value statusword --event --timer 100
    map rpdo1 dummy/16 2020:4 2020:2          skip 16 bits first
    """
    asked = request(options, enabled=True)
    node = session.node(pdo.node_id)
    words = [word.resolve(node) for word in objects]
    lengths = {
        (word.index, word.sub_index): node.length_of(word.index, word.sub_index)
        for word in words
        if isinstance(word, MappedObject) and word.bits is None
    }

    def make(proposal: Proposal) -> PdoConfig:
        refuse_missing(proposal, [key for key, bits in lengths.items() if bits is None])
        return wanted_config(asked, proposal, mapping_entries(words, proposal, lengths))

    return configure(session, node, {pdo.pdo: made(pdo.pdo, make)})


def refuse_missing(proposal: Proposal, unknown: list[tuple[int, int]]) -> None:
    """Raise RuleError for an object of *unknown* length that the EDS does not have at all."""
    dictionary = proposal.dictionary
    for index, sub_index in unknown:
        if dictionary is not None and dictionary.entry(index, sub_index) is None:
            finding = missing_object(dictionary, proposal.mapping_place(1), index, sub_index)
            text = f"{proposal.pdo.label} not changed: {finding.text}"
            raise RuleError(text, [finding], node=proposal.node_id)
