"""A test bench's program of the soak: does what each line of stdin asks by `import dvtcli`, and answers with a line.

    python soak_program.py PORT NODE JOURNALS EDS

A bus that died is opened again at the next line, as a program that runs for weeks does.
"""

from __future__ import annotations

import json
import sys
from contextlib import suppress
from typing import Any

import dvtcli
from dvtcli.errors import BusUnavailable, DvtcliError


def main(port: int, node_id: int, journals: str, eds: str) -> None:
    """Answer until stdin ends."""
    bus: dvtcli.Bus | None = None
    for line in sys.stdin:
        asked = json.loads(line)
        answer: dict[str, Any] = {"code": 0, "state": "done", "text": ""}
        try:
            if bus is None:
                bus = dvtcli.connect("socketcand", "can0", journal=journals, host="127.0.0.1", port=port)
            work = getattr(bus.node(node_id, eds=eds), asked["do"])
            work(*asked.get("words", ()), yes=True, **asked.get("options", {}))
        except DvtcliError as failed:
            why = f"{failed.text}; {failed.why}; {failed.state_text or ''}"
            answer = {"code": failed.exit_code, "state": failed.state, "text": why}
            if isinstance(failed, BusUnavailable) or failed.exit_code in (5, 7):
                with suppress(DvtcliError):
                    if bus is not None:
                        bus.close()
                bus = None
        sys.stdout.write(json.dumps(answer) + "\n")
        sys.stdout.flush()
    if bus is not None:
        bus.close()


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]), sys.argv[3], sys.argv[4])
