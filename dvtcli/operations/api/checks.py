"""Python calls that need no bus: checks of files, and the library of device files and profiles."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from reprlib import repr as short
from typing import TYPE_CHECKING, Any

from dvtcli.domain.hint import Action, Hint
from dvtcli.errors import UsageError
from dvtcli.operations.api.called_hints import errors_in_calls
from dvtcli.operations.network.check_networks import CheckOptions
from dvtcli.operations.user.options import BIT_RATES, Options

if TYPE_CHECKING:
    from dvtcli.operations.exchange.export_dbc import DbcOptions
    from dvtcli.operations.results import FileReports, LibraryAdded, LibraryListing, ProfileListing, ProfileShown

#: Range of a time-out, in seconds.
LEAST_S, MOST_S = 0.001, 600.0


def wrong(name: str, value: object, takes: str) -> UsageError:
    """Make the error for *value* of the argument *name*, which *takes* something else."""
    return UsageError(f"{name}={short(value)}: {takes}")


def flag(name: str, value: object) -> bool:
    """Require True or False, and no truthy value: `"no"` would be true."""
    if not isinstance(value, bool):
        raise wrong(name, value, "True or False")
    return value


def flags(**given: object) -> None:
    """Require True or False for each of *given*."""
    for name, value in given.items():
        flag(name, value)


def whole(name: str, value: object, what: str, high: int, *, low: int = 0) -> int:
    """A whole number *low*…*high*; True and False are none."""
    if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
        numbers = f"{low}…{high}" + (f" (0x{low:X}…0x{high:X})" if high > 255 else "")
        raise wrong(name, value, f"{what} is {numbers}")
    return value


def number(name: str, value: object, what: str, *, low: float = 0.0, high: float = math.inf) -> float:
    """A finite number *low*…*high*."""
    if (
        isinstance(value, bool)
        or not isinstance(value, int | float)
        or not math.isfinite(value)
        or not low <= value <= high
    ):
        raise wrong(name, value, what)
    return value


def seconds(name: str, value: object) -> float:
    """A time-out in seconds."""
    return number(name, value, f"a number of seconds, {LEAST_S:g}…{MOST_S:g}", low=LEAST_S, high=MOST_S)


def word(name: str, value: object, takes: str) -> str:
    """Text."""
    if not isinstance(value, str):
        raise wrong(name, value, takes)
    return value


def words(name: str, value: object) -> tuple[str, ...]:
    """Require a list or tuple of words; a single text would count as its letters."""
    if not isinstance(value, list | tuple) or not all(isinstance(item, str) for item in value):
        raise wrong(name, value, "a list or tuple of words")
    return tuple(value)


def module_numbers(value: object) -> tuple[int, ...]:
    """Require a list or tuple of numbers of modules."""
    if not isinstance(value, list | tuple):
        raise wrong("modules", value, "a list or tuple of numbers, as in [1, 1, 2]")
    return tuple(whole("modules", item, "a module's number", 0xFFFF, low=1) for item in value)


def path(name: str, value: object) -> Path:
    """Require the path of a file or folder, which need not exist."""
    if not isinstance(value, str | Path) or "\0" in str(value):
        raise wrong(name, value, "a path: text or pathlib.Path")
    return Path(value)


def call_back(**given: Callable[..., Any] | None) -> None:
    """Require a callable or None for each of *given*."""
    for name, value in given.items():
        if value is not None and not callable(value):
            raise wrong(name, value, "a function, or None")


def check_eds(
    *files: str | Path,
    rules: Sequence[str] = (),
    without: Sequence[str] = (),
    strict: bool = False,
    profile: str | None = None,
) -> FileReports:
    """Check EDS, DCF, XDD and XDC *files*; findings have lines. The result is true if no file is invalid.

    A name with `*`, `?` or `[` stands for matching files. Applies *rules* (empty: all) except *without*; *strict*
    treats warnings as errors. *profile* is the device family for the rules on PDOs. Raises UsageError for an unknown
    rule or family, or if a single file does not exist, InputFileError if a single file is unreadable; of several files
    these are findings.
    """
    from dvtcli.operations.devices import eds_files
    from dvtcli.operations.results import FileReports

    chosen = [str(path("files", file)) for file in files]
    flags(strict=strict)
    if profile is not None:
        word("profile", profile, "the name of a device family, as `dvtcli.profiles()` lists them")
    if not chosen:
        raise UsageError("which files? 'drive.eds', …")
    with errors_in_calls():
        found = eds_files.check_eds(
            chosen, words("rules", rules), words("without", without), strict=strict, family=profile
        )
    return found if isinstance(found, FileReports) else FileReports((found,))


def refuse_recordings(files: Sequence[str]) -> None:
    """Raise UsageError if one of *files* is a recording: only the command checks recordings."""
    from dvtcli.files.recordings.formats import is_recording

    recording = next((file for file in files if is_recording(Path(file))), None)
    if recording is not None:
        with errors_in_calls():
            raise UsageError(
                f"{recording} is a recording, and this call checks networks",
                place=recording,
                hint=Hint(Action.CHECK, {"recording": recording}, "{} checks recordings"),
            )


def check_options(
    rules: Sequence[str], without: Sequence[str], bit_rate: int | None, for_s: float | None, *, strict: bool
) -> CheckOptions:
    """Convert the arguments of `Bus.check`; raises UsageError if invalid."""
    flags(strict=strict)
    if bit_rate is not None:
        whole("bit_rate", bit_rate, "a bit rate (bit/s)", BIT_RATES[-1], low=BIT_RATES[0])
    if for_s is not None:
        number("for_s", for_s, "a number of seconds, 0…3600", high=3600)
    return CheckOptions(
        words("rules", rules), words("without", without), strict, bit_rate, as_findings=True, for_s=for_s
    )


def convert(  # noqa: PLR0913 - each option of a conversion by its name
    file: str | Path,
    target: str | Path,
    *,
    node: str | int | None = None,
    services: Sequence[str] = (),
    split_bits: bool = False,
    everything: bool = False,
    eds: str | Path | None = None,
    plain: bool = False,
    yes: bool = False,
) -> tuple[str, ...]:
    """Convert *file* to *target*, in the format of its suffix: EDS to XDD, DCF to XDC, and back.

    A network file becomes the concise DCF (.cdcf) of *node*, by name or node-ID (None: its only node), or a DBC file
    (.dbc) of all nodes: *services* (`nmt`, `sync`, `emcy`, `heartbeat`, `sdo`) adds their frames, *split_bits* makes a
    signal of each named bit, *everything* adds disabled PDOs. A recording becomes a DBC file of the PDOs in its SDO
    transfers, with names of *eds* (None: by the recorded identity). A *plain* EDS or DCF has no units, modules and
    safety keys, which some tools refuse. Returns what *target* lacks. Overwriting needs
    *yes*. Raises UsageError for another suffix, if a file cannot be read or written, or if a recording has no mapping;
    InputFileError if *file* is invalid.
    """
    from dvtcli.operations.exchange.convert_file import convert_file
    from dvtcli.operations.session.session import Session

    source, chosen = str(path("file", file)), str(path("target", target))
    described = None if eds is None else str(path("eds", eds))
    options = dbc_options(services, split_bits=split_bits, everything=everything)
    flags(plain=plain)
    with errors_in_calls(), Session(Options(yes=yes, eds=described)) as session:
        done = dict(convert_file(session, source, chosen, node, options, plain=plain).rows)
    return tuple(done.get("left_out") or done.get("losses") or ())


def dbc_options(services: Sequence[str], *, split_bits: bool, everything: bool) -> DbcOptions:
    """How a program wants a DBC file, checked; UsageError for a wrong argument."""
    from dvtcli.operations.exchange.export_dbc import DbcOptions, services_of

    flags(split_bits=split_bits, everything=everything)
    return DbcOptions(services_of(",".join(words("services", services))), split_bits, everything)


def profiles() -> ProfileListing:
    """List the known device families, including the user's; a list of rows.

    Raises InputFileError for an unreadable profile of the user.
    """
    from dvtcli.operations.devices.show_profiles import list_profiles

    return list_profiles()


def profile(name: str) -> ProfileShown:
    """Return the profile *name* with the reason for each value.

    Raises UsageError if unknown, InputFileError if its file is invalid.
    """
    from dvtcli.operations.devices.show_profiles import show_profile

    word("name", name, "the name of a device family, as `dvtcli.profiles()` lists them")
    with errors_in_calls():
        return show_profile(name)


_U32 = 0xFFFF_FFFF


def eds_library() -> LibraryListing:
    """List the library of device files, as kept by `dvtcli eds add`; a list of rows."""
    from dvtcli.operations.devices.eds_library import list_files
    from dvtcli.operations.session.session import Session

    with errors_in_calls(), Session() as session:
        return list_files(session)


def add_eds(
    *files: str | Path,
    vendor: int | None = None,
    product: int | None = None,
    revision: int | None = None,
    dry_run: bool = False,
) -> LibraryAdded:
    """Add EDS, DCF, XDD and XDC *files*, folders or a family to the library, by their identity (0x1018).

    True if none was refused; each row has a file's outcome. *vendor* and *product* (and *revision*, None: any) replace
    the identity of a single file. *dry_run* writes nothing. Raises InputFileError if a single file cannot be added;
    UsageError for an unknown name, or if the library cannot be written.
    """
    from dvtcli.operations.devices.eds_library import add_files
    from dvtcli.operations.session.session import Session

    flags(dry_run=dry_run)
    chosen = tuple(str(path("files", file)) for file in files)
    if not chosen:
        raise UsageError("which files? 'drive.eds', a folder, a family, …")
    given = {"vendor": vendor, "product": product, "revision": revision}
    identity = {
        name: whole(name, value, "a part of the identity (0x1018)", _U32)
        for name, value in given.items()
        if value is not None
    }
    with errors_in_calls(), Session(Options(dry_run=dry_run)) as session:
        return add_files(session, chosen, identity or None)
