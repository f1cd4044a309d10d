"""A door where it stands, in its wall: from a frame to its parameters, without a prototype's view.

Planes, the vertical, the wall's metric view, edges, handle, and one fit of all. Imports `model`,
`scene` and `configuration` alone.
"""
