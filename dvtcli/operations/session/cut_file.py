"""The remark that a device file which the user gave ends in the middle. Loaded only if a file was given."""

from __future__ import annotations

from pathlib import Path

from dvtcli.domain.hint import Action, Hint, verbatim
from dvtcli.files.device_file import lacks_to_its_end, read_device_file
from dvtcli.operations.session.device_files import DeviceFiles
from dvtcli.operations.session.simulated_nodes import file_or_family


def cut_remark(files: DeviceFiles, node_id: int) -> Hint | None:
    """Return the remark that the file given for the node ends in the middle; once, None if there is none."""
    path = _given_file(files, node_id)
    if path is None:
        return None
    lacks = lacks_to_its_end(read_device_file(path, files.modules(node_id, path)))
    if not lacks or not files.is_news(f"{path}: {lacks}"):
        return None
    text = verbatim(f"{path.name} is cut short: {lacks}")
    return Hint(Action.CHECK_EDS, {"file": str(path)}, f"{text}: get the complete file; {{}} lists them")


def _given_file(files: DeviceFiles, node_id: int) -> Path | None:
    """Return the file that the user gave for the node, or simulates; None for the library's or a family's."""
    if node_id in files.own_eds:
        return files.own_eds[node_id]
    if files.options.eds:
        return file_or_family(files.options.eds)
    of_node = (node.eds for node in files.simulated if node.node_id == node_id and node.family is None)
    return next(of_node, None)
