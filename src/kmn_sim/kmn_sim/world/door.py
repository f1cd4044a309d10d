"""The door in the physics: hinge with friction and stop, handle with spring, latch."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_perception.model.rotation import quaternion_from_matrix
from kmn_sim.world.cuboids import door_cuboids
from kmn_sim.world.door_urdf import door_urdf
from kmn_sim.world.scenario import Scenario
from kmn_sim.world.settings import DoorMechanics

PANEL_LINK, HANDLE_LINK = 0, 1  # the order of the model's joints


class DoorState(NamedTuple):
    """Angles (rad) and velocities (rad/s) of hinge and handle."""

    hinge: float
    handle: float
    hinge_velocity: float
    handle_velocity: float


class Door:
    """A door that is closed at the start.

    Attributes
    ----------
    latched
        Whether the latch holds the panel.
    body
        Number of the body in the physics.
    """

    def __init__(self, physics: Any, scenario: Scenario, settings: DoorMechanics) -> None:
        self._physics, self._settings = physics, settings
        hinge, handle = scenario.model.joints
        opening = (0.0, settings.hinge.opening)
        self._sign = -1.0 if scenario.direction == "pull" else 1.0
        limits = {
            hinge.name: opening if self._sign > 0.0 else (-opening[1], 0.0),
            handle.name: handle.limits,
        }
        self.joint_names = (hinge.name, handle.name)
        cuboids = door_cuboids(scenario, settings)
        masses = {hinge.body: settings.panel.mass, handle.body: settings.handle.mass}
        urdf = door_urdf(scenario, cuboids, masses, limits)
        self.body = _load(physics, urdf, scenario.model.transformation.matrix(scenario.theta))
        physics.changeDynamics(
            self.body,
            HANDLE_LINK,
            lateralFriction=settings.handle.friction,
            spinningFriction=settings.handle.spinning_friction,
        )
        for link in (PANEL_LINK, HANDLE_LINK):  # the defaults damp what shall swing freely
            physics.changeDynamics(
                self.body, link, linearDamping=0.0, angularDamping=0.0, jointDamping=0.0
            )
        self._release_motor(HANDLE_LINK, 0.0)
        self.latched = False
        self.update()

    def state(self) -> DoorState:
        """Return where the door is."""
        hinge, handle = self._physics.getJointStates(self.body, [PANEL_LINK, HANDLE_LINK])
        return DoorState(hinge[0], handle[0], hinge[1], handle[1])

    def update(self) -> None:
        """Let latch and spring act in the next step of the physics."""
        state, latch, handle = self.state(), self._settings.latch, self._settings.handle
        caught = self.latched or abs(state.hinge) <= latch.catch
        latched = caught and abs(state.handle) < latch.release
        if latched != self.latched:
            self._set_hinge(latched)
        self.latched = latched
        torque = -handle.spring * state.handle - handle.damping * state.handle_velocity
        torque -= handle.preload * np.clip(state.handle / handle.preload_width, -1.0, 1.0)
        self._physics.setJointMotorControl2(
            self.body, HANDLE_LINK, self._physics.TORQUE_CONTROL, force=torque
        )

    def _set_hinge(self, latched: bool) -> None:
        """Hold the hinge where the door is closed, or let only its friction act."""
        if not latched:
            self._release_motor(PANEL_LINK, self._settings.hinge.friction)
            return
        self._physics.setJointMotorControl2(
            self.body,
            PANEL_LINK,
            self._physics.POSITION_CONTROL,
            targetPosition=0.0,
            force=self._settings.latch.torque,
        )

    def _release_motor(self, link: int, friction: float) -> None:
        """Replace a joint's motor by Coulomb friction: a motor to standstill of little force."""
        self._physics.setJointMotorControl2(
            self.body, link, self._physics.VELOCITY_CONTROL, targetVelocity=0.0, force=friction
        )


def _load(physics: Any, urdf: str, pose: NDArray[np.float64]) -> int:
    """Load a URDF, whose root stands still at a pose (4, 4) without scale."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "door.urdf"
        file.write_text(urdf, encoding="utf-8")
        body: int = physics.loadURDF(
            str(file),
            basePosition=pose[:3, 3].tolist(),
            baseOrientation=quaternion_from_matrix(pose[:3, :3]).tolist(),
            useFixedBase=True,
            flags=physics.URDF_USE_INERTIA_FROM_FILE,
        )
    return body
