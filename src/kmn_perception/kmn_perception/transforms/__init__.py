"""Where frames are in each other at a time: tf2's semantics, without ROS.

`TransformBuffer` keeps transforms and composes them, `TransformWatch` notices what makes them
doubtful. The node's side of it, with the topics, is in ``ros/transforms.py``.
"""
