"""One node for a program: what its commands do, as methods. Knows no words of a command line and prints nothing."""

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
    """A node on a `Bus`, as `Bus.node` hands it out; it is asked who it is when it is first used.

    Every method raises the errors of `dvtcli.errors`: NoAnswer where the node is silent, SdoAborted where it refuses,
    BusUnavailable where the bus fails. Those that write check first (RuleError), put back what cannot be finished
    (DeviceRefused, LeftChanged) and take *yes* and *force*: *yes* answers the questions that a command would ask, such
    as whether a node may leave OPERATIONAL; without it a question is SafetyRefusal. *force* sends what dvtcli's own
    rules refuse.
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
        """Store what the node holds (0x1010); true where it took that, and where *prove* shows what it should.

        A dry run proves nothing: with *prove* its answer is not true, and its `proof` None.

        *prove* resets the node and compares what it comes up with (consent where a drive says operation enabled);
        `"power"` waits up to *within_s* seconds until it was switched off and on. *if_changed* spares the EEPROM:
        nothing is sent where the node holds what it came up with.
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
        """Bring the node's defaults back with its next reset (0x1011), which *prove* does at once; needs *yes*."""
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
        """Load a program file (.bin, .hex) as *program* (1..254), start it and see it run: as the command `download`.

        *expect* is what its software identification (0x1F56) has to be, "crc32" for the CRC-32 of what is sent, None
        for what the node's profile says, if anything; needs *yes*. LeftChanged says what the device holds where it
        failed once the old program was cleared.
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
        """Send an NMT command and see that it worked; true where the node is seen in the state it was told to take.

        The reset of a drive that says operation enabled needs *yes*.
        """
        from dvtcli.operations.nodes.command_nmt import command_nmt

        specifier = nmt_command_of(command)
        session = self._calls.session
        return self._calls.run(lambda: command_nmt(session, specifier, self._node_id), yes=yes)

    def login(self, passcode: int = 0, level: int | None = None, *, user: int | None = None) -> LoggedIn:
        """Log in at *level* (0…255; None: the one that PDO work needs; 0 logs out) with *passcode* (0…0xFFFF).

        *user* is the user ID (1…65535), None for the family's. The passcode is kept nowhere, nor repeated in an error.
        DvtcliError where the device knows no login, DeviceRefused where it does not take the passcode.
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
        """Empty the node's error history (0x1003) and read back that it is empty; the rows are what it held.

        What is wrong stays wrong. DeviceRefused where the node has no history, DvtcliError where it is not empty then.
        """
        from dvtcli.operations.nodes.show_faults import clear_faults

        return self._change(lambda node: clear_faults(self._calls.session, node.node_id), yes=False, force=False)

    def recover(self, *, yes: bool = False, force: bool = False) -> Changed | None:
        """Finish a change of the node that was interrupted, by putting the old configuration back; needs *yes*.

        Other nodes that an atomic script changed with it are put back, too. None where no change was interrupted;
        false, with `not_put_back`, where the node does not take back what it held.
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
        """Find out what the node's PDOs take, and put everything back; needs *yes*, and starts no node.

        *save* writes a profile and a simulated family into the folder of that name. *compare* is a profile's name, or
        such a folder: the answer is false where the device differs from it. *isolated* says that nothing else is on the
        bus, so that restricted CAN-IDs are asked for, too; *with_store* lets the node save, with two writes to 0x1010
        at most. In a dry run the answer is what would be asked. UsageError for a name or a profile that cannot be.
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
