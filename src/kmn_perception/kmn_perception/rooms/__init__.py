"""Rendered rooms with a door in a wall, or none: what door estimators are trained and judged on.

A room is drawn by a seed (`sampling`, `negatives`), rendered as depth and grey (`rendering`), and
written in the format of labelled frames (`label`).
"""
