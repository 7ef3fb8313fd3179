"""Progress of a run on standard error, from its first second on: environments are made and views drawn before steps."""

from types import TracebackType

from stable_baselines3.common.callbacks import BaseCallback

from chmarl_pb.progress import run_bar


class Bar(BaseCallback):
    """A progress bar; use it as a context around the whole run."""

    def __init__(self, title: str, steps: int, quiet: bool):
        """Begin with what comes before the first step.

        Args:
            title: of the run.
            steps: that it takes in all.
            quiet: whether nothing is shown.
        """
        super().__init__()
        self._bar = run_bar(quiet)
        self._task = self._bar.add_task("making environments", total=steps)
        self.say(title)

    def say(self, text: str) -> None:
        """Show a line above the bar; also where no terminal shows the bar."""
        if not self._bar.disable:
            self._bar.console.print(text, highlight=False)

    def __enter__(self) -> "Bar":
        """Show the bar."""
        self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End the bar."""
        self._bar.stop()

    def prepare(self) -> None:
        """Tell what the first episodes wait for."""
        self._bar.update(self._task, description="drawing views")

    def _on_rollout_start(self) -> None:
        self._bar.update(self._task, description="steps")

    def _on_step(self) -> bool:
        self._bar.update(self._task, completed=self.model.num_timesteps)
        return True
