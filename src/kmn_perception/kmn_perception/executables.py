"""The executables of the package."""

from __future__ import annotations

from kmn_perception.command_line.launcher import executable as _executable

morph_node = _executable("kmn_perception.ros.start_morph_node")
replay = _executable("kmn_perception.bags.replay")
make_example_bag = _executable("kmn_perception.bags.example_bag")
demo_bag = _executable("kmn_perception.bags.demo")
train = _executable("kmn_perception.training.train")
evaluate = _executable("kmn_perception.evaluation.evaluate")
evaluate_frames = _executable("kmn_perception.experiments.evaluate_frames")
results = _executable("kmn_perception.evaluation.results")
benchmark = _executable("kmn_perception.benchmark")
