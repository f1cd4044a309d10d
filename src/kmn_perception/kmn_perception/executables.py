"""The executables of the package: the one list that set-up, ``run`` and launcher read."""

# Name, module with a ``main``, and what it needs beside the nodes: each USE of ``make setup-USE``.
EXECUTABLES = {
    "morph_node": ("kmn_perception.ros.morph_node", ""),
    "print_parameters": ("kmn_perception.ros.print_parameters", ""),
    "viewer": ("kmn_perception.viewer.viewer_node", "viewer"),
    "replay": ("kmn_perception.bags.replay", ""),
    "make_example_bag": ("kmn_perception.bags.example_bag", ""),
    "demo_bag": ("kmn_perception.bags.demo", ""),
    "train": ("kmn_perception.training.train", "training"),
    "train_doors": ("kmn_perception.training.train_doors", "training"),
    "draw_model": ("kmn_perception.visualization.draw_model", ""),
    "evaluate": ("kmn_perception.evaluation.evaluate", "evaluation"),
    "evaluate_models": ("kmn_perception.evaluation.evaluate_models", ""),
    "evaluate_frames": ("kmn_perception.experiments.evaluate_frames", "evaluation"),
    "evaluate_doors": ("kmn_perception.experiments.evaluate_doors", "evaluation"),
    "evaluate_fusion": ("kmn_perception.evaluation.doors.evaluate_fusion", ""),
    "merge": ("kmn_perception.experiments.merge", "evaluation"),
    "submit": ("kmn_perception.experiments.submit", "evaluation cluster"),
    "results": ("kmn_perception.evaluation.results", "evaluation"),
    "render_rooms": ("kmn_perception.rooms.render_rooms", ""),
    "model_schema": ("kmn_perception.model.model_schema", ""),
    "benchmark": ("kmn_perception.benchmark", ""),
}
