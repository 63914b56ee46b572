"""Runs dvtcli on a host, and makes a task's result of its JSON documents and its exit code.

Does not know CANopen: what is right, what differs and what may be written is dvtcli's own decision.
"""

from __future__ import annotations

import json

#: exit codes of dvtcli that a task's result is made of (docs/reference/exit-codes.md)
DONE, DIFFERS, NO_ANSWER = 0, 3, 5

#: how a task says which bus, for every module of this collection
BUS_OPTIONS = {
    "interface": {"type": "str"},
    "channel": {"type": "str"},
    "bitrate": {"type": "int"},
    "kwargs": {"type": "dict", "default": {}},
    "sim": {"type": "list", "elements": "str", "default": []},
}
ARGUMENTS = {
    "bus": {"type": "dict", "default": {}, "options": BUS_OPTIONS},
    "executable": {"type": "str", "default": "dvtcli"},
    "timeout": {"type": "float"},
}


def bus_words(bus):
    """The options of dvtcli that choose *bus*; none where the host's own dvtcli.toml chooses."""
    words = []
    for key in ("interface", "channel", "bitrate"):
        if bus.get(key) is not None:
            words += ["--" + key, str(bus[key])]
    for key, value in (bus.get("kwargs") or {}).items():
        words += ["--bus-kwargs", f"{key}={value}"]
    for node in bus.get("sim") or []:
        words += ["--sim", node]
    return words


class Ended:
    """One run of dvtcli: its exit code, its result, and its error, each None where there is none."""

    def __init__(self, module, words):
        asked = module.params
        command = [asked["executable"], "--json", "--color", "never", *bus_words(asked["bus"])]
        if asked["timeout"] is not None:
            command += ["--timeout", str(asked["timeout"])]
        self.code, stdout, self.messages = module.run_command(command + words, handle_exceptions=True)
        found = [json.loads(line) for line in stdout.splitlines() if line.startswith("{")]
        errors = [one for one in found if one["schema"].startswith("dvtcli.error/")]
        results = [one for one in found if not one["schema"].startswith("dvtcli.error/")]
        self.error = errors[-1] if errors else None
        self.result = results[-1] if results else None
        self.module = module

    def unless(self, *fine):
        """End the task as failed, or its host as unreachable, where the exit code is none of *fine*."""
        if self.code in fine and self.result is not None:
            return self.result
        error = self.error or {}
        wrong = [f"{one['file']}:{one['line']}:{one['column']}: {one['text']}" for one in error.get("complaints", ())]
        said = [*wrong, error.get("text"), error.get("why"), error.get("hint")]
        told = {
            "msg": "; ".join(part for part in said if part) or self.messages.strip() or "dvtcli said nothing",
            "exit_code": self.code,
            "state": error.get("state", "unknown"),
            "error": error,
            "document": self.result,
        }
        if self.code == NO_ANSWER:
            self.module.exit_json(unreachable=True, changed=False, **told)
        self.module.fail_json(changed=error.get("state") == "left_changed", **told)
        return None
