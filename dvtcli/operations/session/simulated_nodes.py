"""Make simulated nodes from words: `--sim`, `sim`, `--fault` and `--signal`."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.nmt import UNCONFIGURED
from dvtcli.domain.object_dictionary import ObjectDictionary
from dvtcli.domain.text import join_some
from dvtcli.errors import InputFileError, UsageError
from dvtcli.files.device_file import VALUE_SUFFIXES, must_describe, read_device_file
from dvtcli.files.profiles import profile_of
from dvtcli.files.user_folders import file_state
from dvtcli.operations.user.options import is_file, modules_of_node, node_id

if TYPE_CHECKING:
    from dvtcli.domain.profile import DeviceProfile
    from dvtcli.simulator.device.family import Family
    from dvtcli.simulator.device.simulated_faults import Fault
    from dvtcli.simulator.device.strict_device import StrictDevice
    from dvtcli.simulator.network.signals import SimulatedSignal


def not_simulated(simulated: Iterable[Simulated]) -> Iterator[str]:
    """Warn of simulated files: values that cannot be known, and values that nothing reads."""
    for path in dict.fromkeys(simulated_node.eds for simulated_node in simulated if simulated_node.holds_values):
        yield from _of_file(path)


def _of_file(path: Path) -> Iterator[str]:
    from dvtcli.files.unread_values import must_tell_values, unread_values

    read = read_device_file(path)
    try:
        must_tell_values(read, str(path))
    except InputFileError as error:
        for complaint in error.complaints:
            yield f"{complaint.file}:{complaint.line}: {complaint.text}: the node is simulated all the same"
    yield from unread_values(read, str(path))


#: what names a device file
DEVICE_FILE_WORDS = "the path of an EDS, DCF, XDD or XDC, a simulated family, or a file of the EDS library"
#: the reason for the file of a simulated node
SIMULATED = "simulated from it"


class Simulated(NamedTuple):
    """A `--sim`: node-ID (255: none yet), family (None for a file), dictionary file.

    *folder* has the user's own family, as `learn` writes it; the family is named after it.
    """

    node_id: int
    family: str | None
    eds: Path
    folder: Path | None = None
    #: the connected modules of a modular device; None: as the file says
    modules: tuple[int, ...] | None = None

    @property
    def dictionary(self) -> ObjectDictionary:
        """Return the object dictionary."""
        return read_dictionary(self.eds, self.modules)

    @property
    def holds_values(self) -> bool:
        """Tell whether its file has the values of a device: a DCF or XDC."""
        return self.eds.suffix.lower() in VALUE_SUFFIXES

    @property
    def label(self) -> str:
        """Name the node in words."""
        what = self.family or self.eds.name
        return f"{what} without a node-ID" if self.node_id == UNCONFIGURED else f"node {self.node_id} {what}"


class FileChoice(NamedTuple):
    """The file at *path*, *why* it was chosen, and a *note*, if any.

    *doubtful*: by the note, it may describe another device.
    """

    path: Path
    why: str
    note: str = ""
    doubtful: bool = False


def simulated_device(one: Simulated) -> StrictDevice:
    """Make the device, INITIALISING; a learnt device has the values found by `learn`."""
    from dvtcli.simulator.device.strict_device import StrictDevice

    device = StrictDevice(one.dictionary.identified(), _family(one), one.node_id)
    if one.folder is not None:
        from dvtcli.files.learnt_folder import found_state

        device.power_on(found_state(one.folder).values)
    return device


def _family(one: Simulated) -> Family:
    from dvtcli.simulator.network.family_file import load_family_folder

    if one.folder is not None:
        return load_family_folder(one.folder)
    return family_named(one.family) if one.family else _family_of_file(one.dictionary)


def _family_of_file(dictionary: ObjectDictionary) -> Family:
    """Return a plain CiA 301 device whose NMT state object, if its own family has one, is live.

    The family's profile reads it, and a DCF's value would stay forever. If its profile allows more than the standard,
    the family decides which accesses may be mapped; it also decides what is kept without a store, as reported after a
    write.
    """
    profile = profile_of(dictionary)
    known = learnt_family(profile, None) or family_named(profile.name)
    return family_named("generic")._replace(
        state_object=known.state_object,
        state_request=known.state_request,
        master_object=known.master_object,
        tpdo_access=known.tpdo_access,
        rpdo_access=known.rpdo_access,
        needs_store=known.needs_store,
        save_command=known.save_command,
    )


def simulated_nodes(words: tuple[str, ...], modules: tuple[str, ...] = ()) -> tuple[Simulated, ...]:
    """Parse *words* into simulated nodes, with *modules* as of `--modules`: a file wins over `@`.

    The node-ID defaults to that of the DCF, XDC or learnt device, else to the first free node-ID. `WHAT@255` is a node
    without node-ID.
    """
    found: list[Simulated] = []
    for word in words:
        what, wanted = _split(word)
        used = {simulated.node_id for simulated in found}
        chosen = _node_id_of_file(what, used) if wanted is None else wanted
        chosen = chosen if chosen is not None else next((n for n in range(1, 128) if n not in used), 1)
        one = _simulated(what, chosen)
        if chosen == UNCONFIGURED and one in found:
            raise UsageError(f"{word}: they could not be distinguished", hint="give one of them another identity")
        if chosen != UNCONFIGURED and chosen in used:
            raise UsageError(f"{word}: node-ID {chosen} was given twice", hint="WHAT@ID sets the node-ID")
        found.append(one)
    return tuple(_with_modules(found, modules)) if modules and found else tuple(found)


def _with_modules(nodes: list[Simulated], words: tuple[str, ...]) -> Iterator[Simulated]:
    """Give each of *nodes* that is modular its modules in *words*; raises UsageError for a node without any."""
    ids, modular = [node.node_id for node in nodes], 0
    for word in words:
        own = word.rpartition(":")[0]
        if own and int(own) not in ids:
            raise UsageError("no such node here", given={"modules": word}, hint=f"here: {', '.join(map(str, ids))}")
    for node in nodes:
        chosen = modules_of_node(words, node.node_id)
        is_own = any(word.startswith(f"{node.node_id}:") for word in words)
        if chosen is not None and (is_own or len(nodes) == 1 or node.dictionary.info.modules.supported):
            read_dictionary(node.eds, chosen)
            modular += 1
            yield node._replace(modules=chosen)
        else:
            yield node
    if not modular:
        raise UsageError("none of these nodes is of a modular device", given={"modules": words[0]})


def simulated_faults(words: tuple[str, ...], simulated: tuple[Simulated, ...]) -> tuple[Fault, ...]:
    """Parse the faults *words*; raises UsageError if invalid, or without simulated nodes."""
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
    """Parse the signals *words*.

    Raises UsageError if invalid, or without simulated nodes; InputFileError for a file.
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
            words, [(simulated_node.node_id, simulated_node.dictionary) for simulated_node in simulated]
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

    if "@" not in word or is_file(word) or is_family_folder(word) or _library_path(word):
        return word, None
    what, _, digits = word.rpartition("@")
    return what, UNCONFIGURED if digits == str(UNCONFIGURED) else node_id(digits)


def _node_id_of_file(what: str, used: set[int]) -> int | None:
    """The node-ID that a DCF or XDC was made for, or a folder's device was learnt with; None if unknown, or *used*."""
    from dvtcli.simulator.network.family_file import is_family_folder

    if path := Path(what) if is_file(what) else _library_path(what):
        stated = read_dictionary(path).info.node_id if path.name.lower().endswith(VALUE_SUFFIXES) else None
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
        return Simulated(chosen, what, family_eds(what), modules=family_named(what).modules or None)
    if is_family_folder(what):
        return Simulated(chosen, path.resolve().name, family_folder_eds(path), path)
    if stored := _library_path(what):
        return Simulated(chosen, None, stored)
    known = ", ".join(family_names())
    raise UsageError(
        f"{what}: no such family and no such file",
        hint=f"families: {known}; or the path of an EDS, DCF, XDD or XDC, or of a folder with a simulated.toml; "
        "or a file of the EDS library",
    )


def _library_path(what: str) -> Path | None:
    """Return the file of the library that *what* names; None for a family, a learnt folder, or an unknown name."""
    from dvtcli.simulator.network.family_file import family_names, is_family_folder

    if what in family_names() or is_family_folder(what):
        return None
    from dvtcli.files.device_library import file_named

    return file_named(what)


def family_named(name: str) -> Family:
    """Return the family *name*; a plain CiA 301 device if unknown."""
    from dvtcli.simulator.device.family import Family
    from dvtcli.simulator.network.family_file import family_names, load_family

    return load_family(name) if name in family_names() else Family()


def learnt_family(profile: DeviceProfile, folder: Path | None) -> Family | None:
    """Return the family learnt with *profile*, or in *folder*; None if there is none.

    Raises InputFileError if its file is invalid.
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
    """Return the device file at *text*, else the EDS of the simulated family, else the library file of that name.

    Returns *text* as a path if it is none of these; raises UsageError if several files of the library have this name.
    """
    if is_file(str(text)):
        return Path(text)
    from dvtcli.simulator.network.family_file import family_eds, family_names

    if str(text) in family_names():
        return family_eds(str(text))
    from dvtcli.files.device_library import file_named

    return file_named(str(text)) or Path(text)


def read_dictionary(path: Path, modules: tuple[int, ...] | None = None) -> ObjectDictionary:
    """Read the dictionary of an EDS, DCF, XDD or XDC; raises UsageError if the file does not exist.

    *modules* are those of a modular device, None: as the file says; raises UsageError for one that it does not have.
    Raises InputFileError if it is none of these; for a library file with a remedy.
    """
    try:
        dictionary = _dictionary(path, None if path.is_absolute() else Path.cwd(), file_state(path), modules)
    except OSError as failed:
        raise UsageError(
            f"{path}: {failed.strerror or failed}",
            hint=Hint(Action.GIVE_EDS, why=f"takes {DEVICE_FILE_WORDS}"),
        ) from failed
    except InputFileError as wrong:
        from dvtcli.files.device_library import folder

        if not wrong.hint and path.parent == folder():
            wrong.hint = Hint(
                Action.REMOVE_EDS,
                why="it is in the library: add the file again, or {} removes it",
            ) + Hint(Action.GIVE_EDS, why="names another")
        raise
    if modules is not None:
        must_have_modules(dictionary, modules)
    return dictionary


def must_have_modules(dictionary: ObjectDictionary, modules: Collection[int]) -> None:
    """Raise UsageError if the file of *dictionary* does not describe all of *modules*."""
    if why := why_no_modules(dictionary, modules):
        raise UsageError(why, place=dictionary.source, given={"modules": ",".join(map(str, modules))})


def why_no_modules(dictionary: ObjectDictionary, modules: Collection[int]) -> str:
    """Tell which of *modules* the file of *dictionary* does not describe; empty if it does."""
    supported = dictionary.info.modules.supported
    if not supported:
        return f"{dictionary.source} is of no modular device: it has no [SupportedModules]"
    unknown = dictionary.info.modules.without_description(modules)
    known = ", ".join(f"{number} {name}".rstrip() for number, name in supported.items())
    return f"{dictionary.source} has no module {join_some(map(str, unknown))}; it has {known}" if unknown else ""


#: a bus has 127 nodes: each file is read once, even if every node has its own
@lru_cache(maxsize=128)
def _dictionary(
    path: Path, _folder: Path | None, _state: tuple[int, ...], modules: tuple[int, ...] | None
) -> ObjectDictionary:
    """Cache the dictionary at *path* (relative to *_folder*) until the file changes."""
    dictionary = read_device_file(path, modules).dictionary
    must_describe(dictionary)
    return dictionary
