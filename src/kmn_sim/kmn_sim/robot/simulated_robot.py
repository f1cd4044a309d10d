"""The robot in the physics: its motors follow desired states with bounded effort."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kmn_perception.model.transformation import rotation_z
from kmn_sim.control.interpolation import State, nearest
from kmn_sim.robot.odometry import Odometry
from kmn_sim.robot.settings import BASE_SIZE, RobotSettings

PLACE = slice(0, 2)  # of the base, among the joints
UNLIMITED = 1e6  # radians; of joints that turn on and on
GEAR_CORRECTION = 0.2  # part of the error between two geared joints that a step takes away


class SimulatedRobot:
    """The robot, with its base on a floor.

    Parameters
    ----------
    physics
        Client of the physics engine.
    urdf, settings
        The robot's model, and what it lacks.
    start
        Positions by name of joints that start elsewhere than at home, m and rad.
    floor
        Height of the floor, metres.
    step_time
        Of the physics, seconds.
    drift
        Metres by which odometry errs for each metre driven.

    Attributes
    ----------
    body
        Number of the body in the physics.
    limits
        Lower and upper position of the movable joints by name, m and rad.
    continuous
        (J,) whether a whole turn of a joint changes nothing.
    told
        (J,) whether a joint is one that messages tell of.
    """

    def __init__(
        self,
        physics: Any,
        urdf: Path,
        settings: RobotSettings,
        start: Mapping[str, float],
        floor: float,
        step_time: float,
        drift: float,
    ) -> None:
        self._physics, self._settings, self._floor = physics, settings, floor
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
        self.continuous = np.isin(settings.names, settings.continuous)
        self.told = np.isin(settings.names, settings.told_names)
        self._efforts = {name: motor.effort for name, motor in settings.joints.items()}
        self._speeds = np.array([motor.velocity for motor in settings.joints.values()])
        self._gain = settings.simulation.position_gain / step_time
        for name, position in {**settings.home, **start}.items():
            physics.resetJointState(self.body, self.link(name), position)
        x, y, _ = self._base()
        self._odometry = Odometry(np.array([x, y]), drift)
        self._set_contacts()
        self._couple_fingers()

    def link(self, joint: str) -> int:
        """Return the number of the link that a joint moves."""
        return int(self._joints[joint][0])

    def state(self) -> State:
        """Return the measured state of the movable joints; of the base by odometry."""
        states = self._physics.getJointStates(self.body, self._moved)
        positions, velocities = (np.array([state[i] for state in states]) for i in (0, 1))
        positions[PLACE] = self._odometry.place(positions[PLACE])
        return State(positions, velocities, np.zeros_like(positions))

    def base_pose(self) -> NDArray[np.float64]:
        """Return the pose (4, 4) of the base on the floor, in the world."""
        x, y, yaw = self._base()
        return _pose(x, y, self._floor, yaw)

    def odometry_pose(self) -> NDArray[np.float64]:
        """Return the pose (4, 4) of the base by odometry, whose frame lies on the floor."""
        x, y, yaw = self.state().positions[:BASE_SIZE]
        return _pose(x, y, 0.0, yaw)

    def efforts(self) -> NDArray[np.float64]:
        """Return the efforts (J,) of the motors in the last step, N and N m."""
        states = self._physics.getJointStates(self.body, self._moved)
        return np.array([state[3] for state in states])

    def limit_effort(self, joint: str, effort: float) -> None:
        """Let a motor have this effort at most, N or N m, as far as it has it; 0: its own."""
        own = self._settings.joints[joint].effort
        self._efforts[joint] = min(effort, own) if effort > 0.0 else own

    def error(self, desired: State, measured: State) -> NDArray[np.float64]:
        """Return by how much the joints (J,) are not where they should be; without whole turns."""
        return nearest(desired.positions - measured.positions, np.zeros(1), self.continuous)

    def update(self, desired: State, measured: State) -> None:
        """Let the motors drive from the measured to a desired state in the physics' next step."""
        error = self.error(desired, measured)
        velocities = desired.velocities + self._gain * error
        self._physics.setJointMotorControlArray(
            self.body,
            self._moved,
            self._physics.VELOCITY_CONTROL,
            targetVelocities=np.clip(velocities, -self._speeds, self._speeds).tolist(),
            forces=list(self._efforts.values()),
        )
        self._compensate_gravity()

    def _base(self) -> list[float]:
        """Return where the base is: x and y, metres, and yaw, radians."""
        joints = [self.link(name) for name in self._settings.base_names]
        return [state[0] for state in self._physics.getJointStates(self.body, joints)]

    def _info(self, joint: int) -> Any:
        return self._physics.getJointInfo(self.body, joint)

    def _set_contacts(self) -> None:
        """Give the fingers their friction, and take away the engine's own damping."""
        grip = self._settings.simulation
        for name, info in self._joints.items():
            self._physics.changeDynamics(
                self.body, info[0], linearDamping=0.0, angularDamping=0.0, jointDamping=0.0
            )
            if name in self._settings.finger_names:
                self._physics.changeDynamics(
                    self.body,
                    info[0],
                    lateralFriction=grip.friction,
                    spinningFriction=grip.spinning_friction,
                )

    def _couple_fingers(self) -> None:
        """Gear the gripper's joints to the first one; the engine ignores mimic joints."""
        leader, *followers = map(self.link, self._settings.finger_names)
        for follower in followers:
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
                gear,
                gearRatio=-1.0,
                maxForce=self._settings.simulation.follower_effort,
                erp=GEAR_CORRECTION,
            )

    def _compensate_gravity(self) -> None:
        """Add the efforts that hold the robot's weight, as springs and controllers do."""
        states = self._physics.getJointStates(self.body, self._all)
        zeros = [0.0] * len(states)
        efforts = self._physics.calculateInverseDynamics(
            self.body, [state[0] for state in states], zeros, zeros
        )
        self._physics.setJointMotorControlArray(
            self.body, self._all, self._physics.TORQUE_CONTROL, forces=efforts
        )


def _pose(x: float, y: float, z: float, yaw: float) -> NDArray[np.float64]:
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation_z(np.asarray(yaw)), (x, y, z)
    return pose


def _limits(info: Any) -> tuple[float, float]:
    """Return the lower and upper position of a joint; one that turns on and on has none."""
    low, high = info[8], info[9]
    return (low, high) if low < high else (-UNLIMITED, UNLIMITED)
