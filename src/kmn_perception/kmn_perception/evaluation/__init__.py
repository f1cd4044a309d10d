"""Offline evaluation of the method and its peers on rendered samples, and the page of results.

Imports ``training`` (its samples) and all that the estimator does; not ``ros``.
"""
