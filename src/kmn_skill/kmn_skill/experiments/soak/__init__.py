"""The whole system for hours, while nodes die, floods come, clocks jump and disks are full."""
