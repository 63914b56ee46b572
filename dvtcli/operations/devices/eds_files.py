"""EDS, DCF, XDD and XDC files: checked and shown. Needs no bus."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.domain.pdo import Pdo
from dvtcli.domain.profile import GENERIC, DeviceProfile
from dvtcli.errors import InputFileError, UsageError
from dvtcli.files.device_file import read_device_file
from dvtcli.operations.results import Facts, FileFinding, FileReport, FileReports, FileRule
from dvtcli.operations.results.checks import asked_rules, rules_among

if TYPE_CHECKING:
    from dvtcli.domain.lint import LintRule
    from dvtcli.files.eds.reader import EdsFile
    from dvtcli.files.xdd.xdd_reader import XddFile

    #: A device file of any format.
    DeviceFile = EdsFile | XddFile


def _read(file: str, modules: tuple[int, ...] | None = None) -> DeviceFile:
    """Read *file*, with *modules* connected; raises UsageError if it cannot be opened, or does not describe them."""
    from dvtcli.operations.session.simulated_nodes import DEVICE_FILE_WORDS, must_have_modules

    try:
        read = read_device_file(Path(file), modules)
    except OSError as failed:
        raise UsageError(
            f"{file}: {failed.strerror}", place=file,
            hint=f"eds takes {DEVICE_FILE_WORDS}",
        ) from failed  # fmt: skip
    if modules is not None:
        must_have_modules(read.dictionary, modules)
    return read


def check_eds(
    files: Sequence[str],
    only: Collection[str] = (),
    without: Collection[str] = (),
    *,
    strict: bool = False,
    family: str | None = None,
    modules: tuple[int, ...] | None = None,
) -> FileReport | FileReports:
    """Check *files* by the rules in *only* (empty: all) except *without*; findings have lines.

    A word with `*`, `?` or `[` that is no file matches files. *strict* treats warnings as errors; *family* is the
    profile for PDOs, *modules* are connected in each file. Raises UsageError for an unknown rule or family, or a
    missing single file. Among several files a missing or unreadable file is a finding.
    """
    from dvtcli.files.profiles import load_profile

    rules, names = chosen_rules(only, without), _matched(files)
    profile = GENERIC if family is None else load_profile(family)
    if len(names) == 1:
        return report(names[0], _read(names[0], modules), rules, strict=strict, profile=profile)
    return FileReports(tuple(_one_of_many(name, rules, strict, profile, modules) for name in names))


def _matched(words: Sequence[str]) -> list[str]:
    """Expand *words* into files without repetition; a simulated family stands for its EDS."""
    from glob import glob, has_magic

    names: dict[str, None] = {}
    for word in words:
        found = sorted(glob(word)) if has_magic(word) and not Path(word).exists() else [word]  # noqa: PTH207 - absolute, too
        names.update(dict.fromkeys(map(_place, found or [word])))  # what matches nothing is said when it is read
    return list(names)


def _place(word: str) -> str:
    """Return *word* if it is a file, else the EDS path of the simulated family, if any."""
    from os.path import exists

    if exists(word):  # noqa: PTH110 - Path.exists raises OSError for a name that is too long
        return word
    from dvtcli.operations.session.simulated_nodes import file_or_family

    return str(file_or_family(word))


def _one_of_many(
    file: str, rules: tuple[LintRule, ...], strict: bool, profile: DeviceProfile, modules: tuple[int, ...] | None
) -> FileReport:
    try:
        return report(file, _read(file, modules), rules, strict=strict, profile=profile)
    except (InputFileError, UsageError) as wrong:
        text = f"{wrong.text}: {wrong.why}" if wrong.why else wrong.text
        found = FileFinding(1, _UNREADABLE.severity, _UNREADABLE.name, "", text)
        return FileReport(file, 0, 0, 0, (_UNREADABLE,), (found,), strict)


#: No selectable rule: it explains why no rule could be applied.
_UNREADABLE = FileRule("unreadable", "error", "the file cannot be read as an EDS, DCF, XDD or XDC", "CiA 306, CiA 311")


def report(
    file: str, eds: DeviceFile, rules: tuple[LintRule, ...], *, strict: bool = False, profile: DeviceProfile = GENERIC
) -> FileReport:
    """Apply *rules* to *eds*, named *file*."""
    from dvtcli.files.device_lint import lint_device_file

    findings = tuple(
        FileFinding(finding.line, str(finding.severity), finding.rule, finding.object, finding.text, *columns)
        for finding, columns in lint_device_file(eds, Path(file).name, {rule.name for rule in rules}, profile)
    )
    asked = asked_rules(rules)
    return FileReport(file, eds.sections, eds.understood, len(eds.dictionary), asked, findings, strict)


def chosen_rules(only: Collection[str] = (), without: Collection[str] = ()) -> tuple[LintRule, ...]:
    """Return the rules in *only* except *without*; raises UsageError for an unknown name, or if none is left."""
    from dvtcli.files.device_lint import EVERY_RULE

    return rules_among(EVERY_RULE, only, without, "device files", "docs/reference/eds-rules.md")


def show_eds(file: str, modules: tuple[int, ...] | None = None) -> Facts:
    """Summarise a file or a simulated family's EDS, with *modules* connected; raises UsageError if unreadable."""
    path = _place(file)
    return facts(path, _read(path, modules))


def facts(file: str, eds: DeviceFile) -> Facts:
    """Summarise *eds*, named *file*."""
    info = eds.dictionary.info
    pdos = {pdo for pdo in map(Pdo.at, eds.dictionary) if pdo is not None and pdo.communication_index in eds.dictionary}
    tpdos = sum(pdo.is_tpdo for pdo in pdos)
    number = {
        name: None if value is None else f"0x{value:08X}"
        for name, value in (
            ("vendor_id", info.vendor_id),
            ("product_code", info.product_code),
            ("revision", info.revision_number),
        )
    }
    rows = (
        ("file", file), ("vendor", info.vendor_name), ("product", info.product_name), *number.items(),
        ("objects", len(eds.dictionary)), ("tpdos", tpdos), ("rpdos", len(pdos) - tpdos),
        ("granularity", info.granularity), ("node_id", eds.node_id),
        ("dummies", None if info.dummies is None else [f"{index:04X}" for index in sorted(info.dummies)]),
        *_modules(eds),
    )  # fmt: skip
    text = tuple(f"  {name:<13} {_shown(value)}" for name, value in rows if name not in _OF_MODULES or value)
    return Facts("eds-info", rows, text)


_OF_MODULES = ("modules", "connected")


def _modules(eds: DeviceFile) -> tuple[tuple[str, list[str] | None], ...]:
    """List the supported modules of a modular device by number, and those that are connected."""
    modules = eds.dictionary.info.modules
    if not modules.supported:
        return tuple((name, None) for name in _OF_MODULES)
    supported = [f"{number} {name}".rstrip() for number, name in modules.supported.items()]
    return ("modules", supported), ("connected", [str(number) for number in modules.connected])


def _shown(value: object) -> str:
    if isinstance(value, list):
        return (", " if any(" " in str(one) for one in value) else " ").join(map(str, value)) or "none"
    return "-" if value in (None, "") else str(value)
