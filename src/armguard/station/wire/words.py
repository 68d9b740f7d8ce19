"""Words of the messages: why a command is what it is."""

from enum import IntEnum


class Cause(IntEnum):
    """What the service, or a client, has to say beside the guard's reason.

    From `STOP_ORDERED` on it is a stop.
    """

    NONE = 0
    NO_COMMANDER = 1
    NO_WISH = 2
    WISH_OLD = 3
    STOP_ORDERED = 10
    DEADLINE_MISSED = 11
    FAULT = 12
    SHUTDOWN = 13
    WAITING = 14
    RESTARTED = 15
    NOT_CONNECTED = 100
    SERVICE_SILENT = 101
    NO_ANSWER = 102
    SERVICE_GONE = 103
    NOT_YOURS = 104

    @property
    def stops(self) -> bool:
        """Whether it is a stop."""
        return self >= Cause.STOP_ORDERED

    @property
    def sentence(self) -> str:
        """The same for people."""
        return CAUSE_SENTENCES[self]


CAUSE_SENTENCES: dict[Cause, str] = {
    Cause.NONE: "what the commander wants was judged",
    Cause.NO_COMMANDER: "nobody commands; nothing was asked for",
    Cause.NO_WISH: "the commander has not wished for anything yet",
    Cause.WISH_OLD: "the commander is silent; nothing was asked for",
    Cause.STOP_ORDERED: "a stop was ordered; the commander has to engage",
    Cause.DEADLINE_MISSED: "the service was later than its period allows",
    Cause.FAULT: "something went wrong in the service; its log tells what",
    Cause.SHUTDOWN: "the service shuts down",
    Cause.WAITING: "not every robot has sent a state yet",
    Cause.RESTARTED: "the service was restarted after a crash; the commander has to "
    "engage",
    Cause.NOT_CONNECTED: "not connected to a service",
    Cause.SERVICE_SILENT: "the service is silent",
    Cause.NO_ANSWER: "the service lives, and has sent no command in time",
    Cause.SERVICE_GONE: "the service has said good-bye",
    Cause.NOT_YOURS: "another controller sends the states of these robots",
}
