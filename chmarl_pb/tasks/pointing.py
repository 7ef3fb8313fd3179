"""Pointing: what is there where a Pick or a Place points at, whatever the task asks for.

It is read from the robot's picture: of the objects, or of the receptacles, that it sees, the one with most pixels in
the cell.
"""

from collections.abc import Set

from chmarl_pb.rendering.renderer import Renderer
from chmarl_pb.robots.goal import Goal
from chmarl_pb.robots.pointing import CELLS, cell_of, named, verb_of
from chmarl_pb.sensing.cells import pixels_in_cells
from chmarl_pb.world import World


class Pointer:
    """Tells what the robots of one world point at."""

    def __init__(self, world: World, renderer: Renderer):
        """Read the pictures that a renderer draws."""
        self._world, self._renderer = world, renderer
        self._kinds: dict[str, Set[str]] = {
            "pick": frozenset(world.physics.objects), "place": frozenset(world.home.receptacles)
        }  # fmt: skip

    def meant(self, robot: str, action: str) -> Goal | None:
        """Return what a Pick or Place of a robot acts on; None if nothing is there, or for another action."""
        verb, grip = verb_of(action), self._world.state.grips.get(robot)
        if cell_of(action) is None or (verb == "place") == (grip is None):
            return None
        thing = self.shown(robot, verb).get(action)
        if thing is None:
            return None
        return Goal(thing, ()) if grip is None else Goal(grip.item, (thing,))

    def shown(self, robot: str, verb: str) -> dict[str, str]:
        """Return each Pick, or each Place, that points at something -> what; those with most pixels first.

        Of things with equally many pixels in a cell it is the first of ``renderer.names``.
        """
        names = self._renderer.names
        seen = self._kinds[verb] & set(self._renderer.visible(robot))
        numbers = [number for number, name in enumerate(names) if name in seen]
        if not numbers:
            return {}
        pixels = pixels_in_cells(self._renderer, robot, self._world.state, numbers)
        most, first = pixels.max(axis=0), pixels.argmax(axis=0)
        cells = sorted((cell for cell in CELLS if most[cell]), key=lambda cell: -int(most[cell]))
        return {named(verb, cell): names[numbers[first[cell]]] for cell in cells}
