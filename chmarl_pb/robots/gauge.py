"""How deep an arm and what it holds stand in something while they are driven, by PyBullet's closest points."""

from collections.abc import Iterator

from chmarl_pb.robots.arm_boxes import ArmBoxes
from chmarl_pb.robots.motion import Motion
from chmarl_pb.world import Support, World
from chmarl_pb.world.bullet import pybullet

_NEAR = (-0.03, 0.01)  # metres from the height on which an object stands, within which its support may be touched
_UPWARD = 0.7  # z of the normal of a surface that an object stands on


class Gauge:
    """Measures one robot during one motion.

    The robot's own body does not count, nor the object that is picked, carried or placed, nor, for fingers and object,
    the surface that the object is taken from or put on.
    """

    def __init__(self, world: World, robot: str, shape: ArmBoxes, motion: Motion):
        """Measure a robot of a world, its arm of a shape, in a motion that has not begun."""
        self._physics, self._client = world.physics, world.client
        self._body = world.physics.robots[robot].body
        self._links, self._fingers = shape.numbers, {shape.numbers[number] for number in shape.fingers}
        grip = world.state.grips.get(robot)
        item = motion.pick or (grip.item if grip else None)
        self._ignored = {self._body} | ({self._physics.objects[item].body} if item else set())
        on = world.supports.get(motion.pick) if motion.pick else None
        if motion.place is not None:
            on = Support(motion.place.receptacle, motion.place.position[2])
        self._support = None if on is None else world.links[on.receptacle]
        self._band = None if on is None else (on.height + _NEAR[0], on.height + _NEAR[1])

    def depth(self, held: str | None) -> float:
        """Return how deep the arm, and an object that it holds by now, stand in something, metres; 0: nowhere."""
        deepest = 0.0
        for link in self._links:
            deepest = max(deepest, *self._depths(self._body, link, self._band if link in self._fingers else None), 0.0)
        if held is not None:
            deepest = max(deepest, *self._depths(self._physics.objects[held].body, -1, self._band, _UPWARD), 0.0)
        return deepest

    def _depths(self, body: int, link: int, band: tuple[float, float] | None, upward: float = -1.0) -> Iterator[float]:
        """Yield depths of a link, less those in its surface: of points in a band of heights, where it faces upwards."""
        low, high = pybullet.getAABB(body, link, physicsClientId=self._client)
        for other, part in pybullet.getOverlappingObjects(low, high, physicsClientId=self._client) or ():
            if other in self._ignored:
                continue
            supports = band if other == self._physics.home and part == self._support else None
            for point in pybullet.getClosestPoints(body, other, 0.0, link, part, physicsClientId=self._client):
                if supports is None or not supports[0] < point[6][2] < supports[1] or point[7][2] < upward:
                    yield -point[8]
