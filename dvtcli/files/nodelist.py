"""Nodelists (CiA 306-3, `nodelist.cpj`): the nodes of a network, and the DCF of each.

Reads the topology sections only.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from dvtcli.errors import InputFileError
from dvtcli.files.eds.findings import Findings
from dvtcli.files.eds.ini import IniSection, IniValue, Values, section_values, split_sections
from dvtcli.files.eds.numbers import number_key

SUFFIX = ".cpj"
#: A list of 127 nodes is some 10 kB.
MOST_BYTES = 1 << 20
_TOPOLOGY = "topology"
_HIGHEST_NODE_ID = 127


@dataclass(frozen=True, slots=True)
class ListedNode:
    """A node of a nodelist: *name* and *dcf* as written, and the *line* of its DCF."""

    node_id: int
    name: str = ""
    dcf: str = ""
    line: int = 1


@dataclass(frozen=True, slots=True)
class Nodelist:
    """A network: *name*, and *nodes* in order of node-ID; *absent* are nodes marked as not present.

    *eds_folder* is the folder of the EDS files as written (EDSBaseName).
    """

    name: str = ""
    nodes: tuple[ListedNode, ...] = ()
    absent: tuple[int, ...] = ()
    eds_folder: str = ""


def read_nodelist(data: bytes, source: str) -> tuple[Nodelist, ...]:
    """Return the networks of a nodelist; *source* is its name for messages.

    Raises InputFileError if *data* is not a nodelist.
    """
    if len(data) > MOST_BYTES:
        raise InputFileError(
            f"{source} is larger than {MOST_BYTES >> 20} MiB", place=f"{source}:1", why="no nodelist is"
        )
    sections = [section for section in split_sections(data).sections if _is_topology(section)]
    if not sections:
        why = "a nodelist (CiA 306-3) has a section [Topology]"
        raise InputFileError(f"{source} is not a nodelist", place=f"{source}:1", why=why)
    return tuple(map(_network, sections))


def _is_topology(section: IniSection) -> bool:
    name = section.name.lower()
    return name == _TOPOLOGY or (name.startswith(_TOPOLOGY) and name[len(_TOPOLOGY) :].isdecimal())


def _network(section: IniSection) -> Nodelist:
    values = section_values([section], Findings())
    nodes, absent = [], []
    for node_id in range(1, _HIGHEST_NODE_ID + 1):
        said = _node(values, node_id)
        if number_key(values, f"node{node_id}present", 0, 0xFF, Findings()):
            nodes.append(said)
        elif said.name or said.dcf:
            absent.append(node_id)
    return Nodelist(_text(values, "netname"), tuple(nodes), tuple(absent), _text(values, "edsbasename"))


def _node(values: Values, node_id: int) -> ListedNode:
    dcf = values.get(f"node{node_id}dcfname", IniValue("", "", 1))
    return ListedNode(node_id, _text(values, f"node{node_id}name"), dcf.value, dcf.line)


def _text(values: Values, key: str) -> str:
    return values[key].value if key in values else ""


def nodelist_text(network: Nodelist) -> str:
    """Return *network* as the text of a nodelist, lines with LF."""
    return "\n".join(["[Topology]", *(f"{key}={_one_line(value)}" for key, value in _keys(network)), ""])


def _keys(network: Nodelist) -> Iterator[tuple[str, str]]:
    yield "NetName", network.name
    yield "Nodes", f"0x{len(network.nodes):02X}"
    for node in network.nodes:
        yield f"Node{node.node_id}Present", "0x01"
        yield f"Node{node.node_id}Name", node.name
        if node.dcf:
            yield f"Node{node.node_id}DCFName", node.dcf
    yield "EDSBaseName", network.eds_folder


def _one_line(text: str) -> str:
    return "".join(char if char.isprintable() else "?" for char in text).strip()
