"""One file a command, named as the command; its docstring's first line is the command's one-line help.

A file holds `command`. Files with a leading underscore are helpers.
"""
