"""Kinematic Morphing Networks: from a depth camera to the morphing parameters of an object.

The rooms, each of which imports only from those named before it: ``configuration`` (YAML files),
``command_line``, ``model`` (the analytic models of object, camera and sensor), ``scene`` (from a
frame to what may be objects), ``network`` (Algorithm 1) and ``refinement`` (the fit), beside each
other; the two front doors `estimator` (one object) and `pipeline` (a frame); offline ``training``,
``visualization`` and ``evaluation``; ``ros`` (the node); and on top of it ``experiments``, ``bags``
and ``benchmark``.
"""

from pathlib import Path as _Path

from kmn_perception.configuration.compile_cache import choose_compile_cache as _choose_compile_cache

_choose_compile_cache(_Path(__file__).parent)
