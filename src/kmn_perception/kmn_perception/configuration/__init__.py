"""Where the package's files lie, and how YAML files are read with errors that name file and key.

Imports nothing of this package; everything else may import it.
"""
