"""Write nodes found on a bus or in files as a network file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from dvtcli.device.seen_state import heartbeat_ms, heartbeat_slots
from dvtcli.domain.hint import Action, Hint, verbatim
from dvtcli.domain.network.links import found_links, watched_ms
from dvtcli.domain.network.network_config import NetworkConfig
from dvtcli.domain.text import plural
from dvtcli.errors import SdoAborted
from dvtcli.files.network.write_network import write_network
from dvtcli.operations.results import Facts
from dvtcli.operations.session.save_script import make_file

if TYPE_CHECKING:
    from pathlib import Path

    from dvtcli.domain.pdo import Pdo, PdoConfig
    from dvtcli.domain.ports import SdoReader
    from dvtcli.operations.exchange.export_network import Exported
    from dvtcli.operations.user.session_user import SessionUser


@dataclass(frozen=True, slots=True)
class FoundNode:
    """A node of the network: its export, its PDOs, and the reader of its heartbeats."""

    exported: Exported
    held: Mapping[Pdo, PdoConfig]
    values: SdoReader


def write_found(
    session: SessionUser, path: Path, file: str, title: str, found: list[FoundNode], notes: list[str]
) -> Facts:
    """Write the nodes *found* and their links to *path*, named *file* by the user, under *title*.

    The result has *notes* and the number of errors by `check`.
    """
    nodes = {node.exported.config.node_id: node for node in found}
    links = found_links(
        {node_id: exported_node.held for node_id, exported_node in nodes.items()},
        lambda consumer, producer: _watches(nodes[consumer].values, nodes[producer].values, producer),
    )
    for consumer, producer in links.unlike:
        received, sent = (f"{end.node_id}:{end.pdo}" for end in (consumer, producer))
        notes.append(f"{received} receives {sent}, but their layouts differ: no link")
    options = tuple(exported_node.exported.config for _, exported_node in sorted(nodes.items()))
    remarks = {word: text for node in found for word, text in node.exported.remarks.items()}
    make_file(session, path, write_network(NetworkConfig(options, links.links), title, remarks))
    pdos = sum(len(config.pdos) for config in options)
    counts = f"{plural(len(options), 'node')}, {plural(pdos, 'PDO')}, {plural(len(links.links), 'link')}"
    errors = _errors(file)
    judged = f"{plural(errors, 'error')} to correct first" if errors else "Check it"
    checked = Hint(Action.CHECK, {"file": file}, f"{verbatim(file)}: {counts}. {judged}: {{}}")
    said: list[Hint | str] = [checked, *(f"note: {note}" for note in notes)]
    rows = (
        ("file", file),
        ("nodes", [_row(exported_node) for _, exported_node in sorted(nodes.items())]),
        ("links", len(links.links)),
        ("errors", errors),
        ("notes", notes),
    )
    return Facts("import", rows, tuple(said))


def _errors(file: str) -> int:
    """Count errors by `check` in the written file: not everything that devices hold can be written again."""
    from dvtcli.operations.network.check_networks import CheckOptions, check_networks

    (report,) = check_networks((file,), CheckOptions(as_findings=True)).reports
    return report.count()["error"]


def _row(one: FoundNode) -> dict[str, object]:
    config = one.exported.config
    left_out = list(one.exported.left_out)
    return {"node": config.node_id, "name": config.name, "pdos": len(config.pdos), "left_out": left_out}


def _watches(consumer: SdoReader, producer: SdoReader, producer_id: int) -> bool:
    """Tell whether nothing is left to set up: no heartbeat producer, or the consumer time is long enough."""
    try:
        time_ms = heartbeat_ms(producer) or 0
        return not time_ms or watched_ms(heartbeat_slots(consumer), producer_id) > time_ms
    except SdoAborted:
        return False
