"""A node for a program: its commands as methods. Prints nothing."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Literal, TypeVar

from dvtcli.domain.request import Cleared, Switched
from dvtcli.errors import UsageError
from dvtcli.operations.api.arguments import (
    Entry,
    Group,
    Object,
    PdoOptions,
    bytes_of,
    entry_of,
    group_of,
    known_names,
    nmt_command_of,
    object_of,
    pdo_of,
    proof_of,
    request,
)
from dvtcli.operations.api.arguments import type_of as type_named
from dvtcli.operations.api.checks import flags, number, path, whole, word, words
from dvtcli.operations.api.python_read_node import ReadNode

if TYPE_CHECKING:
    from pathlib import Path

    from dvtcli.device.node import Node as DeviceNode
    from dvtcli.domain.datatypes import Value
    from dvtcli.domain.pdo import Pdo
    from dvtcli.domain.request import AnyPdoRequest
    from dvtcli.operations.results import (
        Changed,
        Commanded,
        Faults,
        LearnForecast,
        LearntDevice,
        LoggedIn,
        NetworkApplied,
        ProgramLoaded,
        Stored,
        VpdoListing,
    )


class ConfiguredNode(ReadNode):
    """A node whose PDOs and objects can be changed; `Node` adds store, restore, NMT and more."""

    def write(
        self, object_: Object, value: Value, as_type: str | None = None, *, yes: bool = False, force: bool = False
    ) -> Changed:
        """Write an object by SDO download and verify it; if the read-back differs, the old value is restored.

        Bytes are written as they are, other values as *as_type* or the type in the EDS, a text such as `48V` in its
        unit. Raises UsageError for 0x1010 and 0x1011: use `store` and `restore`.
        """
        from dvtcli.operations.objects.write_object import refuse_signature, write_bytes
        from dvtcli.operations.values.object_values import scaling_of
        from dvtcli.operations.values.write_type import object_type

        def write(node: DeviceNode) -> Changed:
            index, sub_index = object_of(node, object_)
            refuse_signature(node, index)
            kind = type_named(as_type) or object_type(node, index, sub_index)
            meaning = scaling_of(node, index, sub_index)
            data = bytes_of(kind, meaning, value, f"{index:04X}:{sub_index:02X}")
            return write_bytes(self._calls.session, node, index, sub_index, data)

        return self._change(write, yes=yes, force=force)

    @known_names
    def map(  # noqa: PLR0913 - every option of a PDO by its name
        self,
        pdo: str | Pdo,
        *objects: Entry,
        cob_id: int | Literal["auto", "keep"] | None = None,
        transmission_type: int | None = None,
        sync: int | None = None,
        event: bool | None = None,
        inhibit_ms: float | None = None,
        timer_ms: float | None = None,
        sync_start: int | None = None,
        rtr: bool | None = None,
        extended: bool | None = None,
        enabled: bool | None = True,
        yes: bool = False,
        force: bool = False,
    ) -> Changed:
        """Map *objects* into a PDO, in frame order, and enable it: as the command `map`.

        Options that are None stay unchanged:

        - *cob_id*: the CAN-ID, 1…0x7FF, with *extended* up to 0x1FFFFFFF; `"auto"` or `"keep"`
        - *transmission_type*: 0…255; or in its place *sync*: on every N-th SYNC, 1…240; or *event*: event-driven (255)
        - *inhibit_ms*: the inhibit time in ms, 0…6553.5 in steps of 0.1; 0 is off
        - *timer_ms*: the event timer in ms, 0…65535 in steps of 1; 0 is off
        - *sync_start*: the SYNC start value, 0…240
        - *rtr*: whether the PDO may be asked for by RTR (bit 30 of the COB-ID)
        - *extended*: the CAN-ID has 29 bits
        - *enabled*: whether the PDO exists on the bus afterwards, as it does by default
        """
        from dvtcli.operations.changes.change import configure

        options = PdoOptions(
            cob_id=cob_id, transmission_type=transmission_type, sync=sync, event=event, inhibit_ms=inhibit_ms,
            timer_ms=timer_ms, sync_start=sync_start, rtr=rtr, extended=extended, enabled=enabled,
        )  # fmt: skip
        asked, wanted = request(options), pdo_of(pdo)

        def work(node: DeviceNode) -> Changed:
            mapped = tuple(entry_of(node, wanted_object) for wanted_object in objects)
            return configure(self._calls.session, node, {wanted: replace(asked, objects=mapped)})

        if not objects:
            raise UsageError("which objects? 'statusword', '6C01:1', …")
        return self._change(work, yes=yes, force=force)

    @known_names
    def set(  # noqa: PLR0913 - as for map
        self,
        pdo: str | Pdo,
        *,
        cob_id: int | Literal["auto", "keep"] | None = None,
        transmission_type: int | None = None,
        sync: int | None = None,
        event: bool | None = None,
        inhibit_ms: float | None = None,
        timer_ms: float | None = None,
        sync_start: int | None = None,
        rtr: bool | None = None,
        extended: bool | None = None,
        enabled: bool | None = None,
        yes: bool = False,
        force: bool = False,
    ) -> Changed:
        """Set communication parameters of a PDO without its mapping, like the command `set`.

        Options that are None stay unchanged:

        - *cob_id*: the CAN-ID, 1…0x7FF, with *extended* up to 0x1FFFFFFF; `"auto"` or `"keep"`
        - *transmission_type*: 0…255; or in its place *sync*: on every N-th SYNC, 1…240; or *event*: event-driven (255)
        - *inhibit_ms*: the inhibit time in ms, 0…6553.5 in steps of 0.1; 0 is off
        - *timer_ms*: the event timer in ms, 0…65535 in steps of 1; 0 is off
        - *sync_start*: the SYNC start value, 0…240
        - *rtr*: whether the PDO may be asked for by RTR (bit 30 of the COB-ID)
        - *extended*: the CAN-ID has 29 bits
        - *enabled*: whether the PDO exists on the bus afterwards
        """
        from dvtcli.operations.changes.change import configure

        options = PdoOptions(
            cob_id=cob_id, transmission_type=transmission_type, sync=sync, event=event, inhibit_ms=inhibit_ms,
            timer_ms=timer_ms, sync_start=sync_start, rtr=rtr, extended=extended, enabled=enabled,
        )  # fmt: skip
        if all(value is None for value in options.values()):
            raise UsageError("nothing to set: give transmission_type, timer_ms, cob_id or another option")
        asked, wanted = request(options), pdo_of(pdo)
        return self._change(lambda node: configure(self._calls.session, node, {wanted: asked}), yes=yes, force=force)

    def enable(self, *pdos: str | Pdo, yes: bool = False, force: bool = False) -> Changed:
        """Enable PDOs with the mapping they have, all or none."""
        return self._switch(pdos, Switched(enabled=True), yes=yes, force=force)

    def disable(self, *pdos: str | Pdo, yes: bool = False, force: bool = False) -> Changed:
        """Disable PDOs, all or none; their mapping stays."""
        return self._switch(pdos, Switched(enabled=False), yes=yes, force=force)

    def clear(self, *pdos: str | Pdo | Literal["all"], yes: bool = False, force: bool = False) -> Changed:
        """Disable PDOs and clear their mappings, all or none; `"all"` are PDOs with a changeable mapping."""
        from dvtcli.operations.pdos.edit_pdos import clear_all

        if pdos == ("all",):
            return self._change(lambda node: clear_all(self._calls.session, node.node_id), yes=yes, force=force)
        return self._switch(pdos, Cleared(), yes=yes, force=force)

    def _switch(self, pdos: tuple[str | Pdo, ...], want: AnyPdoRequest, *, yes: bool, force: bool) -> Changed:
        from dvtcli.operations.pdos.edit_pdos import switch

        if not pdos:
            raise UsageError("which PDO? 'tpdo1', …")
        wanted = [pdo_of(pdo) for pdo in pdos]
        return self._change(lambda node: switch(self._calls.session, node.node_id, wanted, want), yes=yes, force=force)

    def undo(self, *, everything: bool = False, yes: bool = False, force: bool = False) -> Changed:
        """Undo the last change of the node, or with *everything* all of them.

        Changes are this program's; if there are none, or all are undone, those of earlier programs and commands on a
        real bus. False, with `not_put_back`, if the node does not take its old values. Raises SafetyRefusal if the node
        holds another value than the change left, UsageError if there is no change.
        """
        from dvtcli.operations.changes.undo import undo_on

        flags(everything=everything)
        return self._change(
            lambda node: undo_on(self._calls.session, node.node_id, everything=everything), yes=yes, force=force
        )

    def tie(
        self, group: str, pin: int | None, object_: str | int | None, *, yes: bool = False, force: bool = False
    ) -> Changed | VpdoListing:
        """Tie *pin* (1 and up) of a group of virtual PDOs to an object, by name or index; None unties it.

        *pin* None, without an object, unties every pin of the group. If nothing changes, nothing is written, and the
        result is that of `vpdo`. Raises UsageError for an unknown object or group, DvtcliError for an unknown pin.
        """
        from dvtcli.operations.pdos.virtual_pdo_ties import tie_pin

        word("group", group, "the name of a group, such as 'digital-in'")
        number_of = 0 if pin is None else whole("pin", pin, "a pin", 254, low=1)
        if pin is None and object_ is not None:
            raise UsageError("all pins of a group can be unlinked together, but not linked: give None as the object")
        if isinstance(object_, int):
            object_ = f"{whole('object_', object_, 'an index', 0xFFFF):04X}"
        text = None if object_ is None else word("object_", object_, "an object's name or index: 'throttle', 0x2220")
        session, node_id = self._calls.session, self._node_id
        return self._change(lambda _: tie_pin(session, group, number_of, text, node_id), yes=yes, force=force)

    def apply(
        self, file: str | Path, *, include: Sequence[str] = (), yes: bool = False, force: bool = False
    ) -> NetworkApplied:
        """Write the differing configuration of *file*, a DCF, an XDC or a backup (.jsonl): all or nothing.

        *include* are manufacturer-specific objects to write as well: `2001`, `2001:1` or `2000-2FFF`. Asks, unless
        *yes*. Raises SafetyRefusal if the node is another product, or its power stage is enabled.
        """
        return self._apply_file(file, include, is_clone=False, yes=yes, force=force)

    def clone(
        self, file: str | Path, *, include: Sequence[str] = (), yes: bool = False, force: bool = False
    ) -> NetworkApplied:
        """Copy the configuration of another device of the same product from *file*, with the maker's objects.

        Leaves out objects that a PDO can map, node-IDs, commands, outputs and passcodes. The result is false if a
        differing setting was not written: the clone is incomplete.
        """
        return self._apply_file(file, include, is_clone=True, yes=yes, force=force)

    def _apply_file(
        self, file: str | Path, include: Sequence[str], *, is_clone: bool, yes: bool, force: bool
    ) -> NetworkApplied:
        from dvtcli.operations.devices.plan_device import DeviceOptions, apply_device

        options, chosen = DeviceOptions(words("include", include), is_clone, (self.node_id,)), str(path("file", file))
        return self._change(lambda _node: apply_device(self._calls.session, chosen, options), yes=yes, force=force)

    def _change(self, work: Callable[[DeviceNode], T], *, yes: bool, force: bool) -> T:
        calls = self._calls
        return calls.run(lambda: work(calls.session.node(self._node_id)), changes=True, yes=yes, force=force)


class Node(ConfiguredNode):
    """A node on a `Bus`, as returned by `Bus.node`; identified at first use.

    Every method raises the errors of `dvtcli.errors`: NoAnswer if the node is silent, SdoAborted if it refuses,
    BusUnavailable if the bus fails. Writing methods check first (RuleError), roll back if they cannot complete
    (DeviceRefused, LeftChanged) and take *yes* and *force*: *yes* answers the questions of a command, such as whether a
    node may leave OPERATIONAL; without it a question raises SafetyRefusal. *force* sends what dvtcli's own rules
    refuse.
    """

    def store(
        self,
        group: Group = "all",
        *,
        prove: bool | Literal["power"] = False,
        if_changed: bool = False,
        within_s: float = 60.0,
        yes: bool = False,
        force: bool = False,
    ) -> Stored:
        """Store the node's parameters (0x1010); true if acknowledged, and proved if *prove* was asked for.

        A dry run proves nothing: with *prove* its result is not true, and its `proof` None.

        *prove* resets the node and compares its values (consent if a drive is operation enabled); `"power"` waits up to
        *within_s* seconds until it was switched off and on. *if_changed* spares the EEPROM: sends nothing if the node
        still holds what it booted with.
        """
        from dvtcli.operations.changes.store_restore import store_settings

        flags(if_changed=if_changed)
        number("within_s", within_s, "a number of seconds, 0 or more")
        way = proof_of(prove)
        if way and if_changed:
            raise UsageError(
                "with if_changed nothing may be stored, and prove would then prove nothing: give only one of them"
            )
        chosen = group_of(group)
        return self._change(
            lambda node: store_settings(
                self._calls.session, node, chosen, prove=way, if_changed=if_changed, wait_s=within_s
            ),
            yes=yes,
            force=force,
        )

    def restore(self, group: Group = "all", *, prove: bool = False, yes: bool = False, force: bool = False) -> Stored:
        """Restore the node's defaults (0x1011) with its next reset, which *prove* does at once; needs *yes*."""
        from dvtcli.operations.changes.store_restore import restore_defaults

        flags(prove=prove)
        chosen = group_of(group)
        return self._change(
            lambda node: restore_defaults(self._calls.session, node, chosen, prove=prove), yes=yes, force=force
        )

    def download(
        self,
        file: str | Path,
        *,
        program: int = 1,
        expect: int | Literal["crc32"] | None = None,
        yes: bool = False,
        force: bool = False,
    ) -> ProgramLoaded:
        """Load a program file (.bin, .hex) as *program* (1..254), start it and verify it, like `download`.

        *expect* is the required software identification (0x1F56), "crc32" for the CRC-32 of the data, None for the
        profile's, if any; needs *yes*. LeftChanged has the device's state if it failed after the old program was
        cleared.
        """
        from dvtcli.operations.nodes.load_program import load_program

        whole("program", program, "a program", 254, low=1)
        session, node_id = self._calls.session, self._node_id
        return self._calls.run(
            lambda: load_program(session, str(file), number=program, expect=expect, node_id=node_id),
            changes=True, yes=yes, force=force,
        )  # fmt: skip

    def nmt(
        self, command: Literal["start", "stop", "preop", "reset-node", "reset-comm"], *, yes: bool = False
    ) -> Commanded:
        """Send an NMT command and verify it; true if the node is in the commanded state.

        The reset of a drive in operation enabled needs *yes*.
        """
        from dvtcli.operations.nodes.command_nmt import command_nmt

        specifier = nmt_command_of(command)
        session = self._calls.session
        return self._calls.run(lambda: command_nmt(session, specifier, self._node_id), yes=yes)

    def login(self, passcode: int = 0, level: int | None = None, *, user: int | None = None) -> LoggedIn:
        """Log in at *level* (0…255; None: the level for PDO work; 0 logs out) with *passcode* (0…0xFFFF).

        *user* is the user ID (1…65535), None for the family's. The passcode is not stored, nor repeated in an error.
        Raises DvtcliError if the device has no login, DeviceRefused if it rejects the passcode.
        """
        from dvtcli.operations.nodes.log_in import log_in

        if isinstance(passcode, bool) or not isinstance(passcode, int) or not 0 <= passcode <= 0xFFFF:
            raise UsageError("passcode: a passcode is 0…65535 (0x0…0xFFFF)")
        if level is not None:
            whole("level", level, "an access level", 0xFF)
        if user is not None:
            whole("user", user, "a user ID", 0xFFFF, low=1)
        session = self._calls.session
        return self._calls.run(lambda: log_in(session, lambda *_: passcode, level, user, self._node_id))

    def clear_faults(self) -> Faults:
        """Clear the node's error history (0x1003) and verify; the rows are its old entries.

        Errors themselves stay. Raises DeviceRefused if the node has no history, DvtcliError if it is not empty
        afterwards.
        """
        from dvtcli.operations.frames.show_faults import clear_faults

        return self._change(lambda node: clear_faults(self._calls.session, node.node_id), yes=False, force=False)

    def recover(self, *, yes: bool = False, force: bool = False) -> Changed | None:
        """Roll back an interrupted change of the node; needs *yes*.

        Other nodes of the same atomic script are rolled back, too. None if no change was interrupted; false, with
        `not_put_back`, if the node does not take its old values.
        """
        from dvtcli.operations.changes.recover_change import recover
        from dvtcli.operations.results import Changed, ChangedNodes

        def finish(node: DeviceNode) -> Changed | None:
            with self._calls.session.selecting(node.node_id):
                done = recover(self._calls.session)
            if isinstance(done, ChangedNodes):
                return next((changed for changed in done.nodes if changed.node == node.node_id), None)
            return done if isinstance(done, Changed) else None

        return self._change(finish, yes=yes, force=force)

    def learn(
        self,
        *,
        save: str | None = None,
        compare: str | Path | None = None,
        isolated: bool = False,
        with_store: bool = False,
        yes: bool = False,
        force: bool = False,
    ) -> LearntDevice | LearnForecast:
        """Learn what the node's PDOs accept, and roll back; needs *yes*, and starts no node.

        *save* writes a profile and a simulated family to the folder of this name. *compare* is a profile's name or such
        a folder: the result is false if the device differs. *isolated* asserts that nothing else is on the bus, so that
        restricted CAN-IDs are tested, too; *with_store* allows the node to store, with at most two writes to 0x1010. A
        dry run returns what would be tested. Raises UsageError for an invalid name or profile.
        """
        from dvtcli.operations.devices.learn_device import learn

        flags(isolated=isolated, with_store=with_store)
        if save is not None:
            word("save", save, "the name of a profile, and of the folder for it")
        against = None if compare is None else str(path("compare", compare))
        session = self._calls.session
        return self._change(
            lambda node: learn(
                session, node.node_id, save=save, compare=against, isolated=isolated, with_store=with_store
            ),
            yes=yes,
            force=force,
        )


T = TypeVar("T")
