"""Recordings (rosbag2): reading, writing, replay, the example of real frames, and its demo.

Imports ``ros``; nothing imports it.
"""
