"""The common parts of results, and values as JSON."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence, Sized
from dataclasses import fields, is_dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Generic, Protocol, TypeVar, overload

from dvtcli.domain.datatypes import CanopenTime, Value
from dvtcli.domain.hint import next_step

if TYPE_CHECKING:
    from dvtcli.domain.network.network_plan import MissingObject
    from dvtcli.domain.rules import Finding
    from dvtcli.domain.scaling import Scaling

Document = dict[str, Any]
#: formats of results that compare PDOs and objects one by one
CASES = {"github": "github_case_lines", "junit": "junit_case_lines"}


class Short:
    """A result, or a part: a line in a Python session; `dataclasses.asdict` has every field."""

    __slots__ = ()

    def __init_subclass__(cls) -> None:
        # a dataclass makes a repr of all its fields unless its class has one; IPython asks each class, the last first
        if "_repr_pretty_" not in vars(cls):
            cls._repr_pretty_ = Short._repr_pretty_  # type: ignore[method-assign]
        if "__repr__" not in vars(cls):
            cls.__repr__ = Short.__repr__  # type: ignore[method-assign]

    def __repr__(self) -> str:
        return f"<{brief(self)}>"

    def __str__(self) -> str:
        """Print it in a line, without default values."""
        return brief(self)

    def _repr_pretty_(self, page: Any, _cycle: bool) -> None:
        """A notebook shows the short text."""
        page.text(str(self))


class Answer(Short):
    """A result with its presentation, given by its class: a `text` of lines, or a `renderer`."""

    __slots__ = ()
    #: a module of `cli.view` and its function of (answer, width in columns): `pdo_lines:listing_lines`
    renderer: ClassVar[str] = "node_lines:text_lines"
    #: format of some results only (`sarif`) -> function of `cli.view.reports` that makes its lines
    formats: ClassVar[Mapping[str, str]] = {}
    #: whether it is a list for a pager if longer than a screen
    use_pager: ClassVar[bool] = False
    #: whether its findings are shown beside it instead of in its text
    show_findings: ClassVar[bool] = False

    @property
    def remark(self) -> str:
        """The remark besides findings; empty for none."""
        return ""

    def __str__(self) -> str:
        """Print it in short: summary, and a line per row."""
        return "\n  ".join([brief(self), *(str(brief(row)) for row in self._shown())])

    def _shown(self) -> Iterable[object]:
        """The lines below the first in the short text."""
        return getattr(self, "rows", ())


def brief(value: object) -> str:
    """Print a dataclass in a line: no default values, collections by their length, or its own text."""
    is_short = type(value).__str__ not in (object.__str__, Short.__str__, Answer.__str__)
    if is_short or not is_dataclass(value):
        return str(value)
    told = ((field, getattr(value, field.name)) for field in fields(value))
    said = [
        f"{field.name}={_in_short(field_value)}"
        for field, field_value in told
        if field_value != field.default and field_value not in ((), [], {})
    ]
    return f"{type(value).__name__}({', '.join(said)})"


def _in_short(value: object) -> str:
    if isinstance(value, float):
        return f"{value:.4g}"
    is_one = isinstance(value, str | bytes) or (isinstance(value, tuple) and type(value) is not tuple)  # named tuples
    return f"{len(value)} in all" if isinstance(value, Sized) and not is_one else brief(value)


R = TypeVar("R")


class Rows(Generic[R]):
    """A result that is a list of *rows*: iterable, with length and index."""

    __slots__ = ()
    rows: tuple[R, ...]

    def __iter__(self) -> Iterator[R]:
        return iter(self.rows)

    def __len__(self) -> int:
        return len(self.rows)

    @overload
    def __getitem__(self, place: int) -> R: ...
    @overload
    def __getitem__(self, place: slice) -> tuple[R, ...]: ...
    def __getitem__(self, place: int | slice) -> R | tuple[R, ...]:
        return self.rows[place]


class Result(Protocol):
    """The base of results: an `Answer` with an exit code and a document."""

    renderer: ClassVar[str]
    formats: ClassVar[Mapping[str, str]]
    use_pager: ClassVar[bool]
    show_findings: ClassVar[bool]

    @property
    def remark(self) -> str:
        """The remark."""
        ...

    @property
    def exit_code(self) -> int:
        """0 if all is as requested, else the code for what is not (1, 3, 4, 5, 7 or 130)."""
        ...

    def document(self) -> Document:
        """The result as a JSON document."""
        ...


def hex_bytes(data: bytes | None) -> str | None:
    """Print bytes as in documents: `01 02 00 00`, in bus order."""
    return None if data is None else data.hex(" ").upper()


def json_value(value: Value) -> Any:
    """A value as JSON can carry it: bytes as hex, times as two numbers, `"nan"` and `"inf"` as text."""
    if isinstance(value, int):  # most are: the other checks are spared
        return value
    if isinstance(value, bytes):
        return hex_bytes(value)
    if isinstance(value, CanopenTime):
        return {"days": value.days, "milliseconds": value.milliseconds}
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    return value


def finding_document(finding: Finding) -> Document:
    """A finding as JSON."""
    return {
        "rule": finding.rule,
        "severity": str(finding.severity),
        "place": finding.place,
        "text": finding.text,
        "abort": None if finding.abort is None else f"0x{finding.abort:08X}",
        "hint": finding.hint,
        "next": next_step(finding.hint),
        "file": None if finding.complaint is None else finding.complaint.file,
        "line": None if finding.complaint is None else finding.complaint.line,
        "column": None if finding.complaint is None else finding.complaint.column,
    }


def lacking_documents(lacking: Sequence[MissingObject]) -> list[Document]:
    """List PDOs and objects that devices lack, with reasons."""
    return [
        {
            "node": lacked.node_id,
            "pdo": None if lacked.pdo is None else str(lacked.pdo),
            "object": lacked.object if lacked.pdo is None else None,
            "text": lacked.finding.text,
            "hint": lacked.finding.hint,
            "next": next_step(lacked.finding.hint),
        }
        for lacked in lacking
    ]


def physical_document(value: Value | None, meaning: Scaling) -> Document | None:
    """The scaled *value*, beside raw: number and unit, words, names of set bits; None if unknown."""
    if isinstance(value, int):
        bits = meaning.set_bits(value) if meaning.bits else ()
    elif isinstance(value, float):
        bits = ()
    else:
        return None
    text = meaning.words(value)
    if not text:
        return None
    number = json_value(meaning.number(value)) if meaning.has_number else None
    return {"value": number, "unit": meaning.unit, "text": text, "bits": list(bits)}
