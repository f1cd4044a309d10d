"""The directions of upright edges, finely."""

from __future__ import annotations

import numpy as np

from kmn_perception.doors.candidates import Candidate
from kmn_perception.doors.lines import Line, Pieces, gaussian_steps, row_sums
from kmn_perception.doors.settings import DoorSettings
from kmn_perception.doors.wall_view import WallView

_FEWEST = 3  # pieces of an edge that tell where it is


def measure_edge(candidate: Candidate, line: Line, settings: DoorSettings) -> tuple[float, float]:
    """Return the direction of an edge and its standard deviation, if it is the door's.

    Returns
    -------
    direction, deviation
        Metres to the right per metre away from the camera.
    """
    distance = candidate.view.frame.distance
    noise = settings.fit.edge_noise * float(candidate.view.footprint[line.column])
    place = float(candidate.view.s[line.column])
    if line.contrast == 0.0 and candidate.proposals is not None:
        scatter = noise + settings.network.deviation
    elif line.contrast == 0.0:
        scatter = 3.0 * noise + settings.fit.step_edge_noise
    else:
        place, scatter = _subpixel(candidate.view, candidate.pieces, line, settings)
    deviation = np.sqrt(noise**2 + scatter**2 + settings.fit.least_edge_noise**2)
    return place / distance, float(deviation) / distance


def _subpixel(
    view: WallView, pieces: Pieces, line: Line, settings: DoorSettings
) -> tuple[float, float]:
    """Return the place of an edge and the standard deviation of its mean, metres."""
    assert view.grey is not None
    fine, least = settings.lines.fine_smoothing, 0.6 * settings.lines.min_contrast
    reach = round(0.5 * settings.lines.tie / float(view.s[1] - view.s[0])) + int(np.ceil(3 * fine))
    first = max(line.column - reach, 0)
    columns = slice(first, line.column + reach + 1)
    number = pieces.known.shape[0]
    shown = pieces.body & (pieces.known[:, columns].mean(axis=1) > 0.7)
    pixel = float(view.s[1] - view.s[0])
    unknown = float(view.s[line.column]), 2.0 * pixel
    if shown.sum() < _FEWEST:
        return unknown
    shade = row_sums(np.ascontiguousarray(view.grey[:, columns]), pieces.rows, number)[shown]
    shade /= np.bincount(pieces.rows + 1, minlength=number + 1)[1:][shown, None]
    profiles = line.sign * gaussian_steps(shade, fine)
    near = np.abs(first + np.arange(profiles.shape[1]) - line.column) <= 3
    places = []
    for profile in profiles[profiles[:, near].max(axis=1, initial=0.0) >= least]:
        peak = int(np.where(near, profile, -1.0).argmax())
        window = slice(max(peak - 2, 0), peak + 3)
        weights = np.maximum(profile[window] - 0.5 * profile[peak], 0.0)
        at = first + window.start + np.arange(len(weights))
        places.append(float((weights * at).sum() / weights.sum()))
    if len(places) < _FEWEST:
        return unknown
    found = np.array(places)
    middle = np.median(found)
    scatter = max(1.48 * float(np.median(np.abs(found - middle))), 0.6)
    near = found[np.abs(found - middle) < 3.0 * scatter]
    spread = float(near.std()) / np.sqrt(max(len(near) / 3.0, 1.0))
    return float(view.s[0] + near.mean() * pixel), spread * pixel
