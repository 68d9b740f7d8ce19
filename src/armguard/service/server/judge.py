"""The guard of the service: the request of each cycle, and changes of the guard."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.errors import RefusedError, SceneError
from armguard.guard.given import likely_mistake
from armguard.guard.layout import IN_HEADER
from armguard.guard.levels import Reason
from armguard.guard.verdict import Verdict
from armguard.record import attributes
from armguard.recording.calls import GuardCall, Place, Release, Remove
from armguard.recording.frames import HEADER, Kind, text_of
from armguard.recording.recorded import RecordedGuard
from armguard.recording.ring import RingWriter
from armguard.respond import Command, Guard
from armguard.respond.state import POSITIONS, TWIST_ROW, VELOCITIES
from armguard.respond.state import TWISTS as BY_TWISTS
from armguard.respond.units import DesiredUnits
from armguard.respond.whole_cycle import NOT_JUDGED
from armguard.scene import Scene, compile_scene
from armguard.scene.tables import SceneTables
from armguard.service.desk.answering import write_answer
from armguard.service.desk.desk import AS_DESIRED, NOTHING
from armguard.service.desk.judging import begin_judging, conclude_judging, judge
from armguard.service.desk.keeping import write_frame
from armguard.service.desk.making import desk_of
from armguard.service.desk.taking import take_desired_motion, take_state
from armguard.service.server.scenes import scene_hash
from armguard.service.server.settings import ServiceSettings
from armguard.service.wire import Cause, Form
from armguard.table import Ledger

Floats = NDArray[np.float64]

TWISTS = int(Form.TWISTS)

# Objects that are listed in one reply.
OBJECTS = 12

# Greatest length of an explanation in a reply [characters].
EXPLAINED = 4000

# Requests to a guard, by why the desired motion does not count.
ASK_OF: dict[Cause, int] = {
    Cause.NONE: AS_DESIRED,
    Cause.NO_COMMANDER: NOTHING,
    Cause.NO_WISH: NOTHING,
    Cause.WISH_OLD: NOTHING,
    Cause.STOP_ORDERED: Reason.STOP_ORDERED,
    Cause.RESTARTED: Reason.RESTARTED,
    Cause.REFLEX_STOPPED: Reason.STOP_ORDERED,
    Cause.REFLEX_SILENT: Reason.STOP_ORDERED,
    Cause.DEADLINE_MISSED: Reason.DEADLINE_MISSED,
    Cause.SHUTDOWN: Reason.SHUTDOWN,
}

# Forms of messages as the guard names them.
FORMS = {
    Form.VELOCITIES: VELOCITIES,
    Form.POSITIONS: POSITIONS,
    Form.TWISTS: BY_TWISTS,
}

# A joint that is slower than that rests [rad/s or m/s].
RESTS = 0.01


class Judge:
    """Asks the guard for the commands of robots.

    Attributes:
        guard: The guard; it writes every cycle into the ring.
        scene: What it guards.
        hash: The scene's hash, in hex.
        desk: What a cycle reads and writes.
        lines: The desk's ledger.
        arrival: The desk's message.
        cycle: The desk's cycle.
        senders: Controller of each robot, 0 for none yet.
        sequences: Number of the newest state of each robot.
        complete: Whether every robot has had a state.

    Args:
        scene: See there.
        file: The file it came from, or "".
        settings: Settings of the service.
        ring: The ring.
        message: Where messages are received, as words of eight bytes.
        answer: Where COMMANDs are written, likewise.
    """

    def __init__(
        self,
        scene: Scene,
        file: str,
        settings: ServiceSettings,
        ring: RingWriter,
        message: Floats,
        answer: Floats,
    ) -> None:
        self.scene = scene
        self._file = file
        self._settings = settings
        self._ring = ring
        # What put an object where it is, or took it away, since the start.
        self._moved: dict[str, Place | Remove] = {}
        self.guard, self.hash = self._build(settings.self_test)
        tables = self.guard.guard.tables
        self._tools, self._units = tools_of(tables), DesiredUnits(tables)
        self.desk = desk_of(tables, self._tools, message, answer)
        self._ledger = Ledger(self.desk)
        self.lines = self._ledger.lines
        self.arrival = attributes(self.desk.arrival)
        self.cycle = attributes(self.desk.cycle)
        self.senders = self.desk.sender.data.cast("B").cast("Q")
        self.sequences = self.desk.sequence.data.cast("B").cast("Q")
        self.complete = False
        # Whether a cycle was judged since the guard was made.
        self._judged = False
        # Poses for the frame being written, and the length of its text [bytes].
        self._poses: Floats = np.zeros(0)
        self._text_size = 0
        # Names of the tools of twists, as a frame holds them.
        self._texts: dict[tuple[int, ...], bytes] = {}
        self._compile()
        self._describe_scene()

    @property
    def last(self) -> Command | None:
        """The last command; None before there is one."""
        if not self._judged:
            return None
        desk, tables = self.desk, self.guard.guard.tables
        data = desk.out[: self.cycle.used].copy()
        now = self.cycle.start * 1e-9
        took = (self.cycle.ended - self.cycle.start) * 1e-9
        fault = ""
        if data[IN_HEADER.reason] == Reason.OUT_OF_LIMITS:
            fault = likely_mistake(desk.q, tables)
        verdict = Verdict(data, self.guard.guard.names, now, took, fault)
        return Command(desk.command.copy(), tables.robots, verdict)

    def unit_remark(self) -> str:
        """A sentence if the judged desired motion looks like another unit; else ""."""
        desk = self.desk
        if not self._judged or self.cycle.ask != AS_DESIRED:
            return ""
        form = Form(self.cycle.asked_form)
        rows = desk.rows[: self.cycle.asked_count // 6 * TWIST_ROW]
        return self._units.hint(
            FORMS[form], rows if form is Form.TWISTS else desk.desired
        )

    def ask(self, cause: Cause) -> None:
        """One cycle, and its answer on the desk; `write_down` writes it down.

        Args:
            cause: Why the desired motion does not count, if it does not.
        """
        self.cycle.ask = ASK_OF.get(cause, Reason.SERVICE_FAULT)
        guard = self.guard.guard
        ledgers = guard.ledgers
        if guard.solves_compiled:
            judge(self.lines, *ledgers)
        else:
            unsolved = begin_judging(self.lines, *ledgers)
            if unsolved > 0:
                unsolved = guard.solve_programs(unsolved)
            conclude_judging(unsolved, self.lines, *ledgers)
        self._judged = True

    def rewrite_answer(self) -> None:
        """Write the answer anew: why it is not what was judged is known only now."""
        write_answer(self.lines)

    def write_down(self) -> None:
        """Keep the last cycle, now that it has been answered."""
        desk = self.desk
        text = b""
        if self.cycle.asked_form == TWISTS:
            text = self._text_of(self.cycle.asked_count // 6)
        self._poses = self.guard.guard.poses.reshape(-1)
        self._text_size = len(text)
        length = HEADER + 2 * len(desk.q) + len(desk.stamps) + self.cycle.asked_count
        length += len(desk.command) + self.cycle.used + len(self._poses)
        self.guard.write_row(length, self._fill, text)

    def look(self) -> None:
        """A state was taken over."""
        self.complete = self.complete or 0 not in self.senders

    def release(self, sender: int) -> None:
        """A controller has left; its robots may get another one at once."""
        self.desk.sender[self.desk.sender.view(np.uint64) == sender] = 0

    def at_rest(self) -> bool:
        """Whether no robot moves, or is commanded to."""
        if not self._judged:
            return True
        desk, n = self.desk, len(self.desk.q)
        rests = not self.arrival.measured or (abs(desk.velocity) < RESTS).all()
        return bool(rests) and not desk.command[:n].any()

    def do(self, call: GuardCall) -> None:
        """Make a call of the guard, and remember where it leaves an object."""
        done = self.guard.do(call)
        if isinstance(done, Place | Remove):
            self._moved[done.name] = done
        elif isinstance(done, Release):
            T = np.eye(4)
            tables = self.guard.guard.tables
            body = tables.standing[done.name].body
            T[:3] = tables.T_parent_joint[body].reshape(3, 4)
            self._moved[done.name] = Place(name=done.name, pose=T)

    def objects(self, first: int = 0) -> dict[str, Any]:
        """What was put elsewhere, given another shape or taken away since the start.

        For a client that connects late: the scene's file does not say. By name: its
        pose as it was placed, and its shape in words if it was given one; None if it
        was removed.

        Args:
            first: How many are known already: no more than some fit into a message.
        """
        some = [*self._moved.items()][first : first + OBJECTS]
        where = {"pose", "stamp", "shape"}
        found = {
            name: call.model_dump(include=where) if isinstance(call, Place) else None
            for name, call in some
        }
        return {"objects": found, "count": len(self._moved)}

    def why(self) -> dict[str, Any]:
        """The last command in words."""
        last = self.last
        if last is None:
            return {"why": Cause.WAITING.sentence}
        verdict = last.verdict
        return {
            "why": last.why,
            "remark": self.unit_remark(),
            "explanation": last.explain()[:EXPLAINED],
            "cycle": self.guard.cycle - 1,
            "level": verdict.level.name,
            "reason": verdict.reason.name,
            "blocked": {name: b.sentence for name, b in last.blocked.items()},
            "waits": {
                name: {
                    "reason": held.reason.name,
                    "since": held.since,
                    "remedy": held.remedy,
                }
                for name, held in last.held.items()
            },
            "held": {name: list(by) for name, by in self.guard.guard.held.items()},
        }

    def configure(self, response: Any = None, mode: Any = None) -> dict[str, Any]:
        """Go on with other settings of the scene; only while everything rests.

        Args:
            response: What robots do about what is near, for all of them or by name; as
                before if None.
            mode: How distances are made, likewise.

        Raises:
            RefusedError: Something moves, or a gripper holds something.
            SceneError: A setting is none.
        """
        if not self.at_rest():
            raise RefusedError("settings are changed only while every robot rests")
        if self.guard.guard.held:
            raise RefusedError("settings are changed only while no gripper holds")
        robots = dict(self.scene.robots)
        before = self.scene.mode
        cycle = self.guard.cycle
        try:
            for chosen, change in (
                (response, self.scene.set_response),
                (mode, self.scene.set_mode),
            ):
                if isinstance(chosen, dict):
                    for name, value in chosen.items():
                        change(value, name)
                elif chosen is not None:
                    change(chosen)
            guard, found = self._build(self_test=False)
            if any(p.mode == "fixed" for p in guard.guard.tables.robots):
                raise SceneError("mode 'fixed' predicts no stops; commands need others")
        except Exception:
            self.scene.mode = before
            for name, robot in robots.items():
                self.scene.set_mode(robot.mode, name)
                self.scene.set_response(robot.response, name)
            raise
        guard.cycle = cycle
        guard.guard.hold(self.guard.guard.ordered)
        guard.shapes.update(self.guard.shapes)
        self.guard, self.hash, self._judged = guard, found, False
        self._describe_scene()
        for call in self._moved.values():
            guard.do(call)
        return {"scene_hash": found}

    def checkpoint(self) -> None:
        """Write down all that the guard remembers, for a replay of what follows."""
        self.guard.checkpoint()

    def note(self, note: str, **more: Any) -> None:
        """Write down something that changes nothing."""
        self.guard.write_text(Kind.NOTE, {"note": note, **more})

    def _build(self, self_test: bool) -> tuple[RecordedGuard, str]:
        """A guard of the scene as it is now, and the scene's hash."""
        guard = Guard(self.scene, budget=self._settings.budget, self_test=self_test)
        # The guard's own tables have slots for sensed cells as well.
        found = scene_hash(compile_scene(self.scene))
        return RecordedGuard(guard, self._ring), found

    def _compile(self) -> None:
        """Compile, or load, what the loop calls; nothing was received or asked."""
        take_state(self.lines)
        take_desired_motion(self.lines)
        guard = self.guard.guard
        guard.reset()
        # No state is none that a guard believes: it only refuses.
        self.ask(Cause.WAITING)
        self.rewrite_answer()
        begin_judging(self.lines, *guard.ledgers)
        conclude_judging(NOT_JUDGED, self.lines, *guard.ledgers)
        self._poses = guard.poses.reshape(-1)
        self._fill(np.zeros(len(self._poses) + 8 * len(self.desk.out)), 0.0, 0.0)
        guard.reset()
        self._judged = False
        self.desk.held.fill(np.nan)

    def _fill(self, row: Floats, monotonic: float, wall: float) -> None:
        """Fill in the frame of the last cycle."""
        write_frame(self.lines, row, self._poses, monotonic, wall, self._text_size)

    def _text_of(self, count: int) -> bytes:
        """What a frame says of the tools of so many twists."""
        tools = tuple(int(k) for k in self.desk.twists["tool"][:count])
        if tools not in self._texts:
            names = [self._tools[k] for k in tools]
            self._texts[tools] = text_of({"fault": "", "tools": names})
        return self._texts[tools]

    def _describe_scene(self) -> None:
        """Write down what is guarded."""
        from armguard import __version__

        tables, settings = self.guard.guard.tables, self._settings
        about = {
            "scene_file": self._file,
            "scene_hash": self.hash,
            "bodies": list(dict.fromkeys(tables.body_names)),
            "late": tables.late,
            "version": __version__,
            "settings": {
                "rate": settings.rate,
                "late": settings.late,
                "modes": {part.name: part.mode for part in tables.robots},
                "responses": {part.name: part.response.kind for part in tables.robots},
            },
        }
        self.guard.describe(self.scene, about)


def tools_of(tables: SceneTables) -> tuple[str, ...]:
    """Names of tools in the order of their indices: robots, then links."""
    return (*(part.name for part in tables.robots), *tables.links)


def scene_word(scene: str) -> int:
    """The first eight bytes of a scene's hash, as messages carry it."""
    return int.from_bytes(bytes.fromhex(scene)[:8], "little")
