"""The frozen program: dvtcli, or the Python that dvtcli asks for (`dvtcli.interpreter`)."""

import os
import sys

from dvtcli.interpreter import AS_PYTHON

if sys.argv[1:2] == [AS_PYTHON]:
    if os.path.isdir(tcl := os.path.join(sys._MEIPASS, "_tcl_data")):  # noqa: PTH112, PTH118, SLF001 - pathlib takes long
        os.environ["TCL_LIBRARY"] = tcl
    words = sys.argv[2:]
    while words[0] in ("-I", "-S", "-P"):
        del words[0]
    if words[0] == "-m":
        import runpy

        sys.argv = words[1:]
        runpy.run_module(words[1], run_name="__main__", alter_sys=True)
    else:
        sys.argv = ["-c", *words[2:]]
        exec(words[1], {"__name__": "__main__"})  # noqa: S102 - the code is dvtcli's own
else:
    from dvtcli.__main__ import entry

    sys.exit(entry())
