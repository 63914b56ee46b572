"""The text of the library of device files."""

from __future__ import annotations

import os
from collections.abc import Iterator

from dvtcli.cli.view.lines import Cell, Line, Table
from dvtcli.domain.text import plural
from dvtcli.files.device_library import identity_word
from dvtcli.operations.results.library_files import (
    ADDED,
    REFUSED,
    THERE,
    AddedFile,
    LibraryAdded,
    LibraryListing,
    ProfileListing,
    ProfileRow,
    ProfileShown,
)


def profile_list_lines(result: ProfileListing, width: int) -> Iterator[Line]:
    """Show a line per profile, and the folder for the user's own."""
    table = Table(("PROFILE", "DEVICES", "VENDOR", "FROM"), shrink=3)
    for row in result.rows:
        table.add(Cell(row.name, "bold"), row.title, _vendors(row), row.file if row.own else "dvtcli")
    yield from table.lines(width)
    yield [Cell(f"your own: {result.folder}", "dim")]


def profile_lines(result: ProfileShown, _width: int) -> Iterator[Line]:
    """Show every value with its full reason."""
    yield [Cell(result.row.name, "bold"), Cell(f"  {result.row.title}  {_vendors(result.row)}".rstrip())]
    key_width = max(len(key) for key, _, _ in result.values)
    value_width = min(40, max(len(value) for _, value, _ in result.values))
    for key, value, reason in result.values:
        yield [Cell(f"  {key:<{key_width}}  "), Cell(f"{value:<{value_width}}"), Cell(f"  {reason}", "dim")]
    rest = f"as {result.like} (profiles show {result.like})" if result.like else "as in the EDS, else CiA 301"
    yield f"everything else is {rest}"


def _vendors(row: ProfileRow) -> str:
    return ", ".join(f"0x{vendor:X}" for vendor in row.vendor_ids) or "any"


_STYLES = {ADDED: "green", THERE: "dim", REFUSED: "red"}


def added_lines(result: LibraryAdded, width: int) -> Iterator[Line]:
    """Show each file's result, reasons for omissions, and notes on the others."""
    table = Table(("", "VENDOR", "PRODUCT", "REVISION", "FILE"), shrink=4)
    for row in result.rows:
        table.add(
            Cell(row.outcome, _STYLES.get(row.outcome, "")), _assigned(row.vendor_id), _assigned(row.product_code),
            _assigned(row.revision), row.file,
        )  # fmt: skip
    yield from table.lines(width)
    for row in result.rows:
        yield from _remarks(row)
    hints = dict.fromkeys(row.hint for row in result.rows if row.hint)
    yield from ([Cell("  "), Cell(hint, "dim") if isinstance(hint, str) else hint] for hint in hints)
    counts = ", ".join(f"{number} {outcome}" for outcome, number in result.count().items() if number)
    others = f"; {plural(result.others, 'other file')} left out: no EDS, DCF, XDD or XDC" if result.others else ""
    dry = Cell(" (dry run: nothing was written)" if result.dry_run else "", "cyan")
    yield [Cell(f"{counts}{others}"), dry]
    if not result.dry_run and not all(row.outcome == REFUSED for row in result.rows):
        which = "them from now on" if result.are_all_taken else "as shown by `eds list`"
        if any(row.product_code == 0 for row in result.rows):
            yield "PRODUCT -: for nodes of this vendor without a product number (0x1018:02)"
        who = f"nodes of these identities use {which}"
        yield [Cell(f"{who}; kept in {_at_home(result.folder)}", "dim")]


def _remarks(row: AddedFile) -> Iterator[Line]:
    if row.note:
        yield [Cell(f"  {row.file}: {row.note}", "yellow" if row.outcome == ADDED else "")]
    if row.why:
        at = "" if row.place in row.why else f" ({row.place})"
        yield [Cell(f"  {row.why}{at}", "red")]


def listing_lines(result: LibraryListing, width: int) -> Iterator[Line]:
    """Show changes, then a line per file."""
    if result.removed or result.preferred:
        yield from _changed(result)
        return
    if not result.rows:
        yield "the library is empty: eds add FILE, FOLDER or FAMILY"
        yield [Cell(f"it is in {_at_home(result.folder)}", "dim")]
        return
    header = ("#", "VENDOR-PRODUCT-REVISION", "OBJECTS", "DEVICE", "FILE", "FROM")
    table = Table(header, frozenset({0, 2}), shrink=(3, 5, 4))
    for row in result.rows:
        identity = identity_word((row.vendor_id, row.product_code, row.revision))
        objects = "-" if row.objects is None else str(row.objects)
        device = row.product_name or row.vendor_name or "-"
        table.add(str(row.number), identity, objects, device, row.name, _from(row.origin))
    yield from table.lines(width)
    for row in result.rows:
        if row.problem:
            yield [Cell(f"  {row.number}: {row.problem}", "red")]
        elif row.by_hand:
            yield [Cell(f"  {row.number}: {row.name} has another identity or none: bound by hand", "dim")]
    yield from _first_of_several(result)
    yield [Cell(f"{plural(len(result.rows), 'file')} in {_at_home(result.folder)}", "dim")]
    if result.strangers:
        yield [Cell(f"{plural(result.strangers, 'file')} there not added by `eds add`: not checked", "yellow")]


def _first_of_several(result: LibraryListing) -> Iterator[Line]:
    """Show the selected file among files of the same identity, with the reason."""
    for row in result.rows:
        others = [other for other in result.rows if other.identity == row.identity and other is not row]
        if row.taken and others:
            numbers = ", ".join(str(other.number) for other in others)
            why = "preferred" if row.preferred else "the file added last, or not a DCF: `eds prefer` decides"
            yield [Cell(f"  {row.number}: {row.name} is used before {numbers} of its identity ({why})", "dim")]


def _changed(result: LibraryListing) -> Iterator[Line]:
    """Show removed or preferred files."""
    dry = Cell(" (dry run: nothing was changed)" if result.dry_run else "", "cyan")
    if result.removed:
        yield [Cell(f"removed: {', '.join(result.removed)}"), dry]
    if result.preferred:
        yield [Cell(f"{result.preferred} is used before others of its identity"), dry]
    if result.is_alone:
        text = "no other file has its identity; of several revisions, the device's own is used first, then the nearest"
        yield [Cell(f"  {text}", "yellow")]
    yield f"{plural(len(result.rows), 'file')} in the library"


def _assigned(value: int | None) -> str:
    return f"0x{value:08X}" if value else "-"


def _at_home(folder: str) -> str:
    """Abbreviate the user's home in *folder*."""
    home = os.path.expanduser("~")  # noqa: PTH111 - Path raises where there is no home
    return f"~{folder.removeprefix(home)}" if folder.startswith(home + os.sep) else folder


def _from(origin: str) -> str:
    """Return the family, or the folder only; JSON has the whole origin."""
    parts = origin.replace("\\", "/").split("/")
    return f"{parts[-2]}/" if len(parts) > 1 else origin or "-"
