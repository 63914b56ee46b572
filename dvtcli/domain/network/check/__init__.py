"""The rules of `check`: what is wrong with a network as a whole. Each file declares its rules above what checks them.

Knows states, not files or nodes: who asks says where a spot is.
"""
