"""The guard of the service, what it is asked in each cycle, and how it is changed."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armguard.errors import SceneError
from armguard.geometry.shapes import Shape
from armguard.respond import Command, Guard
from armguard.scene import Scene
from armguard.station import frames
from armguard.station.errors import RefusedError
from armguard.station.frames import Kind
from armguard.station.recorded import RecordedGuard
from armguard.station.ring import RingWriter
from armguard.station.service.scenes import scene_hash
from armguard.station.service.settings import ServiceSettings
from armguard.station.service.states import States
from armguard.station.service.wishes import Wishes
from armguard.station.shape_words import shape_of
from armguard.station.wire.layout import Form
from armguard.station.wire.words import Cause

Floats = NDArray[np.float64]

# A joint that is slower than that rests [rad/s or m/s].
RESTS = 0.01


class Judge:
    """Asks the guard what robots are to be told.

    Attributes:
        guard: The guard; it writes every cycle into the ring.
        scene: What it guards.
        hash: The scene's hash, in hex.
        last: The last command; None before there is one.

    Args:
        scene: See there.
        file: The file it came from, or "".
        settings: Settings of the service.
        ring: The ring.
    """

    def __init__(
        self, scene: Scene, file: str, settings: ServiceSettings, ring: RingWriter
    ) -> None:
        self.scene = scene
        self.last: Command | None = None
        self._file = file
        self._settings = settings
        self._ring = ring
        # Where objects were put since the start, or that they were taken away.
        self._moved: dict[str, dict[str, Any] | None] = {}
        self._shapes: dict[str, Shape] = {}
        self.guard, self.hash = self._build(settings.self_test)
        n = len(self.guard.guard.q_names)
        self._nothing: Floats = np.zeros(n)
        self._impossible: Floats = np.full(n, np.nan)
        # What the last cycle was asked.
        self._asked: tuple[Form, Floats, Floats | None, float]
        self._asked = Form.VELOCITIES, self._nothing, None, 0.0
        # Whether what was told is what is held if the commander falls silent.
        self._holds = False
        self._tell_scene()

    def ask(
        self,
        states: States,
        wishes: Wishes,
        cause: Cause,
        now: float,
    ) -> tuple[Command, Form]:
        """One cycle; `write_down` writes it down.

        Args:
            states: What was measured.
            wishes: What the commander wants.
            cause: Why that does not count, if it does not.
            now: Time of the cycle [s].

        Returns:
            The command, and what was asked for.
        """
        guard, velocity = self.guard.guard, states.velocities
        form = wishes.form
        if cause.stops:
            # A wish that is none is how a guard is told to stop.
            form, wish = Form.VELOCITIES, self._impossible
        elif cause == Cause.NONE:
            wish = wishes.values
        elif form == Form.POSITIONS and np.isfinite(wishes.held).all():
            wish = wishes.held
        else:
            form, wish = Form.VELOCITIES, self._nothing
        q, stamps = states.q, states.stamp
        if form == Form.VELOCITIES:
            command = guard.filter(q, wish, stamps, velocity=velocity, now=now)
        elif form == Form.POSITIONS:
            command = guard.filter_positions(
                q, wish, stamps, velocity=velocity, now=now
            )
        else:
            command = guard.filter_twists(
                q, wishes.twists, stamps, velocity=velocity, now=now
            )
        self.last = command
        self._asked = form, wish, velocity, now
        self._holds = cause == Cause.NONE or cause.stops
        return command, form

    def write_down(
        self, states: States, wishes: Wishes, received: float, ended: float
    ) -> None:
        """Keep the last cycle, now that it has been answered.

        Args:
            states: What it was judged from.
            wishes: What the commander wanted.
            received: When the state came in that began it; NaN for none [s].
            ended: When it had been judged [s].
        """
        command = self.last
        if command is None:
            return
        form, wish, velocity, now = self._asked
        if self._holds:
            wishes.held[:] = command.position
        tools: tuple[str, ...] = ()
        if form == Form.TWISTS:
            tools = tuple(wishes.twists)
            rows = [self._nothing[:0], *wishes.twists.values()]
            wish = np.concatenate(rows)
        self.guard.write_command(
            frames.Form(int(form)),
            states.q,
            velocity,
            states.stamp,
            now,
            wish,
            command,
            received,
            tools,
            ended,
        )

    def at_rest(self, states: States) -> bool:
        """Whether no robot moves, or is told to."""
        if self.last is None:
            return True
        measured = states.velocities
        slow = measured is None or bool((np.abs(measured) < RESTS).all())
        return slow and not self.last.velocity.any()

    def place(
        self,
        name: str,
        pose: Any,
        stamp: float | None = None,
        velocity: Any = None,
        shape: Mapping[str, Any] | None = None,
    ) -> None:
        """See `Guard.place`; a shape is told by its kind and its sizes."""
        T = np.array(pose, dtype=np.float64)
        made = self._shapes.get(name) if shape is None else shape_of(shape)
        self.guard.place(name, T, stamp, velocity=velocity, shape=made)
        if made is not None:
            self._shapes[name] = made
        self._moved[name] = {"pose": T, "stamp": stamp, "velocity": velocity}

    def remove(self, name: str) -> None:
        """See `Guard.remove`."""
        self.guard.remove(name)
        self._moved[name] = None

    def why(self) -> dict[str, Any]:
        """The last command in words."""
        if self.last is None:
            return {"why": Cause.WAITING.sentence}
        verdict = self.last.verdict
        return {
            "why": verdict.why,
            "cycle": self.guard.cycle - 1,
            "level": verdict.level.name,
            "reason": verdict.reason.name,
            "blocked": {name: b.sentence for name, b in self.last.blocked.items()},
            "held": {name: list(by) for name, by in self.guard.guard.held.items()},
        }

    def configure(
        self, states: States, response: Any = None, mode: Any = None
    ) -> dict[str, Any]:
        """Go on with other settings of the scene; only while everything rests.

        Args:
            states: What was measured.
            response: What robots do about what is near, for all of them or by name; as
                before if None.
            mode: How distances are made, likewise.

        Raises:
            RefusedError: Something moves, or a gripper holds something.
            SceneError: A setting is none.
        """
        if not self.at_rest(states):
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
        self.guard, self.hash, self.last = guard, found, None
        self._tell_scene()
        for name, put in self._moved.items():
            if put is None:
                guard.remove(name)
            else:
                guard.place(
                    name,
                    put["pose"],
                    put["stamp"],
                    velocity=put["velocity"],
                    shape=self._shapes.get(name),
                )
        return {"scene_hash": found}

    def checkpoint(self) -> None:
        """Write down all that the guard remembers, for who replays what follows."""
        self.guard.checkpoint()

    def note(self, note: str, **more: Any) -> None:
        """Write down something that changes nothing."""
        self.guard.tell(Kind.NOTE, {"note": note, **more})

    def _build(self, self_test: bool) -> tuple[RecordedGuard, str]:
        """A guard of the scene as it is now, and the scene's hash."""
        guard = Guard(self.scene, budget=self._settings.budget, self_test=self_test)
        return RecordedGuard(guard, self._ring), scene_hash(guard.tables)

    def _tell_scene(self) -> None:
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


def scene_word(scene: str) -> int:
    """The first eight bytes of a scene's hash, as messages carry it."""
    return int.from_bytes(bytes.fromhex(scene)[:8], "little")
