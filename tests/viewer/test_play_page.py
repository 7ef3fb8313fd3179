"""The page of ``chmarl-pb play`` in a browser: a task driven to success by clicks, saved, loaded and shown."""

import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from chmarl_pb.evaluation.episode_file import load_episode, replay_episode
from chmarl_pb.tasks.splits import load_tasks
from chmarl_pb.viewer.live.texts import button_words

pytest.importorskip("viser", reason="the extra 'viewer' is not installed")
playwright: Any = pytest.importorskip("playwright.sync_api", reason="playwright, of the extra 'dev', is not installed")

BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
TASK = min(load_tasks("test-unseen"), key=lambda task: task.optimal_steps)
#: WebGL without a graphics card.
FLAGS = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
LONGEST = 240_000  # milliseconds that anything may take: everything is drawn by the processor

pytestmark = pytest.mark.skipif(BROWSER is None, reason="no browser is installed; get one by `apt install chromium`")


@contextmanager
def served(*options: str) -> Iterator[str]:
    """Serve the page in a process of its own; yield its address, and end it as Ctrl-C does."""
    command = [sys.executable, "-m", "chmarl_pb.cli", "play", "--no-open", "--port", "0", *options]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout is not None and process.stderr is not None
    try:
        yield process.stdout.readline().strip()
    finally:
        process.send_signal(signal.SIGINT)
        rest, errors = process.communicate(timeout=120)
    assert (rest, errors, process.returncode) == ("", "chmarl-pb: interrupted\n", 130)


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    with served("--task", TASK.id) as address:
        yield address


@pytest.fixture(scope="module")
def context() -> Iterator[Any]:
    with playwright.sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=BROWSER, args=FLAGS)
        context = browser.new_context(viewport={"width": 390, "height": 560})
        context.set_default_timeout(LONGEST)
        yield context
        browser.close()


def press(page: Any, name: str) -> None:
    """Click the button of a name that is in view, without waiting for the picture to rest."""
    page.get_by_role("button", name=name, exact=True).locator("visible=true").first.dispatch_event("click")


def wait_for(page: Any, words: str) -> None:
    page.get_by_text(words, exact=False).first.wait_for()


def test_wrong_token_is_refused(address: str, context: Any) -> None:
    page = context.new_page()
    answer = page.goto(re.sub("token=.*", "token=wrong", address))
    assert answer.status == 403
    assert "chmarl-pb play" in page.content()
    page.close()


def test_task_is_driven_to_success_saved_and_shown(address: str, context: Any, tmp_path: Path) -> None:
    page = context.new_page()
    page.goto(address)
    assert "token" not in page.url
    wait_for(page, "step 0")
    page.get_by_role("tab", name="Humanoid").dispatch_event("click")
    for number in range(1, TASK.optimal_steps + 1):
        press(page, "Hint")
        hint = page.get_by_text("The planner's next move").text_content()
        action = re.search(r"humanoid (\w+)", hint)
        assert action is not None
        press(page, button_words(action[1]))
        wait_for(page, f"step {number} ")
    wait_for(page, f"Solved in {TASK.optimal_steps} steps")

    other = context.new_page()  # a second tab sees the same session
    other.goto(address)
    wait_for(other, f"Solved in {TASK.optimal_steps} steps")
    other.close()

    page.get_by_role("tab", name="Episode").dispatch_event("click")
    with page.expect_download() as download:
        press(page, "Save")
    path = tmp_path / "episode.json"
    download.value.save_as(path)
    file = load_episode(path)
    assert (file.success, file.policy, len(file.actions)) == (True, "person", TASK.optimal_steps)
    assert replay_episode(file) is None

    press(page, "Step back")
    wait_for(page, f"step {TASK.optimal_steps - 1} ")
    page.locator("input[type=file]").first.set_input_files(path)
    wait_for(page, "step 0 ")
    assert page.get_by_role("button", name="Step back").count() == 0  # what is loaded is only looked at
    slider = page.get_by_role("slider").first
    slider.focus()
    slider.press("End")
    wait_for(page, f"Solved in {TASK.optimal_steps} steps")

    page.get_by_role("tab", name="Episode").dispatch_event("click")
    with page.expect_download() as download:
        press(page, "Save as a page")
    replay = tmp_path / "replay.html"
    download.value.save_as(replay)
    page.close()
    context.set_offline(True)
    alone = context.new_page()
    alone.goto(replay.as_uri())
    alone.locator("canvas").first.wait_for()
    alone.close()
    context.set_offline(False)
