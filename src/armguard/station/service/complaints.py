"""What the log says of things that may come a thousand times a second."""

import logging

log = logging.getLogger("armguard.service")

# A cause is named in the log no more often than this [ns].
PAUSE = 1_000_000_000


class Complaints:
    """Names a cause in the log once a second at most, and how often it came."""

    def __init__(self) -> None:
        self._last: dict[str, int] = {}
        self._silent: dict[str, int] = {}

    def name(self, cause: str, sentence: str, now: int) -> None:
        """Say a sentence, or only count it.

        Args:
            cause: What is complained of.
            sentence: The same in words.
            now: Monotonic clock [ns].
        """
        last = self._last.get(cause)
        if last is not None and now - last < PAUSE:
            self._silent[cause] = self._silent.get(cause, 0) + 1
            return
        self._last[cause] = now
        more = self._silent.pop(cause, 0)
        log.warning(
            "%s: %s%s", cause, sentence, f" ({more} more before)" if more else ""
        )
