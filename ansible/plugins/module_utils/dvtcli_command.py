"""Runs dvtcli on a host, and makes a task's result of its JSON documents and its exit code.

Does not know CANopen: what is right, what differs and what may be written is dvtcli's own decision.
"""

from __future__ import annotations

import json
import unicodedata

from ansible.module_utils.basic import AnsibleModule

#: exit codes that a task's result is made of (docs/how-to/fleets.md)
DONE, USAGE, DIFFERS, NO_ANSWER, REFUSED, NOT_FOUND = 0, 2, 3, 5, 6, 127
#: where the role bench puts the program
HOME = "/opt/dvtcli/venv/bin"

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
    "executable": {"type": "str"},
    "timeout": {"type": "float"},
}


def dvtcli_module(**arguments):
    """A module that takes *arguments* beside those of all."""
    return AnsibleModule(argument_spec=dict(ARGUMENTS, **arguments), supports_check_mode=True)


def refuse(module, message):
    """End the task as failed before dvtcli is run, with the exit code of wrong arguments."""
    module.fail_json(
        msg=message, changed=False, exit_code=USAGE, retry=False, state="unchanged", error={}, document=None
    )


def flags(module, *names):
    """The options of dvtcli that are called as the arguments *names* are, of those that are true."""
    return ["--" + name.replace("_", "-") for name in names if module.params[name]]


def bus_words(bus):
    """The options of dvtcli that choose *bus*; none if the host's own dvtcli.toml chooses."""
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
    """One run of dvtcli: its exit code *code*, its answers *results*, its *errors*, one for each node that failed.

    *instead* is a path that *words* name, and the one that is said of it.
    """

    def __init__(self, module, words, instead=("", "")):
        self.module = module
        self.messages = ""
        self.results = []
        self.errors = []
        self.is_torn = False
        asked = module.params
        found = module.get_bin_path("dvtcli") or module.get_bin_path("dvtcli", opt_dirs=[HOME])
        program = asked["executable"] or found or "dvtcli"
        command = [program, "--json", "--color", "never", *bus_words(asked["bus"])]
        if asked["timeout"] is not None:
            command += ["--timeout", str(asked["timeout"])]
        try:
            self.code, *said = module.run_command(command + words, handle_exceptions=False)
        except OSError as failed:
            self.code = NOT_FOUND
            why = f"{program} cannot be run: {failed.strerror}; the role dvtcli.canopen.bench installs it"
            self.errors.append({"message": why, "state": "unchanged"})
            return
        named, meant = instead
        stdout, self.messages = (text.replace(named, meant) if named else text for text in said)
        for line in stdout.splitlines():
            if not line.startswith("{"):
                continue
            try:
                document = json.loads(line)
            except ValueError:  # dvtcli was killed while it wrote the line
                self.is_torn = True
                continue
            is_error = document["schema"].startswith("dvtcli.error/")
            (self.errors if is_error else self.results).append(document)
        self.warn()

    @property
    def result(self):
        """The last answer."""
        return self.results[-1] if self.results else None

    @property
    def error(self):
        """The first error, whose exit code is that of the run; None if there is none."""
        return self.errors[0] if self.errors else None

    @property
    def state(self):
        """The state of the nodes: that of the errors if they agree, C(unknown) if they do not, or if none says it."""
        if self.is_torn:
            return "unknown"
        states = {error.get("state", "unknown") for error in self.errors}
        if not states:
            return "unchanged" if self.code == DONE else "unknown"
        return states.pop() if len(states) == 1 else "unknown"

    @property
    def wrote(self):
        """Whether anything was written to a node, as far as is known."""
        others = any(error.get("done") for error in self.errors)
        return self.state != "unchanged" or others or any(map(changes, self.results))

    def warn(self):
        """Hand on notes and warnings: those of stderr, and what rules found."""
        said = [line for line in self.messages.splitlines() if line.startswith(("note: ", "warning: "))]
        for result in self.results:
            for part in [result] if "findings" in result else result.get("nodes", ()):
                said += [finding_text(finding, part.get("node")) for finding in part.get("findings", ())]
            said += ["note: " + note for note in result.get("notes", ())]
        for line in dict.fromkeys(said):
            self.module.warn(safe(line))

    def unless(self, *fine):
        """The last answer; the task fails if the exit code is none of *fine*."""
        if self.code in fine and self.result is not None:
            return self.result
        told = [error["message"] for error in self.errors if error.get("message")]
        message = "\n".join(told) or self.messages.strip() or f"dvtcli ended with {self.code} and said nothing"
        return self.fail(message, self.state)

    def fail(self, message, state, code=None):
        """End the task as failed, with all that is known; *code*: dvtcli itself would have gone on."""
        error = self.error if code is None else None
        code = self.code if code is None else code
        self.module.fail_json(
            msg=message,
            changed=self.wrote,
            exit_code=code,
            retry=code == NO_ANSWER,
            state=state,
            error=error or {},
            document=self.result,
        )

    def done(self, changed, **more):
        """End the task as ok or changed."""
        self.module.exit_json(changed=changed, exit_code=self.code, retry=False, **more)


def changes(result):
    """Whether *result* says that something was written or stored."""
    schema = result["schema"]
    if result.get("dry_run"):
        return False
    if schema == "dvtcli.apply/1":
        return bool(result["changed"] or result["stored"])
    if schema == "dvtcli.change/1":
        return result["writes"] > 0
    return schema == "dvtcli.store/1" and not result["skipped"]


def safe(text):
    """*text* with each character escaped that could control a terminal: a device or a file may have written it."""
    unsafe = ("Cc", "Cf", "Cs", "Co", "Zl", "Zp")
    return "".join(
        char.encode("unicode_escape").decode("ascii") if unicodedata.category(char) in unsafe else char for char in text
    )


def finding_text(finding, node):
    """A finding of a rule in one line."""
    place = "" if node is None else f"node {node}: "
    hint = f"; {finding['hint']}" if finding.get("hint") else ""
    return f"{finding['severity']}: {place}{finding['text']}{hint}"
