"""What stands around the pictures of a video frame: instruction, actions, potential, messages, feedback."""

from dataclasses import dataclass

from chmarl_pb.frames import wording
from chmarl_pb.frames.canvas import (
    BAD,
    CARD,
    FAINT,
    GOOD,
    INK,
    ITEM,
    MUTED,
    ROBOTS,
    TARGET,
    Canvas,
    Colour,
    width_of,
    wrap,
)
from chmarl_pb.frames.recording import Moment, Recording

WIDTH, HEIGHT = 1280, 720
COLUMNS = (24, 440, 856)  # left edges of the three columns in pixels
SHOWN = 2  # robots
COLUMN_WIDTH = 400
PICTURE_TOP, PICTURE_HEIGHT = 100, 400
_CARD_TOP, _CARD_BOTTOM = 516, 696
_PAD = 18
_AMBER: Colour = (168, 104, 12)


@dataclass(frozen=True)
class Heading:
    """What stands at the right of a frame's head.

    Attributes:
        words: how far the episode is, or how it ended.
        success: whether it ended well; None: it goes on.
        pace: how fast the film goes, if it does.
    """

    words: str
    success: bool | None = None
    pace: str = ""


def draw_panel(recording: Recording, now: Moment, known: Moment, heading: Heading) -> Canvas:
    """Draw everything but the pictures.

    Args:
        recording: the episode.
        now: the moment that is shown.
        known: the last one whose result is known: the same, or while its motion is shown that before it.
        heading: how far the episode is.
    """
    sheet = Canvas(WIDTH, HEIGHT)
    _header(sheet, recording, heading)
    _legend(sheet, recording, heading.pace)
    for (robot, colour), left in zip(shown(recording), COLUMNS, strict=False):
        _robot_card(sheet, left, recording, now, known, robot, colour)
    _score_card(sheet, recording, known, now.reward if known is now and now.actions else None)
    return sheet


def ending_words(success: bool, steps: int) -> str:
    """Return how an episode ended, for its heading."""
    return f"{'Solved' if success else 'Not solved'} in {steps} step{'' if steps == 1 else 's'}"


def shown(recording: Recording) -> list[tuple[str, Colour]]:
    """Return the robots whose views a frame has room for, with their colours."""
    return list(zip(recording.models, ROBOTS, strict=False))[:SHOWN]


def _header(sheet: Canvas, recording: Recording, heading: Heading) -> None:
    left, right = COLUMNS[0], COLUMNS[2] + COLUMN_WIDTH
    _instruction(sheet, left, recording.instruction, right - left - 200)
    colour = INK if heading.success is None else GOOD if heading.success else BAD
    sheet.text(right, 42, heading.words, 20, colour, "rs")
    if recording.optimum is not None:
        sheet.text(right, 62, f"shortest plan: {wording.shortest_words(recording)}", 13, MUTED, "rs")
    for (robot, colour), x in zip(shown(recording), COLUMNS, strict=False):
        sheet.disc(x + 5, 85, 5, colour)
        down = ", straight down" if recording.models[robot].flies else ""
        sheet.text(x + 17, 90, f"{wording.robot_words(robot)}'s view{down}", 14, MUTED)


def _instruction(sheet: Canvas, x: float, words: str, width: float) -> None:
    """Write the instruction as large as it fits into one line, or small in two."""
    for size in (29, 26, 23):
        if width_of(words, size) <= width:
            sheet.text(x, 50, words, size)
            return
    for number, row in enumerate(wrap(words, 21, width, 2)):
        sheet.text(x, 34 + 26 * number, row, 21)


def _legend(sheet: Canvas, recording: Recording, pace: str) -> None:
    x: float = COLUMNS[2]
    for letter, colour, words in (
        ("X", ITEM, wording.item_words(recording)),
        ("Y", TARGET, wording.target_words(recording)),
    ):
        sheet.disc(x + 8, 85, 8, colour)
        sheet.text(x + 8, 85, letter, 11, CARD, "mm")
        x += 22 + sheet.text(x + 22, 90, words, 14, MUTED) + 16
    sheet.text(COLUMNS[2] + COLUMN_WIDTH, 90, pace, 12, MUTED, "rs")


def _robot_card(
    sheet: Canvas, left: int, recording: Recording, now: Moment, known: Moment, robot: str, colour: Colour
) -> None:
    sheet.box(left, _CARD_TOP, left + COLUMN_WIDTH, _CARD_BOTTOM, CARD, 10)
    sheet.box(left, _CARD_TOP + 14, left + 4, _CARD_TOP + 52, colour, 2)
    x, width = left + _PAD, COLUMN_WIDTH - 2 * _PAD
    sheet.text(x, _CARD_TOP + 26, wording.robot_words(robot), 13, MUTED)
    action = now.actions.get(robot)
    words = "Start" if action is None else wording.action_words(action, recording) + wording.said_words(now, robot)
    end = x + sheet.text(x, _CARD_TOP + 52, wrap(words, 22, width - 40, 1)[0], 22)
    if known is now and action is not None:
        _verdict(sheet, end + 20, _CARD_TOP + 44, now.succeeded[robot])
    feedback = now.feedback[robot] if known is now else ""
    seen = ", ".join(wording.seen_words(recording, known, robot)) or "nothing"
    lines = [
        (line, MUTED) for line in wrap(f"{'Sees' if known is now else 'Saw'} {seen}", 14, width, 2 if feedback else 4)
    ]
    lines += [(line, _AMBER) for line in wrap(feedback, 14, width, 3)] if feedback else []
    for number, (line, shade) in enumerate(lines):
        sheet.text(x, _CARD_TOP + 82 + 20 * number, line, 14, shade)


def _verdict(sheet: Canvas, x: float, y: float, succeeded: bool) -> None:
    """Draw a tick or a cross on a disc."""
    sheet.disc(x, y, 9, GOOD if succeeded else BAD)
    if succeeded:
        sheet.line([(x - 4, y), (x - 1, y + 3.5), (x + 4.5, y - 3.5)], CARD, 2)
    else:
        sheet.line([(x - 3.5, y - 3.5), (x + 3.5, y + 3.5)], CARD, 2)
        sheet.line([(x - 3.5, y + 3.5), (x + 3.5, y - 3.5)], CARD, 2)


def _score_card(sheet: Canvas, recording: Recording, known: Moment, reward: float | None) -> None:
    left, right = COLUMNS[2], COLUMNS[2] + COLUMN_WIDTH
    sheet.box(left, _CARD_TOP, right, _CARD_BOTTOM, CARD, 10)
    x, end = left + _PAD, right - _PAD
    sheet.text(x, _CARD_TOP + 26, "Potential", 13, MUTED)
    sheet.text(x + 64, _CARD_TOP + 26, f"{known.potential:g} of {recording.highest:g}", 15)
    if reward is not None:
        colour = GOOD if reward > 0 else BAD if reward < 0 else MUTED
        sheet.text(end, _CARD_TOP + 26, f"reward {wording.reward_words(reward)}", 15, colour, "rs")
    sheet.box(x, _CARD_TOP + 38, end, _CARD_TOP + 50, FAINT, 6)
    if known.potential > 0:
        full = max(12.0, (end - x) * known.potential / recording.highest)
        sheet.box(x, _CARD_TOP + 38, x + full, _CARD_TOP + 50, GOOD, 6)
    _lamps(sheet, recording, known, x, end)


def _lamps(sheet: Canvas, recording: Recording, known: Moment, x: float, end: float) -> None:
    """Draw a lamp for each room and each of X and Y, lit once it has been seen there; none without a board."""
    if known.messages is None:
        return
    top, pitch = _CARD_TOP + 84, (end - x - 70) / len(recording.rooms)
    sheet.text(x, top, "Seen in", 13, MUTED)
    for number, room in enumerate(recording.rooms):
        middle = x + 70 + (number + 0.5) * pitch
        sheet.text(middle, top, wording.room_words(room), 12, MUTED, "ms")
        for row, (letter, colour) in enumerate((("X", ITEM), ("Y", TARGET))):
            y = top + 26 + 36 * row
            lit = bool(known.messages[row, number])
            sheet.disc(middle, y, 10, colour if lit else FAINT)
            if lit:
                sheet.text(middle, y, letter, 13, CARD, "mm")
    for row, words in enumerate((wording.item_words(recording), wording.target_words(recording))):
        lines = wrap(words, 13, 74, 2)
        for number, line in enumerate(lines):
            sheet.text(x, top + 31 + 36 * row - 7 * (len(lines) - 1) + 15 * number, line, 13)
