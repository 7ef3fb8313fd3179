"""The episode as a table in the terminal."""

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from chmarl_pb.demo import wording
from chmarl_pb.demo.canvas import ROBOTS
from chmarl_pb.demo.record import Moment, Recording


def print_table(recording: Recording, console: Console) -> None:
    """Print the instruction, one row a step, and how it ended."""
    task = recording.task
    console.print(f"\n[bold]{escape(recording.instruction)}[/bold]")
    console.print(f"[dim]{escape(task.id)} in {recording.home.name}, driven by the {recording.policy} policy[/dim]")
    table = Table(header_style="bold", pad_edge=False, box=None, padding=(0, 1))
    table.add_column("step", justify="right")
    for robot in ROBOTS:
        table.add_column(robot)
    for name in ("potential", "reward"):
        table.add_column(name, justify="right")
    table.add_column(f"X: {wording.item_words(task)}")
    table.add_column(f"Y: {wording.target_words(task)}")
    table.add_column("feedback")
    for step, moment in enumerate(recording.moments):
        table.add_row(str(step), *_cells(recording, moment))
    console.print(table)
    console.print(f"[{'green' if recording.success else 'yellow'}]{wording.result_words(recording)}[/]")


def _cells(recording: Recording, moment: Moment) -> list[str]:
    actions = [_action(recording, moment, robot) for robot in ROBOTS]
    reward = wording.reward_words(moment.reward) if moment.actions else ""
    rooms = [", ".join(wording.known_rooms(recording, moment, row)) or "?" for row in (0, 1)]
    feedback = " ".join(text for text in moment.feedback.values() if text)
    return [*actions, f"{moment.potential:g}", reward, *rooms, escape(feedback)]


def _action(recording: Recording, moment: Moment, robot: str) -> str:
    if not moment.actions:
        return "[dim](start)[/dim]"
    words = wording.action_words(moment.actions[robot], recording.task)
    return words if moment.succeeded[robot] else f"[red]{words} (failed)[/red]"
