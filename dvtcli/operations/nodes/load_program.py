"""`download`: update a device's program, with consent; unfinished downloads are noted for later."""

from __future__ import annotations

import time
from binascii import crc32
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.device.file_fits import refuse_unlike_file
from dvtcli.device.program_download import ProgramDownload
from dvtcli.device.programs import ProgramNotes, Stage
from dvtcli.device.read_pdos import read_identity
from dvtcli.domain.hint import Action, Hint, verbatim
from dvtcli.domain.nmt import NmtState
from dvtcli.domain.objects import PROGRAM_CONTROL, PROGRAM_IDENTIFICATION
from dvtcli.domain.profile import CRC32
from dvtcli.errors import DvtcliError, LeftChanged, SafetyRefusal, SdoAborted, UsageError, stopped_node
from dvtcli.files.program_file import read_program
from dvtcli.operations.objects.write_object import transfer_progress
from dvtcli.operations.results.facts import Facts
from dvtcli.operations.results.nodes import ProgramLoaded
from dvtcli.operations.session.consent import consent_to_reset

if TYPE_CHECKING:
    from dvtcli.device.node import Node
    from dvtcli.device.node_parts import NodeDescription, ReadableNode
    from dvtcli.operations.session.session import Session, SessionNodes


def load_program(
    session: Session, file: str, *, number: int = 1, expect: int | str | None = None, node_id: int | None = None
) -> ProgramLoaded:
    """Load *file* (.bin, .hex) as program *number* (1..254) of node *node_id*, and start it.

    None is the selected node. *expect* is the required software identification (0x1F56): a 32-bit number, "crc32" for
    that of the data, None for the profile's, if any. Asks first. Raises UsageError, InputFileError, SafetyRefusal
    before anything is sent; the device's error with state `rolled_back` if the old program runs again; else LeftChanged
    with the device's state.
    """
    program = read_program(file)
    if isinstance(expect, str) and expect != CRC32:
        raise UsageError(f"{expect!r}: a number, or crc32", hint=Hint(Action.GIVE, {"expect": "0x12345678"}))
    node = session.node(node_id)
    wanted, by = _expected(node, number, program, expect)
    if session.dry_run:
        return ProgramLoaded(node.node_id, number, file, len(program), None, None, wanted, by, dry_run=True)
    before = _identity(node)
    _consent(session, node, number, file, len(program))
    node.begin_change()
    noted = _ProgramNote(session, node.node_id, number, file)
    loading = ProgramDownload(session.bus, node.node_id, number, noted.begins, session.cancellation)
    was, started_s = loading.identification(), time.monotonic()
    try:
        node.gate.enter_agreed()
        with transfer_progress(session, node.node_id, f"node {node.node_id}: sending {file}", len(program)):
            loading.run(program, wanted)
        _require_same(node, before)
    except DvtcliError as failed:
        if failed.state == "rolled_back":
            noted.forget()
        _name_profile(failed, by, number)
        raise
    finally:
        _forget(session, node)
    seconds, now = time.monotonic() - started_s, loading.identification()
    noted.forget()  # not sooner: a bus that is lost in the last look leaves the note
    return ProgramLoaded(
        node.node_id, number, file, len(program), was, now, wanted, by, restarted=loading.restarted, seconds=seconds
    )


def _expected(node: NodeDescription, number: int, program: bytes, expect: int | str | None) -> tuple[int | None, str]:
    """Return the required 0x1F56, None for any, and the profile that requires it."""
    by_profile = node.profile.software_identification.get(number) if expect is None else None
    wanted = by_profile if expect is None else expect
    number_wanted = crc32(program) if isinstance(wanted, str) else wanted
    return number_wanted, "" if by_profile is None else node.profile.name


def forget_download(session: SessionNodes) -> Facts:
    """Forget an unfinished download to the selected node, as it is in order."""
    wanted = session.node_id()
    session.open_network()
    was_there = not session.dry_run and _notes(session).forget(wanted)
    said = "forgotten" if was_there else "nothing was noted"
    rows = (("node", wanted), ("forgotten", was_there))
    return Facts("download-forgotten", rows, (f"node {wanted}: {said} of a program download that was not completed",))


def _notes(session: SessionNodes) -> ProgramNotes:
    return ProgramNotes(session.state_folder / "programs", session.open_network().bus.name)


def _identity(node: ReadableNode) -> tuple[int | None, ...]:
    return tuple(read_identity(node.sdo, sub_index) for sub_index in (1, 2, 3, 4))


def _consent(session: SessionNodes, node: Node, number: int, file: str, size: int) -> None:
    """Refuse unsuitable devices, and ask."""
    refuse_unlike_file(node.node_id, node.unlike_file, force=session.options.force)
    try:
        node.sdo.upload(PROGRAM_CONTROL, number)
    except SdoAborted as aborted:
        aborted.hint = f"the device has no program {number} that could be downloaded (CiA 302-3)"
        raise
    state = node.access.state()
    if state is NmtState.STOPPED:
        raise stopped_node(node.node_id)
    leaves = "it is OPERATIONAL, and is PRE-OPERATIONAL from then on; " if state is NmtState.OPERATIONAL else ""
    session.consent(
        f"node {node.node_id} ({node.title}): {leaves}stop program {number}, clear it, load {Path(file).name} "
        f"({size:,} bytes) and start that? There is no way back from clearing it",
        node.node_id,
    )
    consent_to_reset(session, [node.node_id])


@dataclass(frozen=True, slots=True)
class _ProgramNote:
    """The note of a download of *file* to program *number* of *node_id*, kept until its end is known."""

    session: Session
    node_id: int
    number: int
    file: str

    def begins(self, stage: Stage) -> None:
        """Note the start of a stage, on a bus whose nodes outlive this process."""
        notes = _notes(self.session)
        try:
            if not self.session.bus.simulated:
                notes.write(self.node_id, str(Path(self.file).absolute()), self.number, stage)
        except OSError as failed:
            raise SafetyRefusal(
                f"the download cannot be noted: {failed.strerror or failed}", node=self.node_id, place=str(notes.folder)
            ) from failed
        self.session.reporter.progress(f"node {self.node_id}: {stage.name.lower()}", 0, 0)

    def forget(self) -> None:
        """Remove the note: the node runs the new or the old program."""
        _notes(self.session).forget(self.node_id)


def _name_profile(failed: DvtcliError, profile: str, number: int) -> None:
    """Name *profile* as the source of the required 0x1F56 if this check *failed*."""
    if profile and failed.place == f"{PROGRAM_IDENTIFICATION:04X}:{number:02X}":
        failed.hint = Hint(
            Action.GIVE,
            {"expect": "NUMBER"},
            f"profile {verbatim(profile)} says what is expected; is it the right file? {{}} says another one",
        )


def _require_same(node: ReadableNode, before: tuple[int | None, ...]) -> None:
    """Raises LeftChanged if another device than *before* (vendor, product) answers now."""
    now = _identity(node)
    if now[:2] != before[:2]:
        raise LeftChanged(
            f"node {node.node_id} is another device with its new program", node=node.node_id, place="1018",
            why=f"vendor and product were {_shown(before)}, are {_shown(now)}", state="left_changed",
            hint="is it the right file? download the right one",
        )  # fmt: skip


def _shown(identity: tuple[int | None, ...]) -> str:
    return ", ".join("none" if part is None else f"0x{part:08X}" for part in identity[:2])


def _forget(session: SessionNodes, node: Node) -> None:
    """Drop what was read of the old program; the node keeps its boot-up state."""
    left_behind = node.gate.abandon()
    network = session.open_network()
    network.nodes.pop(node.node_id, None)
    network.files.forget(node.node_id)
    node.release_lock()
    if left_behind:
        session.reporter.note(left_behind)
