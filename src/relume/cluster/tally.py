"""What has become of the tasks of a run so far, and the time that those left will take."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from relume.cluster.attempt import Outcome

TaskProgress = Callable[[int, int, int, float | None], None]
"""Called with the tasks that are done, that failed and that are to go, and the seconds left as far as is measured."""


@dataclass
class Tally:
    """What has become of the tasks so far, and who is to hear of it."""

    count: int
    heard: Sequence[TaskProgress]
    outcomes: dict[int, Outcome] = field(default_factory=dict)
    failed: int = 0
    begun: float = field(default_factory=time.monotonic)

    def settle(self, index: int, outcome: Outcome) -> None:
        """Take down what finally came of a task."""
        self.outcomes[index] = outcome
        self.failed += outcome.failed is not None
        self.say()

    def say(self) -> None:
        settled = len(self.outcomes)
        to_go = self.count - settled
        left = (time.monotonic() - self.begun) / settled * to_go if settled else None
        for each in self.heard:
            each(settled - self.failed, self.failed, to_go, left)
