"""Figures of benchmarks: what was measured beside what it is compared with, as a table, as JSON, and two runs compared.

Times depend on the machine, ratios much less: goals and comparisons are about ratios, round by round.
"""

from __future__ import annotations

import json
import os
import platform
import subprocess
import sys
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from statistics import median, quantiles
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
#: byte code is cached, as it is where dvtcli was installed
ENVIRONMENT = {key: value for key, value in os.environ.items() if key != "PYTHONDONTWRITEBYTECODE"}


@dataclass(frozen=True)
class Figure:
    """One *name* with what dvtcli took (*own*) and what *against* took (*other*), in *unit*, round by round.

    *most* and *least* are the goal for the ratio own / other; without both there is none.
    """

    name: str
    unit: str
    own: Sequence[float]
    against: str
    other: Sequence[float]
    most: float | None = None
    least: float | None = None

    @property
    def ratios(self) -> list[float]:
        """The ratio of each round."""
        return [own / other for own, other in zip(self.own, self.other, strict=True)]

    @property
    def spread(self) -> tuple[float, float]:
        """The quartiles of the ratios: half of all rounds lie between them."""
        ratios = self.ratios
        if len(ratios) == 1:
            return ratios[0], ratios[0]
        low, _, high = quantiles(ratios, n=4, method="inclusive")
        return low, high

    @property
    def goal(self) -> str:
        """The goal in words; empty if there is none."""
        if self.most is not None:
            return f"<= {self.most:.3g}"
        return "" if self.least is None else f">= {self.least:.3g}"

    @property
    def is_missed(self) -> bool:
        """Whether the median of the ratios is beyond the goal."""
        ratio = median(self.ratios)
        return (self.most is not None and ratio > self.most) or (self.least is not None and ratio < self.least)


def cpu_s(words: Sequence[str]) -> float:
    """Processor time (s, user and system) of one Python with *words*, from its start to its end."""
    import resource

    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(
        [sys.executable, *words],
        check=True,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        cwd=ROOT,
        env=ENVIRONMENT,
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def table(figures: Iterable[Figure]) -> Iterator[str]:
    """The lines of a table of *figures*, each as soon as it was measured."""
    yield f"{'':46}{'dvtcli':>12}  {'compared with':40}{'ratio':>6}  {'quartiles':13}  goal"
    for figure in figures:
        own, other = (f"{median(values):.4g} {figure.unit}".rstrip() for values in (figure.own, figure.other))
        low, high = figure.spread
        missed = "  missed" if figure.is_missed else ""
        yield (
            f"{figure.name:46}{own:>12}  {f'{other} {figure.against}':40}{median(figure.ratios):6.2f}"
            f"  {f'{low:.2f} .. {high:.2f}':13}  {figure.goal}{missed}"
        ).rstrip()


def page(runs: Iterable[dict[str, Any]]) -> Iterator[str]:
    """The lines of a table for a page of the figures of *runs*, each as `as_json` writes it."""
    yield "| what | dvtcli | compared with | ratio | quartiles | goal | |"
    yield "|---|---|---|---|---|---|---|"
    for run in runs:
        for figure in (Figure(**entry) for entry in run["figures"]):
            own, other = (f"{median(values):.4g} {figure.unit}".rstrip() for values in (figure.own, figure.other))
            low, high = figure.spread
            met = "" if not figure.goal else "missed" if figure.is_missed else "met"
            yield (
                f"| {figure.name} | {own} | {other} {figure.against} | {median(figure.ratios):.2f} "
                f"| {low:.2f} .. {high:.2f} | {figure.goal} | {met} |"
            )


def as_json(figures: Sequence[Figure]) -> str:
    """A run as JSON: *figures*, and when, of which commit and on what they were measured."""
    commit = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    run = {
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "commit": commit.stdout.strip(),
        "python": platform.python_version(),
        "machine": f"{platform.system()} {platform.machine()}, {os.cpu_count()} processors",
        "figures": [asdict(figure) for figure in figures],
    }
    return json.dumps(run, indent=1)


def figures_in(path: Path) -> dict[str, Figure]:
    """The figures of a run that `as_json` wrote to *path*, by their names."""
    return {entry["name"]: Figure(**entry) for entry in json.loads(path.read_text("utf-8"))["figures"]}


def comparison(before: dict[str, Figure], after: dict[str, Figure]) -> Iterator[str]:
    """The lines of a table of two runs: a change counts if the middle halves of the ratios have nothing in common."""
    yield f"{'':46}{'before':>8}{'after':>8}{'change':>9}"
    for name in [*before, *(name for name in after if name not in before)]:
        if name not in before or name not in after:
            yield f"{name:46}{'only before' if name in before else 'only after':>25}"
            continue
        old, new = median(before[name].ratios), median(after[name].ratios)
        change = f"{100 * (new / old - 1):+8.0f} %" if old else ""
        yield f"{name:46}{old:8.2f}{new:8.2f}{change:10}  {verdict(before[name], after[name])}"


def verdict(before: Figure, after: Figure) -> str:
    """Whether the ratios of *after* are others than those of *before*, or the difference is within their spread."""
    (old_low, old_high), (new_low, new_high) = before.spread, after.spread
    if old_low == new_low and old_high == new_high:
        return "equal"
    if new_low <= old_high and old_low <= new_high:
        return "noise"
    return "higher" if new_low > old_high else "lower"
