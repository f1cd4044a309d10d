"""The PR2 in the physics: its motors follow desired states with bounded effort."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kmn_sim.control.interpolation import State
from kmn_sim.robot.settings import RobotSettings

UNLIMITED = 1e6  # radians; of joints that turn on and on
HAND_LINKS = ("finger",)  # parts of link names whose contact is that of the grip


class SimulatedRobot:
    """The robot, with its base on a floor of a given height.

    Attributes
    ----------
    body
        Number of the body in the physics.
    limits
        Lower and upper position of the movable joints by name, m and rad.
    """

    def __init__(
        self,
        physics: Any,
        urdf: Path,
        settings: RobotSettings,
        base: Sequence[float],
        floor: float,
        step_time: float,
    ) -> None:
        self._physics, self._settings = physics, settings
        self.body: int = physics.loadURDF(
            str(urdf),
            basePosition=(0.0, 0.0, floor),
            useFixedBase=True,
            flags=physics.URDF_USE_INERTIA_FROM_FILE,
        )
        self._joints = {
            info[1].decode(): info
            for info in map(self._info, range(physics.getNumJoints(self.body)))
        }
        self._moved = [self._joints[name][0] for name in settings.names]
        self._all = [joint[0] for joint in self._joints.values() if joint[3] >= 0]
        self.limits = {name: _limits(self._joints[name]) for name in settings.names}
        self._efforts = [motor.effort for motor in settings.joints.values()]
        self._speeds = np.array([motor.velocity for motor in settings.joints.values()])
        self._gain = settings.position_gain / step_time
        self._place(base)
        self._set_contacts()
        self._couple_fingers()

    def link(self, joint: str) -> int:
        """Return the number of the link that a joint moves."""
        return int(self._joints[joint][0])

    def state(self) -> State:
        """Return the measured state of the movable joints."""
        states = self._physics.getJointStates(self.body, self._moved)
        positions, velocities = (np.array([state[i] for state in states]) for i in (0, 1))
        return State(positions, velocities, np.zeros_like(positions))

    def efforts(self) -> NDArray[np.float64]:
        """Return the efforts (J,) of the motors in the last step, N and N m."""
        states = self._physics.getJointStates(self.body, self._moved)
        return np.array([state[3] for state in states])

    def update(self, desired: State, measured: State) -> None:
        """Let the motors drive from the measured to a desired state in the physics' next step."""
        error = desired.positions - measured.positions
        velocities = desired.velocities + self._gain * error
        self._physics.setJointMotorControlArray(
            self.body,
            self._moved,
            self._physics.VELOCITY_CONTROL,
            targetVelocities=np.clip(velocities, -self._speeds, self._speeds).tolist(),
            forces=self._efforts,
        )
        self._compensate_gravity()

    def _info(self, joint: int) -> Any:
        return self._physics.getJointInfo(self.body, joint)

    def _place(self, base: Sequence[float]) -> None:
        """Put all joints where they start, the base at x, y, yaw."""
        homes = [*base, *[motor.home for motor in self._settings.joints.values()][3:]]
        starts = dict(zip(self._settings.names, homes, strict=True))
        for name in self._settings.followers:
            starts[name] = starts[self._settings.leader]
        for name, position in starts.items():
            self._physics.resetJointState(self.body, self._joints[name][0], position)

    def _set_contacts(self) -> None:
        """Give the fingers their friction, and take away the engine's own damping."""
        for name, info in self._joints.items():
            self._physics.changeDynamics(
                self.body, info[0], linearDamping=0.0, angularDamping=0.0, jointDamping=0.0
            )
            if any(part in name for part in HAND_LINKS):
                self._physics.changeDynamics(
                    self.body,
                    info[0],
                    lateralFriction=self._settings.friction,
                    spinningFriction=self._settings.spinning_friction,
                )

    def _couple_fingers(self) -> None:
        """Gear the gripper's joints to the first one; the engine ignores mimic joints."""
        leader = self._joints[self._settings.leader][0]
        for name in self._settings.followers:
            follower = self._joints[name][0]
            self._physics.setJointMotorControl2(
                self.body, follower, self._physics.VELOCITY_CONTROL, force=0.0
            )
            gear = self._physics.createConstraint(
                self.body,
                leader,
                self.body,
                follower,
                self._physics.JOINT_GEAR,
                jointAxis=(0.0, 0.0, 1.0),
                parentFramePosition=(0.0, 0.0, 0.0),
                childFramePosition=(0.0, 0.0, 0.0),
            )
            self._physics.changeConstraint(
                gear, gearRatio=-1.0, maxForce=self._settings.follower_effort, erp=0.2
            )

    def _compensate_gravity(self) -> None:
        """Add the efforts that hold the robot's weight, as the PR2's springs and controllers do."""
        states = self._physics.getJointStates(self.body, self._all)
        zeros = [0.0] * len(states)
        efforts = self._physics.calculateInverseDynamics(
            self.body, [state[0] for state in states], zeros, zeros
        )
        self._physics.setJointMotorControlArray(
            self.body, self._all, self._physics.TORQUE_CONTROL, forces=efforts
        )


def _limits(info: Any) -> tuple[float, float]:
    """Return the lower and upper position of a joint; one that turns on and on has none."""
    low, high = info[8], info[9]
    return (low, high) if low < high else (-UNLIMITED, UNLIMITED)
