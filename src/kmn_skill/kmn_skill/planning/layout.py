"""Which column of a configuration is which joint.

A configuration (D,) of robot and object is the robot's J positions, then those of the object's
joints. The robot's are its base, its arm, of however many axes, and its gripper. To name a joint
of a whole configuration take the part first: ``path[:, ROBOT][:, GRIPPER]``.
"""

from __future__ import annotations

# Of a configuration (D,).
ROBOT, DOOR = slice(None, -2), slice(-2, None)

# Of the robot's positions (J,).
BASE, BASE_POSITION = slice(0, 3), slice(0, 2)
ARM, BASE_AND_ARM = slice(3, -1), slice(None, -1)
GRIPPER = -1

# Of the door's angles (2,).
HINGE, HANDLE = 0, 1
