"""Ansible's own programs on this machine alone: hosts with local connections, each with a served bus of its own."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.process import PATIENCE_S, environment
from tests.simulator.serve.served import ANSWER_S, Served, own_environment
from tests.surroundings import ROOT

#: what the last lines of a playbook's run say of a host
_RECAP = re.compile(r"^(?P<host>[\w-]+) +: (?P<counts>(?:\w+=\d+ *)+)$", re.MULTILINE)
_RESULT = re.compile(r"^\w+: \[(?P<host>[\w-]+)\](?:: \w+!)? => (?P<result>\{.*\})$", re.MULTILINE)
BINARIES = Path(sys.executable).parent


@dataclass
class Played:
    """A run of a playbook."""

    code: int
    said: str

    @property
    def recap(self) -> dict[str, dict[str, int]]:
        """Of each host how many tasks were ok, changed, unreachable, failed."""
        return {
            found["host"]: {key: int(count) for key, count in re.findall(r"(\w+)=(\d+)", found["counts"])}
            for found in _RECAP.finditer(self.said)
        }

    def results(self, task: str) -> dict[str, dict[str, Any]]:
        """Of each host what *task* ended with, the last time; with -v or for a failure."""
        part = self.said.rpartition(f"TASK [{task}] ")[2].partition("\nTASK [")[0]
        return {found["host"]: json.loads(found["result"]) for found in _RESULT.finditer(part)}

    def hosts(self, what: str) -> set[str]:
        """The hosts of which *what* was counted at least once."""
        return {host for host, counts in self.recap.items() if counts[what]}


class Fleet:
    """Hosts named in an inventory, and the collection where Ansible finds it."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.hosts: dict[str, dict[str, object]] = {}
        collections = folder / "collections" / "ansible_collections" / "dvtcli"
        collections.mkdir(parents=True)
        (collections / "canopen").symlink_to(ROOT / "ansible", target_is_directory=True)

    def host(self, name: str, served: Served | None, **variables: object) -> None:
        """Add a host that reaches *served*; None: nothing listens on its port."""
        port = 1 if served is None else served.port
        bus = {"interface": "socketcand", "channel": "can0", "kwargs": {"host": "127.0.0.1", "port": port}}
        self.hosts[name] = {
            "ansible_connection": "local",
            "ansible_python_interpreter": sys.executable,
            "canopen_bus": bus,
            **variables,
        }

    def play(self, tasks: list[dict[str, object]], *options: str, roles: tuple[str, ...] = ()) -> Played:
        """Run *roles* and *tasks* on all hosts, with *options* of ansible-playbook."""
        play = {"hosts": "all", "gather_facts": False, "tasks": tasks, "roles": list(roles)}
        return self.play_text(json.dumps([play]), *options)

    def play_text(self, text: str, *options: str) -> Played:
        """Run the playbook *text*; all hosts are the group `benches`."""
        inventory, playbook = self.folder / "hosts.json", self.folder / "play.yaml"
        inventory.write_text(json.dumps({"all": {"children": {"benches": {"hosts": self.hosts}}}}), "utf-8")
        playbook.write_text(text, "utf-8")
        ran = subprocess.run(
            [str(BINARIES / "ansible-playbook"), "-i", str(inventory), *options, str(playbook)],
            env=environment() | self.settings(),
            capture_output=True,
            text=True,
            timeout=PATIENCE_S * 4,
            cwd=self.folder,
            check=False,
        )
        return Played(ran.returncode, ran.stdout + ran.stderr)

    def settings(self) -> dict[str, str]:
        """Where Ansible finds the collection and dvtcli, where both put their files, and patience with the nodes."""
        state = own_environment(self.folder)
        return {
            "DVTCLI_TIMEOUT": ANSWER_S,
            "XDG_STATE_HOME": state["XDG_STATE_HOME"],
            "PATH": os.pathsep.join([str(BINARIES), state["PATH"]]),
            "ANSIBLE_PIPELINING": "1",
            "ANSIBLE_CALLBACK_FORMAT_PRETTY": "0",
            "ANSIBLE_COLLECTIONS_PATH": str(self.folder / "collections"),
            "ANSIBLE_HOME": str(self.folder / "ansible"),
            "ANSIBLE_LOCAL_TEMP": str(self.folder / "controller"),
            "ANSIBLE_REMOTE_TEMP": str(self.folder / "host"),
            "ANSIBLE_FORKS": "10",
            "ANSIBLE_NOCOLOR": "1",
            "ANSIBLE_RETRY_FILES_ENABLED": "0",
            "ANSIBLE_LOCALHOST_WARNING": "0",
            "LC_ALL": "C.UTF-8",
        }
