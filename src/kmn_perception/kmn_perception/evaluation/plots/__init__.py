"""The figures of the results, drawn without a display."""
