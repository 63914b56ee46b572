"""Hostile input for every reader, the SDO client and server, and the views.

`targets` says what each must do whatever it is given, `grammar` makes input that is nearly right, `drive` runs both.
"""
