"""A node for a program: its commands as methods. Prints nothing."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from dvtcli.errors import UsageError
from dvtcli.operations.api.arguments import (
    Group,
    group_of,
    nmt_command_of,
    proof_of,
)
from dvtcli.operations.api.checks import flags, number, path, whole, word
from dvtcli.operations.api.configured_node import ConfiguredNode

if TYPE_CHECKING:
    from pathlib import Path

    from dvtcli.device.node import Node as DeviceNode
    from dvtcli.operations.results import (
        Changed,
        Commanded,
        Faults,
        LearnForecast,
        LearntDevice,
        LoggedIn,
        ProgramLoaded,
        Stored,
    )


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
        from dvtcli.operations.stores.store_restore import store_settings

        flags(if_changed=if_changed)
        number("within_s", within_s, "a number of seconds, 0 or more")
        way = proof_of(prove)
        if way and if_changed:
            raise UsageError("if_changed may store nothing, which prove could not prove: give one of them")
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
        from dvtcli.operations.stores.store_restore import restore_defaults

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
        from dvtcli.operations.nodes.show_faults import clear_faults

        return self._change(lambda node: clear_faults(self._calls.session, node.node_id), yes=False, force=False)

    def recover(self, *, yes: bool = False, force: bool = False) -> Changed | None:
        """Roll back an interrupted change of the node; needs *yes*.

        Other nodes of the same atomic script are rolled back, too. None if no change was interrupted; false, with
        `not_put_back`, if the node does not take its old values.
        """
        from dvtcli.operations.recover.recover_change import recover
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
        from dvtcli.operations.known_devices.learn_device import learn

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
