"""Which of several goals a robot that grasps works for, as far as it can tell from what it sees and does."""

from collections.abc import Collection

Pair = tuple[str, str]  # classes of an object X and of its receptacle Y


class Tidying:
    """Keeps account of the goals of an instruction: which are done, and which the object in the gripper is of."""

    def __init__(self) -> None:
        """Begin an episode."""
        self._done: set[Pair] = set()
        self._carried: list[Pair] = []  # what the object in the gripper may be of, the likeliest first
        self._seen: frozenset[str] = frozenset()
        self._held = False

    def wanted(self, pairs: Collection[Pair], holding: bool, seen: frozenset[str], tried: str) -> frozenset[str]:
        """Return the classes of what is needed now: the objects that are left, or the receptacle of what is held.

        Args:
            pairs: of the instruction.
            holding: whether it holds something.
            seen: classes of the things in its view.
            tried: its last action.
        """
        left, before = [pair for pair in pairs if pair not in self._done], self._held
        self._held = holding
        if tried == "pick" and holding and not before:
            in_view = [pair for pair in left if pair[0] in self._seen]
            self._carried = in_view + [pair for pair in left if pair not in in_view]
        elif tried == "place" and before and not holding and self._carried:
            self._done.add(self._carried[0])
        elif tried == "place" and self._carried and self._carried[0][1] in self._seen:
            self._carried = [*self._carried[1:], self._carried[0]]  # it was of another goal
        self._seen = seen
        if holding:
            return frozenset({(self._carried or left or [*pairs])[0][1]})
        return frozenset(x for x, _ in [pair for pair in left if pair not in self._done] or pairs)
