"""Simulated nodes from the words that ask for them: `--sim`, `sim`, and the `--fault` and `--signal` beside them.

Does not know buses, and neither whether the nodes live in this process or are served to others.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.nmt import UNCONFIGURED
from dvtcli.domain.object_dictionary import ObjectDictionary
from dvtcli.errors import InputFileError, UsageError
from dvtcli.files.device_file import VALUE_SUFFIXES, read_device_file
from dvtcli.files.profile.library import profile_of
from dvtcli.files.user_folders import file_state
from dvtcli.operations.user.options import is_file, node_id

if TYPE_CHECKING:
    from dvtcli.domain.profile import DeviceProfile
    from dvtcli.simulator.device.family import Family
    from dvtcli.simulator.device.simulated_faults import Fault
    from dvtcli.simulator.device.strict_device import StrictDevice
    from dvtcli.simulator.network.signals import SimulatedSignal


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


#: why the file of a simulated node describes it
SIMULATED = "simulated from it"


@dataclass(frozen=True, slots=True)
class Simulated:
    """One `--sim`: its node-ID (255: none yet), the family (None for a file), and the file of its dictionary.

    *folder* is where a family of the user's own is, as `learn` writes one; its name is the folder's.
    """

    node_id: int
    family: str | None
    eds: Path
    folder: Path | None = None

    @property
    def holds_values(self) -> bool:
        """Whether its file says what one device holds: a DCF or XDC."""
        return self.eds.suffix.lower() in VALUE_SUFFIXES

    @property
    def label(self) -> str:
        """Which node it is, in words."""
        what = self.family or self.eds.name
        return f"{what} without a node-ID" if self.node_id == UNCONFIGURED else f"node {self.node_id} {what}"


@dataclass(frozen=True, slots=True)
class FileChoice:
    """The file at *path*, *why* it is taken, and what to *note* of it; empty for nothing.

    It is *doubtful* where the note says that it may describe another device.
    """

    path: Path
    why: str
    note: str = ""
    doubtful: bool = False


def simulated_device(one: Simulated) -> StrictDevice:
    """The device that *one* names, INITIALISING; a learnt one holds what it was found with."""
    from dvtcli.simulator.device.strict_device import StrictDevice

    device = StrictDevice(read_dictionary(one.eds).identified(), _family(one), one.node_id)
    if one.folder is not None:
        from dvtcli.files.learnt_folder import found_state

        device.power_on(found_state(one.folder).values)
    return device


def _family(one: Simulated) -> Family:
    from dvtcli.simulator.network.family_file import load_family_folder

    if one.folder is not None:
        return load_family_folder(one.folder)
    return family_named(one.family) if one.family else _family_of_file(read_dictionary(one.eds))


def _family_of_file(dictionary: ObjectDictionary) -> Family:
    """A plain CiA 301 device; the object in which the device's own family tells its NMT state is alive in it, too.

    The family's profile asks that object, and a value that a DCF has for it would be the state for ever. Which accesses
    may be mapped is the family's, too, where the profile allows more than the standard; so is what it keeps without a
    store, since that is what is said of it once it is written.
    """
    profile = profile_of(dictionary)
    known = learnt_family(profile, None) or family_named(profile.name)
    return replace(
        family_named("generic"),
        state_object=known.state_object,
        state_request=known.state_request,
        master_object=known.master_object,
        tpdo_access=known.tpdo_access,
        rpdo_access=known.rpdo_access,
        needs_store=known.needs_store,
        save_command=known.save_command,
    )


def simulated_nodes(words: tuple[str, ...]) -> tuple[Simulated, ...]:
    """What each of *words* means: a file wins over `@`.

    Node-IDs default to the one that a DCF or XDC was made for, or that a device was learnt with, else to the first
    free one.
    A node that waits for its node-ID is `WHAT@255`.
    """
    found: list[Simulated] = []
    for word in words:
        what, wanted = _split(word)
        used = {simulated.node_id for simulated in found}
        chosen = _node_id_of_file(what, used) if wanted is None else wanted
        chosen = chosen if chosen is not None else next((n for n in range(1, 128) if n not in used), 1)
        one = _simulated(what, chosen)
        if chosen == UNCONFIGURED and one in found:
            raise UsageError(f"{word}: nobody could tell two of them apart", hint="give one another identity")
        if chosen != UNCONFIGURED and chosen in used:
            raise UsageError(f"{word}: node-ID {chosen} is given twice", hint="WHAT@ID sets the node-ID")
        found.append(one)
    return tuple(found)


def simulated_faults(words: tuple[str, ...], simulated: tuple[Simulated, ...]) -> tuple[Fault, ...]:
    """What each of the faults *words* means; UsageError for a wrong one, and where no node is simulated."""
    if not words:
        return ()
    if not simulated:
        raise UsageError(
            "only simulated nodes have faults",
            given={"faults": None},
            hint=Hint(Action.GIVE, {"nodes": None}, "give {}")
            + Hint(Action.GIVE_SIMULATED, {"what": "gen4"}, " too: {}")
            + Hint(Action.GIVE, {"faults": "lose-response@3"}, " {}"),
        )
    from dvtcli.simulator.device.faulty import altered, break_device
    from dvtcli.simulator.device.simulated_faults import own_of, read_faults

    try:
        faults = read_faults(words, [simulated_node.node_id for simulated_node in simulated])
        for simulated_node in simulated:
            for fault in own_of(simulated_node.node_id, simulated[0].node_id, faults):
                if fault.place is not None:
                    altered(simulated_device(simulated_node), fault)
                elif fault.kind.of_flash:
                    break_device(simulated_device(simulated_node), fault)
    except ValueError as wrong:
        raise UsageError(str(wrong), given={"faults": None}) from wrong
    return faults


def simulated_signals(words: tuple[str, ...], simulated: tuple[Simulated, ...]) -> tuple[SimulatedSignal, ...]:
    """What each of the signals *words* means.

    UsageError for a wrong one, or without simulated nodes; InputFileError for a file.
    """
    if not words:
        return ()
    if not simulated:
        raise UsageError(
            "only simulated nodes have signals",
            given={"signals": None},
            hint=Hint(Action.GIVE, {"nodes": None}, "give {}")
            + Hint(Action.GIVE_SIMULATED, {"what": "gen4"}, " too: {}")
            + Hint(Action.GIVE, {"signals": "606C=sine(1500,2s)"}, " {}"),
        )
    from dvtcli.simulator.network.signals import RowsError, read_signals

    try:
        return read_signals(
            words, [(simulated_node.node_id, read_dictionary(simulated_node.eds)) for simulated_node in simulated]
        )
    except RowsError as wrong:
        raise InputFileError(
            f"{wrong.place}: {wrong}", place=wrong.place, given={"signals": None}, hint="rows are TIME,VALUE,…"
        ) from wrong
    except OSError as failed:
        raise UsageError(f"{failed.filename}: {failed.strerror or failed}", given={"signals": None}) from failed
    except ValueError as wrong:
        raise UsageError(str(wrong), given={"signals": None}) from wrong


def _split(word: str) -> tuple[str, int | None]:
    from dvtcli.simulator.network.family_file import is_family_folder

    if is_file(word) or "@" not in word or is_family_folder(word):
        return word, None
    what, _, digits = word.rpartition("@")
    return what, UNCONFIGURED if digits == str(UNCONFIGURED) else node_id(digits)


def _node_id_of_file(what: str, used: set[int]) -> int | None:
    """The node-ID that a DCF or XDC was made for, or a folder's device was learnt with; None if unknown, or *used*."""
    from dvtcli.simulator.network.family_file import is_family_folder

    if is_file(what):
        stated = read_dictionary(Path(what)).info.node_id if what.lower().endswith(VALUE_SUFFIXES) else None
    elif is_family_folder(what):
        from dvtcli.files.learnt_folder import found_state

        stated = found_state(Path(what)).node_id
    else:
        return None
    return stated if stated is not None and 1 <= stated <= 127 and stated not in used else None


def _simulated(what: str, chosen: int) -> Simulated:
    from dvtcli.simulator.network.family_file import family_eds, family_folder_eds, family_names, is_family_folder

    path = Path(what)
    if is_file(what):
        return Simulated(chosen, None, path)
    if what in family_names():
        return Simulated(chosen, what, family_eds(what))
    if is_family_folder(what):
        return Simulated(chosen, path.resolve().name, family_folder_eds(path), path)
    known = ", ".join(family_names())
    raise UsageError(
        f"{what}: no such family and no such file",
        hint=f"families: {known}; or the path of an EDS, DCF, XDD or XDC, or of a folder that was learnt",
    )


def family_named(name: str) -> Family:
    """How the family *name* behaves; a plain CiA 301 device where none is called that."""
    from dvtcli.simulator.device.family import Family
    from dvtcli.simulator.network.family_file import family_names, load_family

    return load_family(name) if name in family_names() else Family()


def learnt_family(profile: DeviceProfile, folder: Path | None) -> Family | None:
    """The family that was learnt along with *profile*, or is in *folder*; None where there is none.

    InputFileError where its file is wrong.
    """
    from dvtcli.files.learnt_folder import own_family_path
    from dvtcli.simulator.network.family_file import load_family_folder, read_family, read_text

    if folder is not None:
        return load_family_folder(folder)
    path = own_family_path(profile.name)
    if not profile.learnt or not path.is_file():
        return None
    return read_family(profile.name, read_text(path), str(path))


def file_or_family(text: str | Path) -> Path:
    """The device file at *text*, else the EDS of the simulated family of that name, as served nodes have it."""
    if is_file(str(text)):
        return Path(text)
    from dvtcli.simulator.network.family_file import family_eds, family_names

    return family_eds(str(text)) if str(text) in family_names() else Path(text)


def read_dictionary(path: Path) -> ObjectDictionary:
    """The object dictionary of an EDS, DCF, XDD or XDC as it is now; UsageError where there is no such file.

    InputFileError where it is none of these; of one in the library with what to do about it.
    """
    try:
        return _dictionary(path, None if path.is_absolute() else Path.cwd(), file_state(path))
    except OSError as failed:
        raise UsageError(
            f"{path}: {failed.strerror or failed}",
            hint=Hint(Action.GIVE_EDS, why="takes the path of an EDS, DCF, XDD or XDC, or a simulated family"),
        ) from failed
    except InputFileError as wrong:
        from dvtcli.files.device_library.stored_files import folder

        if not wrong.hint and path.parent == folder():
            wrong.hint = Hint(
                Action.REMOVE_EDS,
                why="it lies in the library: add the file again, or {} takes it out",
            ) + Hint(Action.GIVE_EDS, why="names another")
        raise


#: a bus has 127 nodes: each file is read once, also where every node has its own
@lru_cache(maxsize=128)
def _dictionary(path: Path, _folder: Path | None, _state: tuple[int, ...]) -> ObjectDictionary:
    """What the file at *path*, from *_folder* where it is relative, says since it was changed."""
    from dvtcli.files.device_file import must_describe, read_device_file

    dictionary = read_device_file(path).dictionary
    must_describe(dictionary)
    return dictionary
