"""What a DCF or XDC says of values and the node that is simulated by it has not. Reads the file; simulates nothing."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.errors import InputFileError
from dvtcli.files.device_file import read_device_file

if TYPE_CHECKING:
    from dvtcli.operations.opening.simulated_nodes import Simulated


def not_simulated(simulated: Iterable[Simulated]) -> Iterator[str]:
    """What to tell whoever simulates nodes by such files: a value that cannot be known, and those that nobody reads."""
    for path in dict.fromkeys(simulated_node.eds for simulated_node in simulated if simulated_node.holds_values):
        yield from _of_file(path)


def _of_file(path: Path) -> Iterator[str]:
    from dvtcli.files.lost_values import must_tell_values
    from dvtcli.files.unread_values import unread_values

    read = read_device_file(path)
    try:
        must_tell_values(read, str(path))
    except InputFileError as error:
        for complaint in error.complaints:
            yield f"{complaint.file}:{complaint.line}: {complaint.text}: the node is simulated all the same"
    yield from unread_values(read, str(path))
