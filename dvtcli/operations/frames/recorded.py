"""Decode recordings: by a DBC or network file, an EDS, or the nodes' mappings."""

from __future__ import annotations

import sys
from contextlib import contextmanager, suppress
from pathlib import Path
from shutil import copyfileobj
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from dvtcli.domain.hint import Action, Hint, verbatim
from dvtcli.errors import DvtcliError, InputFileError, UsageError
from dvtcli.operations.user.refused_options import refuse_options

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dvtcli.domain.network.network_config import NetworkConfig
    from dvtcli.operations.session.session import SessionNodes
    from dvtcli.operations.user.session_user import SessionUser
    from dvtcli.watch.decoder import Address, Decoder


def decoder_for(
    session: SessionNodes,
    nodes: tuple[int, ...] | None,
    dbc: str | None,
    path: Path | None = None,
    config: NetworkConfig | None = None,
) -> Decoder:
    """Return the decoder of a recording: --dbc, else the mapping in --eds, else of the nodes.

    *config* is the network file *dbc* as read, if read already.

    Nodes are read only if named (-n, --nodes, --sim) or a bus is open; else the mappings in SDO transfers of the
    recording at *path* count, and other frames stay bytes.
    """
    from dvtcli.operations.frames.layouts import live_decoder
    from dvtcli.operations.session.simulated_nodes import file_or_family
    from dvtcli.watch.decoder import Decoder

    base = session.base
    if dbc is not None:
        refuse_options({"node_ids": nodes}, f"not used: {dbc} describes the frames", "give only one of them")
        from dvtcli.operations.frames.layouts import file_layouts

        if base.eds is not None:
            session.reporter.note(
                Hint(Action.GIVE, {"eds": base.eds}, f"is not used: {verbatim(dbc)} describes the frames")
            )
        return Decoder(file_layouts(dbc, session.reporter, config))
    if base.eds is not None:
        file, chosen = file_or_family(base.eds), nodes or base.nodes
        decoder = _file_decoder(file, chosen, base.profile, base.modules)
        only = None if chosen or path is None else _only_node(session, path, file, decoder)
        return decoder if only is None else _file_decoder(file, (only,), base.profile, base.modules)
    if base.sim or base.nodes or nodes or session.is_open:
        return live_decoder(session, nodes or ())
    return Decoder() if path is None else _own_decoder(session, path)


def _own_decoder(session: SessionUser, path: Path) -> Decoder:
    """Return the decoder of mappings in SDO transfers of the recording at *path*; empty if none."""
    from dvtcli.domain.network.network_state import IDENTITY_NAMES
    from dvtcli.domain.objects import IDENTITY
    from dvtcli.domain.text import join_some
    from dvtcli.operations.exchange.recorded_network import recorded_network
    from dvtcli.operations.values.object_values import scalings_of
    from dvtcli.watch.decoder import Decoder, pdo_layouts

    decoder = Decoder()
    try:
        state, missing = recorded_network(session, path, throughout=True)
    except UsageError:
        return decoder  # no transfer in it carries a mapping, or they are of several buses
    for node in state.nodes:
        scalings = scalings_of(node.profile, node.dictionary)
        decoder.add(pdo_layouts(node.node_id, node.pdos, node.dictionary, scalings, f"what {path.name} itself tells"))
        decoder.identities[node.node_id] = {
            name: node.number(IDENTITY, sub_index) for sub_index, name in enumerate(IDENTITY_NAMES, 1)
        }
    names = join_some(f"{pdo.label} of node {node.node_id}" for node in state.nodes for pdo in node.pdos)
    left = f"; not {join_some(missing)}" if missing else ""
    session.reporter.note(f"mappings from the SDO transfers in {path.name}: {names}{left}")
    return decoder


def _only_node(session: SessionUser, path: Path, file: Path, decoder: Decoder) -> int | None:
    """Return the only node of the recording at *path* if the EDS *file* was taken for a node without frames in it.

    The node is one with PDOs if any node has PDOs. None, with a note, if there are several, or if *file* is about the
    node that it was taken for.
    """
    from dvtcli.domain.text import all_nodes
    from dvtcli.operations.session.simulated_nodes import read_dictionary
    from dvtcli.watch.service import service_of

    taken = min(decoder.identities)
    addresses = _addresses(path)
    services = [service_of(can_id, extended=extended) for can_id, extended in addresses]
    nodes = {service.node for service in services if service.node}
    if not nodes or taken in nodes or not addresses.isdisjoint(decoder.layouts):
        return None
    senders = sorted({service.node for service in services if service.node and service.kind == "pdo"} or nodes)
    if len(senders) == 1 and read_dictionary(file).info.node_id is None:
        session.reporter.note(f"{file.name} is taken for node {senders[0]}, the only one in {path.name}")
        return senders[0]
    words = f"{file.name} is taken for node {taken}, and {path.name} has {all_nodes(senders)}"
    session.reporter.note(Hint(Action.GIVE, {"node_id": senders[0]}, f"{verbatim(words)}: {{}}"))
    return None


def _addresses(path: Path) -> set[Address]:
    """Return the addresses of all frames at *path*, without error and CAN FD frames, up to its damage.

    The damage is reported when the frames are decoded.
    """
    from dvtcli.files.recordings.recording_file import read_recording

    found: set[Address] = set()
    with suppress(InputFileError):
        found.update((frame.can_id, frame.extended) for frame in read_recording(path))
    return found


def _file_decoder(path: Path, nodes: tuple[int, ...], family: str | None, modules: tuple[str, ...]) -> Decoder:
    """Return the decoder of an EDS, DCF, XDD or XDC for *nodes*, else its own node-ID, else node 1.

    *modules* are those of modular devices, as of `--modules`. Scalings are of the profile *family*, None: of the
    file's identity.
    """
    from dvtcli.device.described_node import FileValues
    from dvtcli.device.read_pdos import present_pdos, read_pdo
    from dvtcli.domain.network.network_state import IDENTITY_NAMES
    from dvtcli.files.profiles import load_profile, profile_of
    from dvtcli.operations.session.simulated_nodes import read_dictionary
    from dvtcli.operations.user.options import modules_of_node
    from dvtcli.operations.values.object_values import scalings_of
    from dvtcli.watch.decoder import Decoder, described_channels, pdo_layouts

    own = read_dictionary(path)
    profile = load_profile(family) if family else profile_of(own)
    decoder = Decoder()
    for node_id in nodes or (own.info.node_id or 1,):
        dictionary = read_dictionary(path, modules_of_node(modules, node_id))
        scalings = scalings_of(profile, dictionary)
        values = FileValues(dictionary, node_id)
        configs = {pdo: read_pdo(values, pdo) for pdo in present_pdos(values, dictionary)}
        decoder.add(pdo_layouts(node_id, configs, dictionary, scalings, f"the mapping in {path.name}"))
        decoder.add(described_channels(node_id, dictionary))
        info = dictionary.info
        numbers = (info.vendor_id, info.product_code, info.revision_number, info.commissioning.lss_serial_number)
        decoder.identities[node_id] = dict(zip(IDENTITY_NAMES, numbers, strict=True))
    return decoder


#: the temporary copy of standard input, and the beginning of its folder's name
_COPY, _FOLDER = "stdin", "dvtcli-"


def is_copy(path: Path) -> bool:
    """Tell whether *path* is the temporary copy by `standard_input`, which no later command can read."""
    return path.name == _COPY and path.parent.name.startswith(_FOLDER)


def shown_path(path: Path) -> str:
    """Return *path* as messages name it: `stdin` for the copy by `standard_input`."""
    return path.name if is_copy(path) else str(path)


@contextmanager
def standard_input(file: str) -> Iterator[Path]:
    """The path of *file*; of `-` a temporary copy of standard input, which a recording is read from twice.

    Errors about the copy name it `stdin`.
    """
    if file != "-":
        yield Path(file)
        return
    with TemporaryDirectory(prefix=_FOLDER) as folder:
        path = Path(folder) / _COPY
        with path.open("wb") as copy:
            copyfileobj(sys.stdin.buffer, copy)
        try:
            yield path
        except DvtcliError as failed:
            failed.text = failed.text.replace(str(path), path.name)
            failed.place = failed.place and failed.place.replace(str(path), path.name)
            raise
