"""The plots of the results, drawn without a display."""
