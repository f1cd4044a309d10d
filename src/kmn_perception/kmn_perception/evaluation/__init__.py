"""Offline evaluation of the method and its peers."""
