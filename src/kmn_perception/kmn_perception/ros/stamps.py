"""Times and durations of messages, in seconds."""

from __future__ import annotations

from builtin_interfaces.msg import Duration, Time

NANOSECONDS = 10**9  # of a second


def seconds(stamp: Time | Duration) -> float:
    """Return a stamp or a duration in seconds."""
    return float(stamp.sec + stamp.nanosec / NANOSECONDS)


def stamp_of(time: float) -> Time:
    """Return the stamp of a time in seconds."""
    sec, nanosec = divmod(round(time * NANOSECONDS), NANOSECONDS)
    return Time(sec=sec, nanosec=nanosec)


def duration_of(time: float) -> Duration:
    """Return the duration of a time in seconds."""
    sec, nanosec = divmod(round(time * NANOSECONDS), NANOSECONDS)
    return Duration(sec=sec, nanosec=nanosec)
