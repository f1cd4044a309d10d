"""Manipulation skills planned on the estimated kinematic model.

The rooms: ``planning`` (from an object's parameters to a checked plan), ``execution`` (what is done
with it), ``ros`` (the node), and on top of it ``experiments``. Each imports only from those before.
"""
