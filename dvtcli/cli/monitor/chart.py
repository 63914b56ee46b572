"""Draw tracks as a picture file by matplotlib, an optional extra."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path

from dvtcli.domain.text import safe
from dvtcli.errors import UsageError
from dvtcli.files.extras import extra
from dvtcli.watch.tracks import Track

SUFFIXES = (".png", ".svg", ".pdf")


def check_chart(path: Path) -> None:
    """Raise UsageError if *path* is no picture format, or matplotlib is missing."""
    if path.suffix.lower() not in SUFFIXES:
        raise UsageError(f"{path}: pictures are {' '.join(SUFFIXES)}")
    extra("matplotlib", "plot", "drawing a picture")


def draw_chart(path: Path, tracks: Sequence[Track], begin_s: float) -> None:
    """Write *tracks*, one below the other over a common time axis, to *path*, whole or not at all."""
    with tempfile.TemporaryDirectory() as cache:
        extra("matplotlib", "plot", "drawing a picture").rcParams["svg.hashsalt"] = "dvtcli"
        figure_type = extra("matplotlib.figure", "plot", "drawing a picture").Figure
        figure = figure_type(figsize=(10, 1 + 2.2 * len(tracks)), layout="constrained")
        axes = figure.subplots(len(tracks), 1, sharex=True, squeeze=False)[:, 0]
        for axis, track in zip(axes, tracks, strict=True):
            points = track.points()
            axis.step([point.time_s - begin_s for point in points], [point.last for point in points], where="post")
            axis.set_title(safe(track.name).replace("$", r"\$"), loc="left", fontsize=9)
            axis.set_ylabel(safe(track.signal.unit).replace("$", r"\$"))
            axis.grid(visible=True, alpha=0.3)
        axes[-1].set_xlabel("time in s")
        draft = Path(cache) / f"draft{path.suffix.lower()}"
        figure.savefig(draft)
        try:
            path.write_bytes(draft.read_bytes())
        except OSError as failed:
            raise UsageError(f"{path}: {failed.strerror or failed}", place=str(path)) from failed
