"""Which column of a configuration is which joint.

A configuration (D,) of robot and object is the robot's J positions, then those of two joints of the
object: the one that is moved, and the one that unlatches it. Where nothing does, the latter stands
still. The robot's are its base, its arm, of however many axes, and its gripper. To name a joint
of a whole configuration take the part first: ``path[:, ROBOT][:, GRIPPER]``.
"""

from __future__ import annotations

# Of a configuration (D,).
ROBOT, OBJECT_JOINTS = slice(None, -2), slice(-2, None)

# Of the robot's positions (J,).
BASE, BASE_POSITION = slice(0, 3), slice(0, 2)
ARM, BASE_AND_ARM = slice(3, -1), slice(None, -1)
GRIPPER = -1

# Of the object's joints (2,).
MOVED, LATCH = 0, 1
