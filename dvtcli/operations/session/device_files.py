"""Choose EDS and profile of a node: by the user, by its simulation, else by its identity."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.device.file_fits import unlike_file
from dvtcli.device.read_pdos import ReadCache, read_identity, read_modules, read_optional
from dvtcli.domain.hint import Action, Hint, verbatim
from dvtcli.domain.object_dictionary import ObjectDictionary
from dvtcli.domain.objects import IDENTITY
from dvtcli.domain.ports import CanopenBus, SdoReader
from dvtcli.domain.profile import DeviceProfile
from dvtcli.domain.text import join_some
from dvtcli.errors import SdoAborted
from dvtcli.files.profiles import (
    builtin_for_identity,
    has_profile,
    load_folder_profile,
    load_profile,
    own_names,
    profile_for_identity,
    profile_names,
    profile_of,
)
from dvtcli.operations.session.simulated_nodes import (
    SIMULATED,
    FileChoice,
    Simulated,
    file_or_family,
    read_dictionary,
    simulated_nodes,
)
from dvtcli.operations.user.options import Options, modules_of_node

if TYPE_CHECKING:
    from dvtcli.files.device_library import Match

#: revision and serial number, as sub-indices of 0x1018
_TOLD = (3, 4)


def found_file(node: SdoReader) -> FileChoice | None:
    """Find the file for *node* by its identity; None if unknown."""
    from dvtcli.files.device_library import assigned, match, stored_files

    files = stored_files()
    vendor, product = read_identity(node, 1), _product(node)
    if vendor is None or product is None:
        return None
    if any((file.vendor_id, assigned(file.product_code)) == (vendor, assigned(product)) for file in files):
        found = match(files, vendor, product, read_identity(node, 3))
        if found is not None:
            family = _of_family(node, vendor, product) if found.of_other_revision else None
            return family or as_choice(found)
    return _of_family(node, vendor, product)


def _product(node: SdoReader) -> int | None:
    """Return the product number (1018:02); 0 if the device has no such sub-index, None if it refuses the read."""
    try:
        return read_optional(node, IDENTITY, 2, 4) or 0
    except SdoAborted:
        return None


def as_choice(found: Match) -> FileChoice:
    """Return *found* with its reason in words."""
    return FileChoice(found.file.path, f"library: {found.why}", found.note, found.doubtful)


def _of_family(node: SdoReader, vendor: int, product: int) -> FileChoice | None:
    """Return the EDS of a simulated family if all four numbers of the identity match.

    A real device of the family has another serial number, and its own EDS. A learnt profile does not matter here.
    """
    from dvtcli.simulator.network.family_file import family_eds, family_names

    name = builtin_for_identity(vendor, product).name
    if name not in family_names() or not product:
        return None

    path = family_eds(name)
    family = read_dictionary(path)
    if (family.info.vendor_id, family.info.product_code) != (vendor, product):
        return None
    for sub in _TOLD:
        entry = family.entry(IDENTITY, sub)
        if entry is None or _held(node, sub) != entry.initial(0):
            return None
    return FileChoice(path, f"family {name}: its identity and serial number are the simulated one's")


def _held(node: SdoReader, sub_index: int) -> bytes | None:
    try:
        return node.upload(IDENTITY, sub_index)
    except SdoAborted:
        return None


def with_modules_of(path: Path, chosen: tuple[int, ...] | None, device: SdoReader) -> ObjectDictionary:
    """Read the dictionary at *path* with the *chosen* modules; None: those of the module list (0x1027) of *device*."""
    if chosen is not None:
        return read_dictionary(path, chosen)
    dictionary = read_dictionary(path)
    modules = dictionary.info.modules
    if not modules.supported or modules.connected or (attached := read_modules(device)) is None:
        return dictionary
    return read_dictionary(path, modules.with_description(attached))


@dataclass(frozen=True, slots=True)
class DeviceFiles:
    """The files of the nodes on *bus*, including *simulated* nodes, by *options*."""

    bus: CanopenBus
    options: Options
    simulated: tuple[Simulated, ...] = ()
    #: EDS, profiles and modules chosen for single nodes
    own_eds: dict[int, Path] = field(default_factory=dict)
    own_profile: dict[int, str] = field(default_factory=dict)
    own_modules: dict[int, tuple[int, ...]] = field(default_factory=dict)
    _memories: dict[int, ReadCache] = field(default_factory=dict)
    #: remarks already made about files and the bus
    _said: set[str] = field(default_factory=set)

    def read_cache(self, node_id: int) -> ReadCache:
        """Return the cached reader for a node's identity."""
        return self._memories.setdefault(node_id, ReadCache(self.bus, node_id, lambda: self.bus.sdo(node_id)))

    def forget(self, node_id: int) -> None:
        """Drop the cached identity of a node: another device may be there."""
        self._memories.pop(node_id, None)

    def chosen(self) -> tuple[dict[int, Path], dict[int, str], dict[int, tuple[int, ...]]]:
        """Return the EDS, profiles and modules chosen for single nodes."""
        return dict(self.own_eds), dict(self.own_profile), dict(self.own_modules)

    def choose(self, chosen: tuple[dict[int, Path], dict[int, str], dict[int, tuple[int, ...]]]) -> None:
        """Set the EDS, profiles and modules of single nodes to *chosen*, as returned by `chosen`."""
        for own in (self.own_eds, self.own_profile, self.own_modules):
            own.clear()
        eds, profiles, modules = chosen
        self.own_eds.update(eds)
        self.own_profile.update(profiles)
        self.own_modules.update(modules)

    def unlike(self, node_id: int, dictionary: ObjectDictionary | None) -> str:
        """Describe how the node differs from the device of *dictionary*, if the user chose the file."""
        if dictionary is None or not (self.options.eds or node_id in self.own_eds):
            return ""
        vendor, product = (read_identity(self.read_cache(node_id), sub) for sub in (1, 2))
        return unlike_file(node_id, dictionary, (vendor, product))

    def dictionary(self, node_id: int) -> ObjectDictionary | None:
        """Return the object dictionary of a node; None if no file is known."""
        path = self.eds_path(node_id)
        return None if path is None else read_dictionary(path, self.modules(node_id, path))

    def modules(self, node_id: int, path: Path) -> tuple[int, ...] | None:
        """Return the connected modules of a node described by *path*, None for those that the file names, or none.

        They are the user's, else those of the simulated node, else those in the node's module list (0x1027), up to the
        first that nothing describes.
        """
        described = read_dictionary(path).info.modules
        chosen = self._chosen_modules(node_id)
        if chosen is not None and (described.supported or node_id in self.own_modules or self.options.eds):
            return chosen
        attached = self._attached(node_id, path)
        return None if attached is None else described.with_description(attached)

    def _chosen_modules(self, node_id: int) -> tuple[int, ...] | None:
        """Return the modules that the user chose for a node, or those of its simulation."""
        if (own := self.own_modules.get(node_id)) is not None:
            return own
        if any(node.node_id == node_id for node in self.simulated):
            return next(node.modules for node in self.simulated if node.node_id == node_id)
        return modules_of_node(self.options.modules, node_id)

    def _attached(self, node_id: int, path: Path) -> tuple[int, ...] | None:
        """Return the module list (0x1027) of a node; None where nobody needs it, or it cannot be read."""
        described = read_dictionary(path).info.modules
        is_asked = described.supported and not described.connected and self._chosen_modules(node_id) is None
        return read_modules(self.read_cache(node_id)) if is_asked else None

    def _unlike_modules(self, node_id: int, path: Path) -> str:
        """Describe how the modules by the file or the user differ from the node's own list; empty if they do not."""
        chosen = self._chosen_modules(node_id)
        dictionary = read_dictionary(path, chosen)
        if not dictionary.info.modules.connected:
            return ""
        attached = read_modules(self.read_cache(node_id))
        name = f"{path.name} has modules" if chosen is None else "the chosen modules are"
        return dictionary.info.modules.unlike(attached, name, node_id)

    def module_remark(self, node_id: int) -> Hint | None:
        """Return a remark about modules of the node that nothing describes; once, None if there is none."""
        path = self.eds_path(node_id)
        if path is None or not (described := read_dictionary(path).info.modules).supported:
            return None
        if (unlike := self._unlike_modules(node_id, path)) and self.is_news(unlike):
            own = ",".join(map(str, read_modules(self.read_cache(node_id)) or ()))
            return Hint(
                Action.GIVE, {"modules": own}, f"{verbatim(unlike)}: its objects may differ; {{}} names its modules"
            )
        attached = self._attached(node_id, path)
        if attached is None and (described.connected or self._chosen_modules(node_id) is not None):
            return None
        unknown = described.without_description(attached or ())
        if unknown:
            text = (
                f"module {join_some(map(str, unknown))} of its list (0x1027) is not in {path.name}, and nothing says"
                " which objects the modules from there on add"
            )
        else:
            text = f"{path.name} is for a modular device, but its modules are unknown"
        if (attached is not None and not unknown) or not self.is_news(f"{node_id}: {text}"):
            return None
        return Hint(Action.GIVE, {"modules": "1,1,2"}, f"node {node_id}: {verbatim(text)}: {{}} does, by their numbers")

    def eds_path(self, node_id: int) -> Path | None:
        """Return the path of a node's EDS; None if unknown."""
        chosen = self.choice(node_id)
        return None if chosen is None else chosen.path

    def choice(self, node_id: int, said: SdoReader | None = None) -> FileChoice | None:
        """Return the file that describes a node, with the reason; None if unknown.

        *said* has known values of the node, so that it need not be read.
        """
        if node_id in self.own_eds:
            return FileChoice(self.own_eds[node_id], "chosen for this node")
        if self.options.eds:
            return FileChoice(file_or_family(self.options.eds), "chosen for every node")
        for simulated in self.simulated:
            if simulated.node_id == node_id:
                return FileChoice(simulated.eds, SIMULATED)

        return found_file(said or self.read_cache(node_id))

    def remark(self, node_id: int) -> tuple[str, bool]:
        """Return a remark about the node's file, and whether it is a warning; once for all its nodes.

        Empty if there is none.
        """
        chosen = self.choice(node_id)
        if chosen is None or not chosen.note or not self.is_news(chosen.note):
            return "", False
        return f"node {node_id}: {chosen.note}", chosen.doubtful

    def has_given_file(self, node_id: int) -> bool:
        """Tell whether the user gave a file for the node, or simulates one."""
        return node_id in self.own_eds or bool(self.options.eds) or any(not node.family for node in self.simulated)

    def continue_from(self, before: DeviceFiles) -> None:
        """Continue from *before* on the reopened bus: its remarks are not repeated."""
        self._said.update(before._said)

    def was_said(self, note: str) -> None:
        """Record *note* as shown."""
        self._said.add(note)

    def is_news(self, note: str) -> bool:
        """Tell whether *note* is new, and record it."""
        news = note not in self._said
        self._said.add(note)
        return news

    def profile(self, node_id: int) -> DeviceProfile:
        """Return the profile of a node, the generic profile if its family is unknown."""
        if node_id in self.own_profile:
            return load_profile(self.own_profile[node_id])
        if self.options.profile:
            return load_profile(self.options.profile)
        for simulated in self.simulated:
            if simulated.node_id == node_id and simulated.folder is not None and has_profile(simulated.folder):
                return load_folder_profile(simulated.folder)
            if simulated.node_id == node_id and simulated.family in profile_names():
                return self._simulated_profile(node_id, simulated.family)
        vendor, product = (read_identity(self.read_cache(node_id), sub) for sub in (1, 2))
        if not vendor:  # a device that does not say who it is (0 is nobody's number): its file does
            return profile_of(self.dictionary(node_id))
        return profile_for_identity(vendor, product or 0)

    def _simulated_profile(self, node_id: int, family: str) -> DeviceProfile:
        """Return the user's profile for the identity in a simulated node's file, else its family's."""
        if own := own_names():
            found = profile_of(self.dictionary(node_id))
            if found.name in own:
                return found
        return load_profile(family)


def offline_dictionaries(options: Options) -> list[tuple[ObjectDictionary, DeviceProfile]]:
    """Return the dictionaries, with profiles, that are known before a bus is opened."""
    found = []
    if options.eds:
        chosen = options.chosen_modules
        dictionaries = [read_dictionary(file_or_family(options.eds), chosen)]
    else:
        dictionaries = [node.dictionary for node in simulated_nodes(options.sim, options.modules)]
    for dictionary in dictionaries:
        profile = load_profile(options.profile) if options.profile else profile_of(dictionary)
        found.append((dictionary, profile))
    return found
