"""Limited layouts: whatever the task, each class of object has one place of its own in a home.

Elsewhere places are drawn anew for every task, so that nothing is gained by remembering a home. Here it pays: what was
seen once lies there again. :data:`chmarl_pb.tasks.splits.LIMITED_SPLITS` are laid out like this.
"""

from typing import NamedTuple

import numpy as np

from chmarl_pb import catalog
from chmarl_pb.navigation.approaches import GripPoint
from chmarl_pb.navigation.free_space import Space, grip_point
from chmarl_pb.tasks.sampling import may_stand
from chmarl_pb.world import World


class OwnPlace(NamedTuple):
    """Where all objects of a class are to stand in a home.

    Attributes:
        receptacle: name of the thing that carries them.
        position: x, y, z of the bottom centre, metres.
        yaw: radians.
    """

    receptacle: str
    position: GripPoint
    yaw: float


def own_place(world: World, space: Space, item: str) -> OwnPlace | None:
    """Return an object's place: drawn from the names of its class and of the home alone; None if it fits nowhere.

    The receptacle is uniform over those of the home where the class may stand and within the arm's reach, the place on
    it as well.

    Args:
        world: that the object is of; what stands there does not count.
        space: of the home.
        item: name of the object.
    """
    class_name, size = catalog.class_of(item), world.size(item)
    rng = np.random.default_rng([*space.home.name.encode(), *class_name.encode()])
    for receptacle in rng.permutation(list(space.home.receptacles)).tolist():
        if may_stand(space.home.catalog, class_name, catalog.class_of(receptacle)):
            places = space.places(receptacle, size)
            for number in rng.permutation(len(places)).tolist():
                x, y, z, yaw = places[number].tolist()
                if space.stand(grip_point((x, y, z), size)) is not None:
                    return OwnPlace(receptacle, (x, y, z), yaw)
    return None
