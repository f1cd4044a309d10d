"""What the programs of all packages share: types of arguments, tables in columns, the launcher.

Imports nothing of this package; programs import it.
"""
