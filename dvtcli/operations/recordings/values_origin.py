"""The origin of recorded values: recorder, nodes, decoder."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.errors import UsageError
from dvtcli.files.values.value_rows import LONG, Origin, ParquetForm

if TYPE_CHECKING:
    from collections.abc import Mapping

    from dvtcli.operations.session.session_nodes import SessionNodes
    from dvtcli.operations.user.session_user import SessionUser
    from dvtcli.watch.decoder import Decoder

#: the largest file with a hash
_MOST_BYTES = 64 << 20


@dataclass(frozen=True, slots=True)
class ValuesOptions:
    """Options of recorded values: *layout* of a .parquet file (None: long), *source* (None: the actual recorder).

    A new file begins by *rotation* (seconds, bytes; 0: never), and with *append* after an existing file.
    *only* are kinds of frames, as in `typed_frame.READ_KINDS`; none: all.
    """

    layout: str | None = None
    source: str | None = None
    rotation: tuple[float, int] = (0.0, 0)
    append: bool = False
    only: frozenset[str] = frozenset()


DEFAULTS = ValuesOptions()


def parquet_form(
    session: SessionNodes,
    path: Path,
    decoder: Decoder,
    options: ValuesOptions,
    recorder: str,
    *,
    asked: tuple[int, ...] = (),
    dbc: str | None = None,
) -> ParquetForm | None:
    """Return the options for *path* if it is a .parquet file; None for other formats.

    *recorder* is the default recorder. Nodes of *decoder* in *asked* are asked for their identity (0x1018); that of
    others is from the network file *dbc*, or from the source of *decoder*.
    """
    if not is_parquet(path):
        if given := {name: None for name in ("layout", "source") if getattr(options, name)}:
            raise UsageError(f"only for a .parquet file, not for {path.name}", given=given, hint="leave it out")
        return None
    layout, source = options.layout or LONG, options.source or recorder
    nodes = sorted({each.service.node for each in decoder.layouts.values() if each.service.node})
    identities = dict(decoder.identities)
    identities.update(_of_file(dbc))
    identities.update({node_id: _of_node(session, node_id) for node_id in nodes if node_id in asked})
    serials = {
        node_id: serial for node_id in nodes if (serial := identities.get(node_id, {}).get("serial")) is not None
    }
    facts = {"layout": layout, "source": source, **_of_bus(session), **_of_files(session, dbc)}
    facts["nodes"] = json.dumps([{"node": node_id, **identities.get(node_id, {})} for node_id in nodes])
    metadata = {f"dvtcli.{key}": text for key, text in facts.items()}
    return ParquetForm(layout, Origin(source, serials, metadata))


def is_parquet(path: Path) -> bool:
    """Tell by its suffix whether *path* is a .parquet file."""
    return path.suffix.lower() == ".parquet"


def _of_bus(session: SessionNodes) -> dict[str, str]:
    from dvtcli.version import __version__

    facts = {"version": __version__}
    wire = session.wire if session.is_open else None
    bit_rate = session.base.bitrate if wire is None else None if wire.simulated else wire.bitrate
    if wire is not None:
        facts["bus"] = wire.name
    if bit_rate is not None:
        facts["bitrate"] = str(bit_rate)
    return facts


def _of_files(session: SessionUser, dbc: str | None) -> dict[str, str]:
    """Return the file that describes the frames, and its SHA-256."""
    from hashlib import sha256

    from dvtcli.files.input_file import read_input
    from dvtcli.operations.session.simulated_nodes import file_or_family

    key, file = ("network_file", Path(dbc)) if dbc is not None else ("eds", None)
    if file is None and session.base.eds is not None:
        file = file_or_family(session.base.eds)
    if file is None:
        return {}
    return {key: file.name, f"{key}_sha256": sha256(read_input(file, _MOST_BYTES, "file of a network")).hexdigest()}


def _of_file(dbc: str | None) -> dict[int, Mapping[str, int | None]]:
    """Return the identities of nodes in the network file *dbc*."""
    if dbc is None or Path(dbc).suffix.lower() not in (".yaml", ".yml"):
        return {}
    from dvtcli.operations.plans.read_network_config import read_network_config

    return {node.node_id: asdict(node.identity) for node in read_network_config(dbc).nodes}


def _of_node(session: SessionNodes, node_id: int) -> Mapping[str, int | None]:
    from dvtcli.device.read_pdos import read_identity
    from dvtcli.domain.network.network_state import IDENTITY_NAMES

    sdo = session.node(node_id).sdo
    return {name: read_identity(sdo, sub_index) for sub_index, name in enumerate(IDENTITY_NAMES, 1)}
