"""The episode as a table in the terminal."""

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from chmarl_pb.frames import wording
from chmarl_pb.frames.recording import Moment, Recording


def print_table(recording: Recording, console: Console) -> None:
    """Print the instruction, one row a step, and how it ended."""
    task = recording.task
    item, target = wording.item_words(recording), wording.target_words(recording)
    console.print(f"\n[bold]{escape(recording.instruction)}[/bold]")
    console.print(f"{escape(task.id)} in {recording.home.name}, {recording.policy} policy; X: {item}, Y: {target}\n")
    table = Table(header_style="bold", pad_edge=False, box=None, padding=(0, 1))
    table.add_column("step", justify="right")
    for robot in recording.models:
        table.add_column(robot)
    for name in ("potential", "reward"):
        table.add_column(name, justify="right")
    if recording.has_board:
        table.add_column("X seen in")
        table.add_column("Y seen in")
    if any(any(moment.feedback.values()) for moment in recording.moments):
        table.add_column("feedback")
    for step, moment in enumerate(recording.moments):
        table.add_row(str(step), *_cells(recording, moment)[: len(table.columns) - 1])
    console.print(table)
    console.print(f"\n[{'green' if recording.success else 'yellow'}]{wording.result_words(recording)}[/]")


def _cells(recording: Recording, moment: Moment) -> list[str]:
    actions = [_action(moment, robot) for robot in recording.models]
    reward = wording.reward_words(moment.reward) if moment.actions else ""
    rows = (0, 1) if recording.has_board else ()
    rooms = [", ".join(wording.known_rooms(recording, moment, row)) or "-" for row in rows]
    feedback = " ".join(text for text in moment.feedback.values() if text)
    return [*actions, f"{moment.potential:g}", reward, *rooms, escape(feedback)]


def _action(moment: Moment, robot: str) -> str:
    if not moment.actions:
        return "[dim]start[/dim]"
    words = wording.short_action_words(moment.actions[robot]) + wording.said_words(moment, robot)
    return words if moment.succeeded[robot] else f"[red]{words} (failed)[/red]"
