"""The results of CH-MARL (Sharma et al. 2022), in per cent, means: the tables that ours stand beside."""

from dataclasses import dataclass

#: Columns of the paper's tables.
SPLITS = ("val-seen", "val-unseen", "test-seen", "test-unseen")


@dataclass(frozen=True)
class Row:
    """One row of a table.

    Attributes:
        name: of the learner; a result with this label stands beside it.
        success: success rate for each of ``SPLITS``, per cent.
        plw: path-length-weighted score for each of ``SPLITS``, per cent.
        observation: "visual" or "scene_graph".
        feedback: whether language feedback was given.
    """

    name: str
    success: tuple[float, ...]
    plw: tuple[float, ...]
    observation: str
    feedback: bool = True

    @property
    def messages(self) -> bool:
        """Whether the robots heard each other."""
        return "messages" in self.name

    @property
    def centralized(self) -> bool:
        """Whether one policy drove all robots."""
        return "centralized" in self.name.split()


@dataclass(frozen=True)
class PaperTable:
    """One table of the paper."""

    title: str
    rows: tuple[Row, ...]


def _row(observation: str, name: str, *values: float, feedback: bool = True) -> Row:
    return Row(name, values[:4], values[4:], observation, feedback)


_VISUAL = tuple(
    _row("visual", *row)
    for row in (
        ("BC decentralized", 37.21, 5.36, 42.02, 3.00, 30.34, 4.84, 35.43, 2.09),
        ("BC decentralized + messages", 40.89, 6.52, 48.54, 5.02, 37.42, 5.51, 40.11, 3.50),
        ("BC centralized", 30.80, 4.35, 34.92, 4.00, 23.07, 4.19, 27.37, 2.29),
        ("IQL", 4.05, 2.01, 8.42, 2.33, 2.68, 1.79, 6.31, 1.73),
        ("IQL + messages", 20.89, 7.56, 22.08, 10.92, 13.80, 5.54, 19.05, 6.10),
        ("VDN", 0.83, 0.67, 2.94, 0.00, 0.60, 0.51, 2.37, 0.00),
        ("VDN + messages", 14.18, 2.55, 16.56, 5.21, 10.32, 3.76, 12.22, 3.00),
        ("QMIX", 17.73, 3.68, 17.96, 2.33, 14.09, 3.39, 15.21, 1.88),
        ("QMIX + messages", 22.26, 8.01, 23.85, 12.03, 15.55, 6.34, 19.36, 6.45),
        ("QTRAN", 1.26, 2.01, 2.52, 0.33, 1.09, 1.45, 2.45, 0.33),
        ("QTRAN + messages", 13.69, 7.07, 19.58, 8.00, 9.73, 5.94, 15.30, 4.82),
    )
)
_SCENE_GRAPH = tuple(
    _row("scene_graph", *row)
    for row in (
        ("BC decentralized", 41.87, 11.47, 47.19, 13.67, 35.93, 9.51, 41.78, 11.36),
        ("BC decentralized + messages", 46.25, 21.08, 53.55, 18.04, 38.17, 15.06, 45.35, 13.72),
        ("BC centralized", 40.08, 15.15, 33.61, 10.01, 32.73, 11.89, 26.77, 7.18),
        ("IQL", 14.18, 14.49, 14.53, 13.67, 9.91, 10.01, 10.80, 10.78),
        ("IQL + messages", 24.16, 23.46, 24.89, 21.26, 19.94, 19.21, 19.73, 17.05),
        ("VDN", 16.85, 17.74, 19.03, 14.67, 11.36, 13.76, 13.68, 11.52),
        ("VDN + messages", 34.87, 26.04, 36.70, 27.51, 23.37, 18.24, 27.86, 17.16),
        ("QMIX", 20.37, 14.78, 23.48, 18.67, 13.73, 12.84, 16.71, 14.67),
        ("QMIX + messages", 39.25, 27.85, 38.13, 28.95, 25.36, 21.44, 28.68, 20.05),
        ("QTRAN", 3.04, 2.69, 2.94, 3.00, 2.57, 2.64, 2.57, 2.67),
        ("QTRAN + messages", 12.42, 10.07, 11.45, 10.05, 10.57, 6.34, 9.12, 7.42),
    )
)
_FEEDBACK = (
    _row("visual", "QMIX + messages", 22.26, 8.01, 23.85, 12.03, 15.55, 6.34, 19.36, 6.45),
    _row("visual", "QMIX + messages", 20.47, 7.55, 21.45, 10.33, 14.90, 6.13, 17.31, 6.18, feedback=False),
    _row("scene_graph", "QMIX + messages", 39.25, 27.85, 38.13, 28.95, 25.36, 21.44, 28.68, 20.05),
    _row("scene_graph", "QMIX + messages", 36.54, 25.73, 36.23, 15.33, 11.93, 16.80, 12.41, 11.95, feedback=False),
)

VISUAL = PaperTable("Visual observations", _VISUAL)
SCENE_GRAPH = PaperTable("Scene-graph observations", _SCENE_GRAPH)
FEEDBACK = PaperTable("Language feedback, QMIX + messages", _FEEDBACK)
