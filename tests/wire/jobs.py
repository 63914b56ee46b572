"""Jobs whose frames are kept: sending commands with good input, and what follows on refusals, lost nodes and kills."""

from __future__ import annotations

from dataclasses import dataclass

#: files that jobs read
FILES = {
    "net.yaml": """\
nodes:
  drive:
    node_id: 1
    dcf: gen4
    tpdo:
      1: {cob_id: 0x181, event_timer: 20, mapping: [6041, 606C]}
  io:
    node_id: 5
    dcf: generic
    tpdo:
      1: {event_timer: 50, mapping: [6000:01, 6401:01]}
    rpdo:
      1: {cob_id: 0x181, enabled: true, mapping: [dummy/16, dummy/32]}
""",
    "stored.yaml": """\
nodes:
  a: {node_id: 5, dcf: generic, store: true, tpdo: {1: {event_timer: 50}}}
  b: {node_id: 9, dcf: generic, store: true, tpdo: {1: {event_timer: 60}, 2: {enabled: false}}}
""",
    "atomic.dvt": """\
set 5:tpdo1 --timer 30
map 9:tpdo2 6000:01 6401:01
set 5:tpdo2 --inhibit 20
""",
    "job.tcl": "foreach number {1 2} {\n    set tpdo tpdo$number\n    dvtcli set $tpdo --timer 40\n}\n",
    "fw.bin": "a program of forty bytes, and eight more",
}


@dataclass(frozen=True)
class Job:
    """Lines typed one after the other; `---` ends the process, and another one goes on with the next line."""

    name: str
    lines: tuple[str, ...]
    nodes: tuple[str, ...] = ("gen4@1",)
    faults: tuple[str, ...] = ()
    selected: tuple[int, ...] = ()


def job(name: str, *lines: str, nodes: str = "gen4@1", faults: str = "", selected: str = "") -> Job:
    """A job on *nodes*, of which *selected* are selected, by default the only one."""
    if not selected and " " not in nodes:
        selected = nodes.partition("@")[2].replace("255", "")
    return Job(name, lines, tuple(nodes.split()), tuple(faults.split()), tuple(map(int, selected.split())))


BOTH, TWO = "gen4@1 generic@5", "generic@5 generic@9"
MAP, COB_ID = "map tpdo1 6041 606C", "set tpdo3 --cob-id 0x3A1"
JOBS = (
    job("scan", "scan", nodes=BOTH),
    job("node", "node"),
    job("pdo", "pdo"),
    job("pdo-without-eds", "pdo", nodes="lely@3"),
    job("read", "read 1018 6041 1008"),
    job("faults", "faults"),
    job("map", MAP),
    job("map-again", MAP, MAP),
    job("map-off", "map tpdo3 6041 --off"),
    job("map-dummies", "map rpdo3 dummy/16 60FF"),
    job("map-wanting-count-first", MAP, nodes="tmcm@1"),
    job("set-timer", "set tpdo1 --timer 100"),
    job("set-cob-id", COB_ID),
    job("set-transmission", "set tpdo1 --type 1"),
    job("set-inhibit", "set tpdo1 --inhibit 10"),
    job("enable-disable", "disable tpdo1", "enable tpdo1"),
    job("clear", "clear tpdo1"),
    job("clear-all", "clear all"),
    job("vpdo", "vpdo", "vpdo digital-in 1 fwd_switch"),
    job("write", "write 1017 500 --as u16"),
    job("write-cob-id", "disable tpdo1", "write 1800:1 0x800001A1"),
    job("write-only", "write 2004 5", nodes="generic@5"),
    job("nmt", "nmt start", "nmt preop", "nmt reset-node"),
    job("sync", "sync --count 3"),
    job("send", "send 123#0102"),
    job("verify", MAP, "verify"),
    job("undo", MAP, "undo"),
    job("undo-all", MAP, COB_ID, "undo --all"),
    job("undo-of-another-process", MAP, "---", "undo"),
    job("store", "set tpdo1 --timer 100", "store"),
    job("store-prove", "set tpdo1 --timer 100", "store --prove"),
    job("store-of-two", "set 5:tpdo1 --timer 30", "set 9:tpdo1 --timer 30", "store", nodes=TWO, selected="5 9"),
    job("restore-prove", "restore --prove"),
    job("backup-compare", "backup all.jsonl", "compare all.jsonl", nodes="generic@5"),
    job("backup-apply", "backup all.jsonl", "map tpdo1 6000:01", "apply all.jsonl", nodes="generic@5"),
    job("clone", "backup all.jsonl", "set tpdo1 --timer 30", "clone all.jsonl", nodes="generic@5"),
    job("dcf", "export one.dcf", "set tpdo1 --timer 30", "apply one.dcf", nodes="generic@5"),
    job("import", "import found.yaml", nodes=BOTH),
    job("plan", "plan net.yaml", nodes=BOTH),
    job("apply", "apply net.yaml", "verify net.yaml", nodes=BOTH),
    job("apply-again", "apply net.yaml", "apply net.yaml", nodes=BOTH),
    job("apply-saved-plan", "plan net.yaml -o plan.json", "---", "apply plan.json", nodes=BOTH),
    job("apply-stores", "apply stored.yaml", nodes=TWO),
    job("apply-proves", "apply stored.yaml --prove", nodes=TWO),
    job("undo-network", "apply net.yaml", "undo --all", nodes=BOTH),
    job("link-unlink", "map 5:rpdo2 6200:01 6411:01 --off", "map 9:tpdo1 6000:01 6401:01",
        "link 9:tpdo1 5:rpdo2", "unlink 9:tpdo1 5:rpdo2", nodes=TWO),
    job("script", "run atomic.dvt", nodes=TWO),
    job("atomic-script", "run atomic.dvt --atomic", nodes=TWO),
    job("tcl", "run job.tcl", nodes="generic@5"),
    job("dry-run", "map tpdo1 6041 606C --dry-run"),
    job("download", "download fw.bin", nodes="loader@5"),
    job("lss", "lss scan", "lss node-id 7 vendor=0 product=0x301 revision=0x10000 serial=1", nodes="generic@255"),
    job("learn", "learn", nodes="tmcm@1"),
    job("map-refused", MAP, faults="refuse@4=0x06090030"),
    job("map-refused-in-operational", "nmt start", MAP, nodes="canopennode@1"),
    job("map-answer-lost", MAP, faults="lose-response@3"),
    job("map-answer-late", MAP, faults="late@3=5"),
    job("map-node-restarts", MAP, faults="reset@3"),
    job("map-enable-alters", MAP, faults="enable-alters=1801:2:0x05"),
    job("map-way-back-refused", MAP, "recover", faults="refuse@4=0x06090030 refuse@6=0x06090030"),
    job("killed-recover", MAP, "---", "recover", faults="bus-error@4"),
    job("killed-discard", MAP, "---", "recover --accept", faults="bus-error@4"),
    job("store-fails", "set tpdo1 --timer 100", "store", faults="store-fails"),
    job("store-not-kept", "set tpdo1 --timer 100", "store --prove", faults="stores-nothing"),
    job("apply-refused", "apply net.yaml", nodes=BOTH, faults="5:refuse@3=0x06090030"),
    job("apply-killed", "apply stored.yaml", "---", "recover", nodes=TWO, faults="9:bus-error@2"),
    job("apply-store-killed", "apply stored.yaml", "---", "recover --finish", nodes=TWO, faults="9:bus-error@4"),
    job("atomic-script-refused", "run atomic.dvt --atomic", nodes=TWO, faults="9:refuse@2=0x06090030"),
)  # fmt: skip
