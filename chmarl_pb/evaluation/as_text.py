"""Figures as texts of tables and of the command line."""

from chmarl_pb.evaluation.metrics import Figure


def percent(figure: Figure) -> str:
    """Return a rate as "mean ± deviation" in per cent."""
    return number(Figure(*(None if v is None else 100 * v for v in (figure.mean, figure.deviation))))


def number(figure: Figure, digits: int = 1) -> str:
    """Return a figure as "mean ± deviation"."""
    if figure.mean is None:
        return "-"
    deviation = "" if figure.deviation is None else f" ± {figure.deviation:.{digits}f}"
    return f"{figure.mean:.{digits}f}{deviation}"


def interval(figure: Figure) -> str:
    """Return the interval of a rate in per cent."""
    return f"{100 * (figure.low or 0):.1f} to {100 * (figure.high or 0):.1f}"


def points(gained: float | None) -> str:
    """Return a gain as text, empty if there is none."""
    return "" if gained is None else f"{gained:+.1f}"


def interval_text(gained: Figure) -> str:
    """Return the interval of a gain as text, empty if there is none."""
    return "" if gained.low is None or gained.high is None else f"{gained.low:+.1f} to {gained.high:+.1f}"
