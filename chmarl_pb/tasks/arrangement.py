"""Objects that are put into a home one by one, each on a free place within the arm's reach."""

from collections.abc import Sequence

import numpy as np

from chmarl_pb.navigation.free_space import Space
from chmarl_pb.world import Objects, Pose, Support, World, yaw_quaternion
from chmarl_pb.world.touch import box_of, touching

Place = tuple[float, float, float, float]  # x, y, z of the bottom centre, metres, and yaw, radians

_TRIES = 40  # places that are drawn for one object before its receptacle counts as full


class Arrangement:
    """Where objects have been put so far. The world only tells how large they are; nothing changes in it.

    Attributes:
        world: knows the objects.
        space: of its home.
    """

    def __init__(self, world: World, space: Space, rng: np.random.Generator):
        """Begin with an empty home.

        Args:
            world: knows the objects.
            space: of its home.
            rng: draws the places.
        """
        self.world, self.space, self._rng = world, space, rng
        self._poses: dict[str, Pose] = {}
        self._supports: dict[str, Support] = {}
        self._boxes = np.empty((len(world.physics.objects), 7))  # of the objects, in the order of the poses

    @property
    def objects(self) -> Objects:
        """Where the objects are."""
        return Objects(self._poses, self._supports)

    def put(self, item: str, receptacle: str) -> bool:
        """Put another object on a free place of a receptacle within reach, uniformly; False if none is found."""
        size = self.world.size(item)
        places, count = self.space.places(receptacle, size), len(self._poses)
        free = np.flatnonzero(~touching(places, size, self._boxes[:count]))
        for number in self._rng.permutation(free)[:_TRIES].tolist():
            if self.space.reaches(receptacle, size, number):
                self._put(item, receptacle, tuple(places[number].tolist()))
                return True
        return False

    def put_at(self, item: str, receptacle: str, place: Place) -> bool:
        """Put another object on a place of a receptacle; False if something else stands there."""
        if touching(np.array([place]), self.world.size(item), self._boxes[: len(self._poses)])[0]:
            return False
        self._put(item, receptacle, place)
        return True

    def _put(self, item: str, receptacle: str, place: Place) -> None:
        x, y, z, yaw = place
        pose = (x, y, z), yaw_quaternion(yaw)
        self._boxes[len(self._poses)] = box_of(pose, self.world.size(item))
        self._poses[item], self._supports[item] = pose, Support(receptacle, z)

    def keep(self, items: Sequence[str]) -> None:
        """Take all other objects out."""
        self._poses = {name: self._poses[name] for name in items}
        self._supports = {name: self._supports[name] for name in items}
        self._boxes[: len(items)] = [box_of(pose, self.world.size(name)) for name, pose in self._poses.items()]
