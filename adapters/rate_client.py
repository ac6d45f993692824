"""Asking one vehicle for messages that do not come, or come too seldom: a state machine without a link.

First, 5 s of listening. What comes at its rate or faster (with what the link lost counted in) is left alone, so that no
rate is ever lowered. The rest is asked for, one message after the other:

    COMMAND_LONG  MAV_CMD_SET_MESSAGE_INTERVAL (511), message id, interval in us      answered by COMMAND_ACK
    COMMAND_LONG  MAV_CMD_REQUEST_MESSAGE (512), HOME_POSITION, where it was not heard
    REQUEST_DATA_STREAM      only to an autopilot that does not know 511: it has no other way

Without an answer a command is sent again after 1, 2 and 4 s, and given up 4 s later. Then 5 s of listening again, and
what came of it is said. A vehicle that has rebooted has forgotten, and is asked again.
"""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, field
from typing import NamedTuple

from adapters.mavlink_frames import fields, message_name
from adapters.mission_client import SECOND, Ask

SET_MESSAGE_INTERVAL, REQUEST_MESSAGE = 511, 512
LISTEN_NS = 5 * SECOND
PAUSES_NS = (1 * SECOND, 2 * SECOND, 4 * SECOND, 4 * SECOND)  # after the command, and after each time it is sent again
_HOME_AGAIN_NS, _HOME_TRIES = 30 * SECOND, 10  # before its GPS fix a vehicle has no home to tell
_STREAM_ROUNDS = 3  # nobody acknowledges REQUEST_DATA_STREAM
_FAR_BEHIND = 200  # a sequence number that is so far ahead is one that came late
_ACCEPTED, _LATER, _UNSUPPORTED, _FAILED, _IN_PROGRESS = 0, 1, 3, 4, 5  # MAV_RESULT

COMMAND_ACK, read_ack = fields("COMMAND_ACK", "command", "result", "target_system")


class Wanted(NamedTuple):
    """A message, how often it is asked for, from which rate on it is left alone, and the old stream that it is in."""

    message: int
    rate_hz: float
    enough_hz: float
    stream: int | None

    @property
    def name(self) -> str:
        """The message's name."""
        return message_name(self.message)


WANTED = (
    Wanted(33, 5.0, 5.0, 6),  # GLOBAL_POSITION_INT
    Wanted(24, 2.0, 2.0, 2),  # GPS_RAW_INT
    Wanted(30, 10.0, 10.0, 10),  # ATTITUDE
    Wanted(74, 2.0, 2.0, 11),  # VFR_HUD
    Wanted(2, 1.0, 0.5, 12),  # SYSTEM_TIME
    Wanted(245, 1.0, 1.0, None),  # EXTENDED_SYS_STATE
)
HOME_POSITION = Wanted(242, 0.0, 0.0, None)


@dataclass(slots=True)
class RateClient:
    """One vehicle on one link. Times are stamps, ns. What there is to say once gathers in `notes` as (level, text)."""

    name: str
    listens_since: int | None  # None: not now
    notes: list[tuple[str, str]] = field(default_factory=list)
    _counts: Counter[int] = field(default_factory=Counter)
    _lost: int = 0
    _last_sequence: int | None = None
    _queue: list[Wanted] = field(default_factory=list)  # the first one is being asked for
    _tries: int = 0
    _due_at: int = 0
    _has_asked: bool = False
    _has_answered: bool = False
    _uses_streams: bool = False
    _rounds: int = 0
    _granted: list[Wanted] = field(default_factory=list)
    _refused: list[Wanted] = field(default_factory=list)
    _has_home: bool = False
    _home_tries: int = 0
    _home_due_at: int | None = None
    _is_told: bool = False

    def hear(self, message: int, sequence: int) -> None:
        """A frame of the vehicle, whatever it says."""
        if message == HOME_POSITION.message:
            self._has_home = True
        if self.listens_since is None:
            return
        gap = 0 if self._last_sequence is None else (sequence - self._last_sequence - 1) & 255  # 255: heard twice
        if gap < _FAR_BEHIND:
            self._lost += gap
            self._last_sequence = sequence
        self._counts[message] += 1

    def hear_ack(self, command: int, result: int, now: int) -> None:
        """An answer to a command of ours. It does not say which message it is about: there is only one in question."""
        if not self._queue or not self._tries or command != _command(self._queue[0]):
            return
        if result == _IN_PROGRESS:
            self._due_at = now + PAUSES_NS[-1]
        elif self._queue[0] is HOME_POSITION:
            if result in (_LATER, _FAILED) and self._home_tries < _HOME_TRIES:
                self._home_due_at = now + _HOME_AGAIN_NS
            self._next(now)
        elif result == _UNSUPPORTED and not self._has_answered:
            self._fall_back(now)
        elif result != _LATER:
            self._has_answered = True
            (self._granted if result == _ACCEPTED else self._refused).append(self._queue[0])
            self._next(now)

    def due(self, now: int) -> Ask | None:
        """What to send now."""
        if self.listens_since is not None:
            if now - self.listens_since < LISTEN_NS:
                return None
            self._conclude(now)
        if self._home_due_at is not None and now >= self._home_due_at and not self._queue:
            self._home_due_at, self._tries, self._due_at = None, 0, now
            self._queue = [] if self._has_home else [HOME_POSITION]
        while self._queue and now >= self._due_at:
            if self._tries < len(PAUSES_NS):
                return self._ask(self._queue[0], now)
            self._give_up(now)
        return None

    def _ask(self, wanted: Wanted, now: int) -> Ask:
        if self._uses_streams:
            self._next(now)
            rate = {"req_stream_id": wanted.stream, "req_message_rate": round(wanted.rate_hz), "start_stop": 1}
            return "REQUEST_DATA_STREAM", rate
        self._due_at = now + PAUSES_NS[self._tries]
        values: dict[str, float] = {"command": _command(wanted), "confirmation": self._tries, "param1": wanted.message}
        values |= dict.fromkeys(("param2", "param3", "param4", "param5", "param6", "param7"), 0.0)
        if wanted is HOME_POSITION:
            self._home_tries += 1
            values["param7"] = 1.0  # to whom: the one who asks
        else:
            values["param2"] = 1e6 / wanted.rate_hz
        self._tries += 1
        return "COMMAND_LONG", values

    def _next(self, now: int) -> None:
        """The first in the queue is settled."""
        was_home = self._queue.pop(0) is HOME_POSITION
        self._tries, self._due_at = 0, now
        if self._queue or (was_home and self._is_told):
            return
        if self._granted:
            self._listen(now)
        elif self._refused:
            self._tell({})

    def _listen(self, now: int) -> None:
        self.listens_since, self._lost, self._last_sequence = now, 0, None
        self._counts.clear()

    def _conclude(self, now: int) -> None:
        """Enough was listened: ask for what is missing, or say what came of it."""
        rates, at_most = self._rates(now)
        missing = [one for one in WANTED if at_most[one] < one.enough_hz]
        self.listens_since, self._tries, self._due_at = None, 0, now
        if not self._has_asked:
            self._has_asked = True
            self._queue = [*missing, *([] if self._has_home else [HOME_POSITION])]
            if not missing:
                self.notes.append(("info", f"{self.name} sends all that is wanted, and is asked for no rate."))
        elif self._uses_streams and self._rounds < _STREAM_ROUNDS and (again := _both(self._granted, missing)):
            self._queue = again
            self._rounds += 1
        else:
            self._tell(rates)

    def _rates(self, now: int) -> tuple[dict[Wanted, float], dict[Wanted, float]]:
        """How often each comes and how often it may come at most, Hz, with what the link lost counted in.

        The second is what keeps a lossy link from lowering a rate: one message more than was counted, and three standard
        deviations of how many of so few may be among the lost.
        """
        heard = self._counts.total()
        per_s = (heard + self._lost) / max(heard, 1) * SECOND / (now - (self.listens_since or 0))
        lost_share = self._lost / max(heard + self._lost, 1)
        rates, at_most = {}, {}
        for one in WANTED:
            count = self._counts[one.message]
            rates[one] = count * per_s
            at_most[one] = (count + 1 + 3 * math.sqrt(count * lost_share)) * per_s if count else 0.0
        return rates, at_most

    def _fall_back(self, now: int) -> None:
        """An autopilot from before SET_MESSAGE_INTERVAL."""
        self._uses_streams, self._rounds = True, 1
        self.notes.append(
            ("info", f"{self.name} does not know SET_MESSAGE_INTERVAL: it is asked with REQUEST_DATA_STREAM.")
        )
        self._refused = [one for one in self._queue if one.stream is None and one is not HOME_POSITION]
        self._granted = [one for one in self._queue if one.stream is not None]
        self._queue, self._tries, self._due_at = list(self._granted), 0, now
        if not self._queue:
            self._tell({})

    def _give_up(self, now: int) -> None:
        """No answer, however often it was asked."""
        unanswered = self._queue[0]
        if self._has_answered or unanswered is HOME_POSITION:
            if unanswered is not HOME_POSITION:
                self._refused.append(unanswered)
            self._next(now)
            return
        self._queue.clear()
        self.notes.append(
            ("warning", f"{self.name} was asked {len(PAUSES_NS)} times for {unanswered.name} and does not answer.")
        )

    def _tell(self, rates: dict[Wanted, float]) -> None:
        self._is_told = True
        asked = ", ".join(f"{one.name} at {one.rate_hz:g} Hz (now {rates[one]:.1f})" for one in self._granted)
        if asked:
            self.notes.append(("info", f"{self.name} was asked for {asked}."))
        if self._refused:
            self.notes.append(("info", f"{self.name} does not give {', '.join(one.name for one in self._refused)}."))


def _command(wanted: Wanted) -> int:
    return REQUEST_MESSAGE if wanted is HOME_POSITION else SET_MESSAGE_INTERVAL


def _both(some: list[Wanted], others: list[Wanted]) -> list[Wanted]:
    return [one for one in some if one in others]
