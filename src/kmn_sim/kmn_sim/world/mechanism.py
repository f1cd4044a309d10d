"""An object with joints in the physics: friction, springs, latches, stops."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kmn_perception.model.rotation import quaternion_from_matrix
from kmn_sim.world.cuboids import object_cuboids
from kmn_sim.world.mechanics import JointMechanics, Mechanics
from kmn_sim.world.mechanism_urdf import mechanism_urdf
from kmn_sim.world.scenario import Scenario
from kmn_sim.world.settings import DoorSurroundings


class Mechanism:
    """An object whose joints are all at 0 at the start.

    Attributes
    ----------
    joint_names
        Of the joints that move.
    latched
        Names of the joints that a latch holds.
    body
        Number of the body in the physics.

    Raises
    ------
    ConfigurationError
        If the model's file has no mechanics, or wrong ones.
    """

    def __init__(self, physics: Any, scenario: Scenario, settings: DoorSurroundings) -> None:
        self._physics, model = physics, scenario.model
        mechanics = Mechanics.of(model)
        self.joint_names = tuple(joint.name for joint in model.joints if joint.moves)
        self._mechanics = {
            name: mechanics.joints.get(name, JointMechanics()) for name in self.joint_names
        }
        masses = {name: each.mass for name, each in mechanics.bodies.items()}
        urdf = mechanism_urdf(scenario, object_cuboids(scenario, settings), masses)
        self.body = _load(physics, urdf, model.transformation.matrix(scenario.theta))
        infos = (physics.getJointInfo(self.body, n) for n in range(physics.getNumJoints(self.body)))
        numbers = {info[1].decode(): info[0] for info in infos}  # not in the model's order
        self._links = {name: numbers[name] for name in self.joint_names}
        for joint in model.joints:
            surface = mechanics.bodies[joint.body]
            physics.changeDynamics(  # the defaults damp what shall swing freely
                self.body,
                numbers[joint.name],
                lateralFriction=surface.friction,
                spinningFriction=surface.spinning_friction,
                linearDamping=0.0,
                angularDamping=0.0,
                jointDamping=0.0,
            )
        carriers = {joint.body: numbers[joint.name] for joint in model.joints}
        self.grasped = carriers[scenario.action.grasp.body.name]  # its link
        physics.enableJointForceTorqueSensor(self.body, self.grasped, True)
        self._forces: NDArray[np.float64] = np.zeros(3)  # summed up since they were asked for
        self._steps = 0
        self.latched: frozenset[str] = frozenset()
        for name in self.joint_names:
            self._set_motor(name, False)
        self.update()

    def link(self, joint: str) -> int:
        """Return the number of the link that a joint moves."""
        return self._links[joint]

    def positions(self) -> dict[str, float]:
        """Return where the joints are, m and rad."""
        return {name: state[0] for name, state in self._states().items()}

    def velocities(self) -> dict[str, float]:
        """Return how fast the joints move, m/s and rad/s."""
        return {name: state[1] for name, state in self._states().items()}

    def grasp_force(self) -> NDArray[np.float64]:
        """Return the mean force (3,) on what is grasped since the last call, N, in the world.

        It is what its bearing bears: of the hand, and its own weight.
        """
        mean: NDArray[np.float64] = self._forces / max(self._steps, 1)
        self._forces, self._steps = np.zeros(3), 0
        return mean

    def update(self) -> None:
        """Let latches and springs act in the next step of the physics."""
        self._forces, self._steps = self._forces + self._borne(), self._steps + 1
        states = self._states()
        positions = {name: state[0] for name, state in states.items()}
        latched = frozenset(name for name in self.joint_names if self._is_caught(name, positions))
        for name in latched ^ self.latched:
            self._set_motor(name, name in latched)
        self.latched = latched
        for name, (position, velocity) in states.items():
            if spring := self._spring(name, position, velocity):
                self._physics.setJointMotorControl2(
                    self.body, self._links[name], self._physics.TORQUE_CONTROL, force=spring
                )

    def _spring(self, name: str, position: float, velocity: float) -> float:
        """Return the effort (N or N m) of a joint's spring."""
        joint = self._mechanics[name]
        begun = float(np.clip(position / joint.preload_width, -1.0, 1.0))
        return -(joint.spring * position + joint.damping * velocity + joint.preload * begun)

    def _is_caught(self, name: str, positions: Mapping[str, float]) -> bool:
        """Tell whether a joint's latch holds it."""
        latch = self._mechanics[name].latch
        if latch is None:
            return False
        is_let_go = bool(latch.released_by) and abs(positions[latch.released_by]) >= latch.release
        gives = not latch.released_by  # a latch that a joint lets go holds wherever it is bent to
        is_held = name in self.latched and not gives
        return not is_let_go and (is_held or abs(positions[name]) <= latch.catch)

    def _states(self) -> dict[str, tuple[float, float]]:
        links = [self._links[name] for name in self.joint_names]
        states = self._physics.getJointStates(self.body, links)
        return {
            name: (state[0], state[1]) for name, state in zip(self.joint_names, states, strict=True)
        }

    def _borne(self) -> NDArray[np.float64]:
        """Return the force (3,) on what is grasped in the last step, N, in the world."""
        reaction = self._physics.getJointState(self.body, self.grasped)[2][:3]
        orientation = self._physics.getLinkState(self.body, self.grasped)[5]
        turned = self._physics.getMatrixFromQuaternion(orientation)
        return -np.reshape(turned, (3, 3)) @ reaction

    def _set_motor(self, name: str, is_latched: bool) -> None:
        """Hold a joint at 0, or replace its motor by friction: to standstill, of little force."""
        joint, link = self._mechanics[name], self._links[name]
        if is_latched and joint.latch is not None:
            self._physics.setJointMotorControl2(
                self.body,
                link,
                self._physics.POSITION_CONTROL,
                targetPosition=0.0,
                force=joint.latch.effort,
            )
            return
        self._physics.setJointMotorControl2(
            self.body,
            link,
            self._physics.VELOCITY_CONTROL,
            targetVelocity=0.0,
            force=joint.friction,
        )


def _load(physics: Any, urdf: str, pose: NDArray[np.float64]) -> int:
    """Load a URDF, whose root stands still at a pose (4, 4) without scale."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "object.urdf"
        file.write_text(urdf, encoding="utf-8")
        body: int = physics.loadURDF(
            str(file),
            basePosition=pose[:3, 3].tolist(),
            baseOrientation=quaternion_from_matrix(pose[:3, :3]).tolist(),
            useFixedBase=True,
            flags=physics.URDF_USE_INERTIA_FROM_FILE,
        )
    return body
