"""The simulated world: robot, object, surroundings and time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kmn_sim.control.interpolation import State
from kmn_sim.control.trajectory_controller import TrajectoryController
from kmn_sim.robot.pr2_model import pr2_urdf
from kmn_sim.robot.simulated_robot import SimulatedRobot
from kmn_sim.world.carton import Carton
from kmn_sim.world.cuboid import MATT, Cuboid
from kmn_sim.world.cuboids import FLOOR, door_cuboids, floor_cuboid, table_cuboids
from kmn_sim.world.door import Door
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

    Attributes
    ----------
    time
        Simulated seconds since the start; it goes on when the scenario changes.
    door, carton
        The object, one of the two.
    physics
        Client of the physics engine.
    renderer
        Renders what cameras see of the world.
    settings
        Numbers of the world.
    robot, controller, desired
        The robot, what it follows, and the state that is desired of it in the last step.
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
    ) -> None:
        self.settings, self._urdf = settings, pr2_urdf(settings.robot)
        self._from_desired_state = from_desired_state
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
        self.door: Door | None = None
        self.carton: Carton | None = None
        if scenario.is_door:
            self.door, start = Door(physics, scenario, settings.door), {}
        else:
            self.carton = Carton(physics, scenario, settings.box.box)
            start = dict(zip(settings.robot.base_names, settings.box.robot, strict=True))
        self._stand(self._table())
        self.floor = -settings.box.table.height if scenario.table else 0.0
        self.robot = SimulatedRobot(
            physics, self._urdf, settings.robot, start, self.floor, self.step_time
        )
        if scenario.floor:
            ground = self._stand(self._ground())
            # The robot's base moves in a plane: its wheels do not touch the ground.
            for link in range(-1, physics.getNumJoints(self.robot.body)):
                physics.setCollisionFilterPair(ground, self.robot.body, -1, link, 0)
        self.controller = TrajectoryController(
            self.robot.limits, self.robot.state().positions, self._from_desired_state
        )
        self.desired = State.at_rest(self.robot.state().positions)

    def step(self) -> None:
        """Advance the world by one step."""
        measured = self.robot.state()
        self.desired = self.controller.sample(self.time, measured)
        self.robot.update(self.desired, measured)
        if self.door is not None:
            self.door.update()
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
        """Return all cuboids but the robot as maps (B, 4, 4) of the unit cube, door closed."""
        scenario = self.scenario
        cubes = list(scenario.model.unit_cubes(*scenario.model.split(self.values())))
        if scenario.is_door:
            pose = scenario.model.transformation.matrix(scenario.theta)
            links = door_cuboids(scenario, self.settings.door)
            parts = [*links["world"], *links["handle"][1:]]
            cubes += [part.unit_cube(pose) for part in parts]
        around = [*self._table(), *self._ground()]
        return np.array([*cubes, *(part.unit_cube(np.eye(4)) for part in around)])

    def close(self) -> None:
        """End the physics engine."""
        self.renderer.close()
        self.physics.disconnect()

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
