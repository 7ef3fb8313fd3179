"""The simulations that are kept to be entered again: those of the homes that were played in last."""

from collections import OrderedDict
from collections.abc import Callable

from chmarl_pb.errors import HomeError
from chmarl_pb.garbage import uncollected
from chmarl_pb.tasks.simulation import Simulation

#: As many as the benchmark has homes; each takes some 35 MB of memory, the first of a home in a process twice that.
MOST_SIMULATIONS = 7


class Simulations:
    """The simulations of an environment; that of the home that was left longest ago gives way to a new one."""

    def __init__(self, load: Callable[[str], Simulation], most: int = MOST_SIMULATIONS):
        """Begin with none.

        Args:
            load: makes the simulation of a home, by its name or path.
            most: number of simulations to keep.
        """
        self._load, self._most = load, most
        self._kept: OrderedDict[str, Simulation] = OrderedDict()
        self._rooms: tuple[str, ...] = ()  # of all, also after they are closed

    def enter(self, home: str) -> Simulation:
        """Return the simulation of a home, loaded unless it is kept.

        Raises:
            HomeError: the home cannot be used, or has other rooms than those before.
        """
        if home not in self._kept:
            with uncollected():
                simulation = self._load(home)
            self._rooms = self._rooms or simulation.rooms
            if simulation.rooms != self._rooms:
                simulation.close()
                raise HomeError(
                    f"{simulation.home.path}: its rooms {simulation.rooms} differ from {self._rooms}, so its actions "
                    "would too; play it in an environment of its own with home=..."
                )
            self._kept[home] = simulation
        self._kept.move_to_end(home)
        if len(self._kept) > self._most:
            self._kept.popitem(last=False)[1].close()
        return self._kept[home]

    def close(self) -> None:
        """Disconnect all from physics."""
        for simulation in self._kept.values():
            simulation.close()
        self._kept.clear()
