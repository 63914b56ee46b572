"""A prompt on a simulated node that takes its time for each answer: `python -m tests.cli.prompt.slow_node SECONDS`."""

from __future__ import annotations

import sys
import time

from dvtcli.cli.conversation import Conversation
from dvtcli.cli.main import install
from dvtcli.cli.prompt.loop import run_prompt
from dvtcli.cli.view.output import Output
from dvtcli.files.eds.reader import read_eds
from dvtcli.simulator.device.strict_device import StrictDevice
from dvtcli.simulator.network.family_file import family_eds, load_family
from dvtcli.simulator.network.in_process_bus import simulate


class Slow(StrictDevice):
    """Takes *answer_s* seconds for an answer."""

    answer_s = 0.0

    def upload(self, index: int, sub_index: int) -> bytes:
        time.sleep(self.answer_s)
        return super().upload(index, sub_index)


def main() -> int:
    install()
    node = Slow(read_eds(family_eds("gen4")).dictionary, load_family("gen4"), 1)
    session = Conversation(Output(sys.stdout, sys.stderr), open_bus=lambda _options: simulate([node]))
    try:
        session.start({"interface": "virtual", "node": 1, "eds": str(family_eds("gen4"))})
        session.node(1).present()  # as where it was simulated by `--sim`
        node.answer_s = float(sys.argv[1])
        return run_prompt(session)
    finally:
        session.close()


if __name__ == "__main__":
    sys.exit(main())
