"""The simulated world: robot, object, surroundings and time."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kmn_perception.configuration.robot_parts import velocity_controller
from kmn_perception.model.parts import NO_AXIS
from kmn_sim.control.interpolation import State
from kmn_sim.control.robot_controllers import RobotControllers
from kmn_sim.control.velocity_controller import VelocityController
from kmn_sim.robot.robot_model import robot_urdf
from kmn_sim.robot.simulated_robot import SimulatedRobot
from kmn_sim.world.carton import Carton
from kmn_sim.world.cuboid import MATT, Cuboid
from kmn_sim.world.cuboids import FLOOR, floor_cuboid, object_cuboids, table_cuboids
from kmn_sim.world.mechanism import Mechanism
from kmn_sim.world.physics import Physics
from kmn_sim.world.renderer import Renderer
from kmn_sim.world.scenario import Scenario
from kmn_sim.world.settings import WorldSettings


class Simulation:
    """Steps the world of one scenario at a time.

    Parameters
    ----------
    scenario
        What stands in the world.
    settings
        Numbers of the world.
    gui
        Whether a window of the physics engine shows it.
    renderer
        What renders the camera's images: ``egl`` or ``software``.
    from_desired_state
        Whether a new trajectory starts from the desired state, else from the measured one.
    allow_partial
        Whether a trajectory need not name all joints.
    odometry_drift
        Metres by which the robot's odometry errs for each metre driven.

    Attributes
    ----------
    time
        Simulated seconds since the start; it goes on when the scenario changes.
    mechanism, carton
        The object, one of the two.
    beside
        The objects that stand in one row with it.
    physics
        Client of the physics engine.
    renderer
        Renders what cameras see of the world.
    settings
        Numbers of the world.
    robot, controllers, desired
        The robot, what moves it, and the state that is desired of it in the last step.
    floor
        Height of the floor, metres.
    """

    def __init__(
        self,
        scenario: Scenario,
        settings: WorldSettings,
        gui: bool = False,
        renderer: str = "egl",
        from_desired_state: bool = True,
        allow_partial: bool = False,
        odometry_drift: float = 0.0,
    ) -> None:
        self.settings, self._urdf = settings, robot_urdf(settings.robot)
        self._from_desired_state, self._allow_partial = from_desired_state, allow_partial
        self._odometry_drift = odometry_drift
        self.physics: Any = Physics(gui)
        # Before there are bodies: a renderer does not know of those that were there before it.
        self.renderer = Renderer(self.physics, renderer, settings.physics.light)
        self.step_time = 1.0 / settings.physics.rate
        self._steps = 0
        self.build(scenario)

    @property
    def time(self) -> float:
        """Simulated seconds since the start."""
        return self._steps * self.step_time

    def build(self, scenario: Scenario) -> None:
        """Set up a scenario anew; robot and object stand where they start."""
        self.scenario = scenario
        physics, settings = self.physics, self.settings
        physics.resetSimulation()
        physics.setGravity(0.0, 0.0, -settings.physics.gravity)
        physics.setPhysicsEngineParameter(
            fixedTimeStep=self.step_time,
            numSolverIterations=settings.physics.solver_iterations,
            deterministicOverlappingPairs=1,
        )
        self.mechanism: Mechanism | None = None
        self.carton: Carton | None = None
        if scenario.is_articulated:
            self.mechanism, start = Mechanism(physics, scenario, settings.door), {}
        else:
            self.carton = Carton(physics, scenario, settings.box.box)
            start = dict(zip(settings.robot.base_names, settings.box.robot, strict=True))
        self.beside = tuple(Mechanism(physics, each, settings.door) for each in scenario.beside)
        self._stand(self._table())
        self.floor = -settings.box.table.height if scenario.table else 0.0
        self.robot = SimulatedRobot(
            physics,
            self._urdf,
            settings.robot,
            start,
            self.floor,
            self.step_time,
            self._odometry_drift,
        )
        if scenario.floor:
            ground = self._stand(self._ground())
            # The robot's base moves in a plane: its wheels do not touch the ground.
            for link in range(-1, physics.getNumJoints(self.robot.body)):
                physics.setCollisionFilterPair(ground, self.robot.body, -1, link, 0)
        self.controllers = self._make_controllers()
        self.desired = State.at_rest(self.robot.state().positions)

    def _make_controllers(self) -> RobotControllers:
        """Return controllers that hold the robot where it is."""
        settings, base = self.settings.robot, None
        if velocity_controller(settings.controllers):
            speeds = np.array([settings.joints[name].velocity for name in settings.base_names])
            base = VelocityController(speeds, settings.simulation.velocity_control)
        return RobotControllers(
            {
                name: each.joints
                for name, each in settings.controllers.items()
                if each.type != "velocity"
            },
            self.robot.limits,
            self.robot.state().positions,
            self.robot.continuous,
            self._from_desired_state,
            self._allow_partial,
            base,
        )

    def step(self) -> None:
        """Advance the world by one step."""
        measured = self.robot.state()
        self.desired = self.controllers.sample(self.time, measured)
        self.robot.update(self.desired, measured)
        if self.mechanism is not None:
            self.mechanism.update()
        for each in self.beside:
            each.update()
        self.physics.stepSimulation()
        self._steps += 1

    def run(self, seconds: float) -> None:
        """Advance the world by a time."""
        for _ in range(round(seconds / self.step_time)):
            self.step()

    def values(self) -> NDArray[np.float64]:
        """Return the true morphing parameters (n + m,) of the object at present."""
        if self.carton is None:
            return self.scenario.values
        return self.carton.values()

    def unit_cubes(self) -> NDArray[np.float64]:
        """Return all bodies but the robot as maps (B, 4, 4) of the unit cube, closed."""
        scenario = self.scenario
        cubes = list(scenario.model.unit_cubes(*scenario.model.split(self.values())))
        if scenario.is_articulated:
            cubes = [
                part.unit_cube(each.model.transformation.matrix(each.theta))
                for each in (scenario, *scenario.beside)
                for part in self._parts(each)
            ]
        around = [*self._table(), *self._ground()]
        return np.array([*cubes, *(part.unit_cube(np.eye(4)) for part in around)])

    def cylinder_axes(self) -> NDArray[np.int64]:
        """Return which of these cuboids (B,) hold cylinders, see `KinematicModel.cylinder_axes`."""
        scenario = self.scenario
        axes = scenario.model.cylinder_axes
        if scenario.is_articulated:
            objects = (scenario, *scenario.beside)
            axes = np.array([part.axis for each in objects for part in self._parts(each)])
        around = len(self._table()) + len(self._ground())
        return np.append(axes, np.full(around, NO_AXIS))

    def close(self) -> None:
        """End the physics engine."""
        self.renderer.close()
        self.physics.disconnect()

    def _parts(self, scenario: Scenario) -> list[Cuboid]:
        """Return the cuboids of an articulated object in its frame."""
        return list(chain(*object_cuboids(scenario, self.settings.door).values()))

    def _table(self) -> list[Cuboid]:
        return table_cuboids(self.settings.box.table) if self.scenario.table else []

    def _ground(self) -> list[Cuboid]:
        room = self.scenario.room
        colour = FLOOR if room is None else room.colours["floor"]
        ground = floor_cuboid(self.floor, self.settings.physics.floor, colour)
        return [ground] if self.scenario.floor else []

    def _stand(self, cuboids: Sequence[Cuboid]) -> int:
        """Put cuboids that do not move into the world; return the last one's body."""
        physics, body = self.physics, -1
        for cuboid in cuboids:
            half = (cuboid.size / 2.0).tolist()
            body = physics.createMultiBody(
                0.0,
                physics.createCollisionShape(physics.GEOM_BOX, halfExtents=half),
                physics.createVisualShape(
                    physics.GEOM_BOX,
                    halfExtents=half,
                    rgbaColor=cuboid.colour,
                    specularColor=MATT,
                ),
                cuboid.centre.tolist(),
            )
        return body
