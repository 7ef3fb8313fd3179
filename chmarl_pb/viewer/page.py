"""The episode as one web page that needs nothing else: no network, no other file."""

import base64
from html import escape
from pathlib import Path
from string import Template

import cv2
import numpy as np
from numpy.typing import NDArray

from chmarl_pb.files import replacing
from chmarl_pb.frames import wording
from chmarl_pb.frames.canvas import ITEM, ROBOTS, TARGET, Colour
from chmarl_pb.frames.recording import Moment, Recording
from chmarl_pb.rendering.plan_view import draw_plan
from chmarl_pb.viewer.page_figures import curve, plan_overlay

Image = NDArray[np.uint8]

_TEMPLATE = Path(__file__).with_name("page.html")
_ACROSS = 3  # cards beside each other
_PLAN_SIZE = 800  # pixels
_PICTURE_QUALITY = 88  # of JPEG


def write_page(path: Path, recording: Recording, views: list[dict[str, Image]]) -> None:
    """Write the page.

    Args:
        path: the html file.
        recording: the episode.
        views: robot -> its view after the step, for each moment.
    """
    plan = draw_plan(recording.home, _PLAN_SIZE, _PLAN_SIZE)
    height, width = plan.rgb.shape[:2]
    steps = [
        _step(recording, number, pictures, plan_overlay(recording, plan, number))
        for number, pictures in enumerate(views)
    ]
    observed = recording.observation.replace("_", " ")
    facts = (
        recording.task.id,
        recording.home.name,
        f"{recording.policy} policy",
        f"observation: {observed}",
    )
    page = Template(_TEMPLATE.read_text(encoding="utf-8")).substitute(
        title=escape(recording.instruction),
        facts=escape(" · ".join(facts)),
        result=escape(wording.result_words(recording)),
        verdict="good" if recording.success else "bad",
        robots=" ".join(f".r{place} {{ --own: {_css(ROBOTS[place])}; }}" for place in range(len(recording.team))),
        first=_css(ROBOTS[0]),
        across=min(_ACROSS, len(recording.team) + 1),
        robot_heads="".join(f"<th>{escape(wording.robot_words(robot))}</th>" for robot in recording.models),
        board_heads="<th>X seen in</th><th>Y seen in</th>" if recording.has_board else "",
        item=_css(ITEM),
        target=_css(TARGET),
        item_words=escape(wording.item_words(recording)),
        target_words=escape(wording.target_words(recording)),
        plan=_data_uri(plan.rgb, ".png"),
        plan_shape=f"{width} / {height}",
        last=recording.steps,
        curve=curve(recording),
        steps="\n".join(steps),
        rows="\n".join(_row(recording, number) for number in range(len(recording.moments))),
    )
    with replacing(path) as temporary:
        temporary.write_text(page, encoding="utf-8")


def _step(recording: Recording, number: int, pictures: dict[str, Image], overlay: str) -> str:
    """Return the article of one step: the robots, the map, the score."""
    moment = recording.moments[number]
    robots = "".join(
        _robot(recording, moment, place, robot, pictures[robot]) for place, robot in enumerate(recording.models)
    )
    name = f"Step {number} of {recording.steps}" if number else "Start"
    return (
        f'<article class="step" id="step-{number}"><h2>{name}</h2><div class="columns">{robots}'
        f'<section class="card"><h3>Map</h3><div class="plan">{overlay}</div>'
        f"{_score(moment)}{_lamps(recording, moment)}</section></div></article>"
    )


def _robot(recording: Recording, moment: Moment, place: int, robot: str, picture: Image) -> str:
    name = wording.robot_words(robot)
    feedback = f'<p class="feedback">{escape(moment.feedback[robot])}</p>' if moment.feedback[robot] else ""
    return (
        f'<section class="card robot r{place}"><h3>{name}</h3>'
        f'<img src="{_data_uri(picture, ".jpg")}" alt="What {name} sees" width="400" height="400">'
        f'<p class="action">{_action(recording, moment, robot)}</p>{feedback}'
        f'<p class="seen">{_seen(recording, moment, robot)}</p></section>'
    )


def _action(recording: Recording, moment: Moment, robot: str) -> str:
    if not moment.actions:
        return "At the start"
    words = escape(wording.action_words(moment.actions[robot], recording) + wording.said_words(moment, robot))
    return words if moment.succeeded[robot] else f'{words} <b class="failed">failed</b>'


def _seen(recording: Recording, moment: Moment, robot: str) -> str:
    """Return what a robot sees; X and Y are marked."""
    special = {wording.item_words(recording): "x", wording.target_words(recording): "y"}
    words = [
        f'<b class="{special[noun]}">{escape(noun)}</b>' if noun in special else escape(noun)
        for noun in wording.seen_words(recording, moment, robot)
    ]
    return f"Sees {', '.join(words) or 'nothing'}"


def _score(moment: Moment) -> str:
    reward = f"reward {wording.reward_words(moment.reward)}" if moment.actions else ""
    sign = "good" if moment.reward > 0 else "bad" if moment.reward < 0 else "none"
    return (
        f'<p class="score">Potential <b>{moment.potential:g}</b> of 10<span class="{sign}">{reward}</span></p>'
        f'<div class="bar"><i style="width:{10 * moment.potential:g}%"></i></div>'
    )


def _lamps(recording: Recording, moment: Moment) -> str:
    """Return a small table of the rooms in which X and Y have been seen; nothing without the message board."""
    if moment.messages is None:
        return ""
    head = "".join(f"<th>{wording.room_words(room)}</th>" for room in recording.rooms)
    rows = ""
    for row, (mark, noun) in enumerate((("x", wording.item_words(recording)), ("y", wording.target_words(recording)))):
        cells = "".join(
            f'<td><span class="lamp{f" {mark}" if bit else ""}">{mark.upper() if bit else ""}</span></td>'
            for bit in moment.messages[row]
        )
        rows += f"<tr><th>{mark.upper()} {escape(noun)}</th>{cells}</tr>"
    return f'<table class="lamps"><tr><th>Seen in</th>{head}</tr>{rows}</table>'


def _row(recording: Recording, number: int) -> str:
    moment = recording.moments[number]
    cells = [f'<a href="#step-{number}">{number}</a>']
    cells += [_action(recording, moment, robot) for robot in recording.models]
    numbers = [f"{moment.potential:g}", wording.reward_words(moment.reward) if moment.actions else ""]
    rows = (0, 1) if recording.has_board else ()
    words = [", ".join(wording.known_rooms(recording, moment, row)) for row in rows]
    words.append(escape(" ".join(text for text in moment.feedback.values() if text)))
    row = _cells(cells) + _cells(numbers, ' class="number"') + _cells(words)
    return f'<tr id="row-{number}">{row}</tr>'


def _cells(cells: list[str], kind: str = "") -> str:
    return "".join(f"<td{kind}>{cell}</td>" for cell in cells)


def _css(colour: Colour) -> str:
    return "#{:02x}{:02x}{:02x}".format(*colour)


def _data_uri(picture: Image, suffix: str) -> str:
    """Return a picture as an address that holds it."""
    settings = [cv2.IMWRITE_JPEG_QUALITY, _PICTURE_QUALITY] if suffix == ".jpg" else [cv2.IMWRITE_PNG_COMPRESSION, 9]
    _, data = cv2.imencode(suffix, cv2.cvtColor(picture, cv2.COLOR_RGB2BGR), settings)
    kind = "jpeg" if suffix == ".jpg" else "png"
    return f"data:image/{kind};base64,{base64.b64encode(data.tobytes()).decode()}"
