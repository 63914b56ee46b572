"""What a program can send as frames, and play from a recording, as methods. Prints nothing."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from dvtcli.errors import UsageError
from dvtcli.operations.api.checks import number, path, whole, word, words, wrong
from dvtcli.operations.api.network_calls import NetworkCalls

if TYPE_CHECKING:
    from dvtcli.operations.results import FramesSent, Replayed


class FrameCalls(NetworkCalls):
    """A bus as far as its single frames go; `Bus` has the rest."""

    def send(
        self,
        *frames: str,
        every_s: float | None = None,
        for_s: float | None = None,
        count: int | None = None,
        nodes: Sequence[int] = (),
        file: str | Path | None = None,
        yes: bool = False,
    ) -> FramesSent:
        """Send *frames* (`"185#1027"`, `"185#R"`) once, or each *every_s* seconds: *count* times, or for *for_s* s.

        Needs *yes*, or asks, where nodes act on one: NMT, SYNC, TIME, SDO, LSS, EMCY and heartbeats, and what a PDO
        carries of *nodes*, of those that are known or heard, or of the network *file*. False where not every frame is
        known to be sent: `outcome` says how many, and why. UsageError where one is no frame; SafetyRefusal without
        consent. A dry run sends none.
        """
        from dvtcli.operations.frames.send_frames import send_frames

        if not frames or not all(isinstance(frame, str) for frame in frames):
            raise wrong("frames", frames, "frames as text: '185#1027'")
        for name, value in (("every_s", every_s), ("for_s", for_s)):
            if value is not None:
                number(name, value, "a number of seconds, 0.001…1000000", low=0.001, high=1e6)
        if count is not None:
            whole("count", count, "a count", 1_000_000, low=1)
        if every_s is not None and for_s is None and count is None:
            raise UsageError("every_s alone has no end", hint="give count or for_s")
        if not isinstance(nodes, list | tuple):
            raise wrong("nodes", nodes, "a list or tuple of node-IDs")
        asked = [whole("nodes", node, "a node-ID", 127, low=1) for node in nodes]
        known = None if file is None else str(path("file", file))
        return self._calls.run(
            lambda: send_frames(self._session, frames, every_s, for_s, count, asked, known), changes=True, yes=yes
        )

    def replay(
        self,
        recording: str | Path,
        *,
        rate: float = 1.0,
        within_s: tuple[float, float] = (-math.inf, math.inf),
        only: Sequence[str] = (),
        without: Sequence[str] = (),
        channel: str | None = None,
        loops: int = 1,
        yes: bool = False,
    ) -> Replayed:
        """Send the frames of *recording* again, *rate* times as fast (0: as the load limit lets), *loops* times.

        Only those *within_s* (from and to, seconds behind its first frame), of *channel*, that one of *only* means and
        none of *without*: `"281"`, `"180-1FF"`, `"node=5"`, `"5:tpdo1"`, `"sdo"`. Consent is as of `send`. False where
        not every frame is known to be sent: `outcome` says how many, how late, and why. UsageError where nothing of it
        is meant; InputFileError where it is damaged; SafetyRefusal without consent.
        """
        from dvtcli.operations.frames.replay_recording import Choice, replay_recording

        number("rate", rate, "how many times as fast, 0…1000", high=1000)
        if not isinstance(within_s, tuple) or len(within_s) != 2:
            raise wrong("within_s", within_s, "two numbers of seconds: (0, 10)")
        ends = (-math.inf, math.inf)
        begin_s, end_s = (end if end in ends else number("within_s", end, "numbers of seconds") for end in within_s)
        whole("loops", loops, "a count", 1_000_000, low=1)
        if channel is not None:
            word("channel", channel, "the name of a channel in the recording, or 'all'")
        choice = Choice(rate, begin_s, end_s, words("only", only), words("without", without), channel, loops)
        source = path("recording", recording)
        return self._calls.run(lambda: replay_recording(self._session, source, choice), changes=True, yes=yes)
