"""What the programs of all packages share: types of arguments, tables in columns, the launcher.

Imports ``configuration``; programs import it.
"""
