"""The loops that drive a session: live, in ticks of 10 to 50 ms; replayed, at full speed or at the pace of old."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Sequence

from adapters import Arrival
from gateway.picture import Picture
from gateway.runtime.allowed import Allowed
from gateway.runtime.declaring import Declaring
from gateway.runtime.interpreter import UnhurriedCollection
from gateway.runtime.links import Link
from gateway.runtime.manners import Manners
from gateway.runtime.pace import Pace
from gateway.runtime.playback import Playback
from gateway.runtime.receiver import Delivery, Receiver
from gateway.runtime.run import Run
from gateway.runtime.setup import RunFailure, Setup
from gateway.runtime.summary import Summary

TICK_S = 0.01  # so that a late report is in the picture within 30 ms also when a tick draws, which takes 15
_LONGER_TICKS_S = ((25_000, 0.05), (5_000, 0.02))
"""From so many arrivals a second on, how long a tick is: a step has a price of its own, so fewer and larger ones cost less."""
_IDLE_NS = 100_000_000  # when nothing came, the watermark alone is worked in this often: an empty step costs 1 ms
_REPLAY_STEP_NS = 1_000_000_000  # of stamps, at full speed: large steps are cheap steps
_PACED_STEP_NS = 40_000_000
_NO_PLACE_AFTER_S = 90.0  # after a minute even the first position would do

Watch = Callable[[Run, Picture | None], None]
"""What a caller does after each step: show progress, tell events. It must not take long."""
AskedToStop = Callable[[], str | None]


def _nobody(run: Run, picture: Picture | None) -> None:
    """Nobody watches."""


def _never() -> str | None:
    return None


def run_live(
    mavlink: Sequence[Link],
    radar: Sequence[Link],
    setup: Setup,
    *,
    seconds: float | None = None,
    watch: Watch = _nobody,
    asked_to_stop: AskedToStop = _never,
    no_place_after_s: float = _NO_PLACE_AFTER_S,
    allowed: Allowed | None = None,
    manners: Manners | None = None,
    told: Sequence[bytes] = (),
    declaring: Declaring = Declaring(),
) -> Summary:
    """Fuse what open links bring until asked to stop, or for so many seconds; closes the links.

    `allowed`: who may be heard; None: everybody. `manners`: what may be sent on the MAVLink links; None: nothing. `told`:
    what the gateway is told at the start (adapters/told.py). `declaring`: how people may tell it more; closed at the end.

    Raises RunFailure when the archive cannot be written, or the stream does not tell where we are.
    """
    receiver = Receiver(mavlink, radar, allowed=allowed)
    for line in told:
        receiver.tell(line)
    try:
        run = Run(setup, receiver.started_at)
        with _Abandoning(run), UnhurriedCollection() as collection:
            if run.folder is not None:
                declaring.write_into(run.folder)
            receiver.start()

            def tick() -> int:
                collection.collect_when_due()
                lines, notes = declaring.tend(run)
                for line in lines:
                    receiver.tell(line)
                return _tick(receiver, run, watch, manners, notes)

            ended = _live(tick, run, seconds, asked_to_stop, no_place_after_s)
            receiver.close()
            _tick(receiver, run, watch, manners, is_last=True)
            return run.finish(ended)
    finally:
        declaring.close()
        receiver.close()


def _live(
    tick: Callable[[], int], run: Run, seconds: float | None, asked_to_stop: AskedToStop, no_place_after_s: float
) -> str:
    """Tick until the end; how it ended."""
    began = tick_began = time.monotonic()
    while True:
        before, tick_began = tick_began, time.monotonic()
        arrivals = tick()
        if run.place is None and run.heard_for_s > no_place_after_s:
            raise RunFailure(
                "Nothing that came in tells where the runway is (no HOME_POSITION, no mission, nobody standing still); "
                "give a site file with --site, `talkdown site` writes one to start from."
            )
        if asker := asked_to_stop():
            return f"stopped by {asker}"
        if seconds is not None and tick_began - began >= seconds:
            return "done"
        a_second = arrivals / max(tick_began - before, TICK_S)  # these are what came since the tick before
        tick_s = next((longer for least, longer in _LONGER_TICKS_S if a_second >= least), TICK_S)
        time.sleep(max(0.0, tick_s - (time.monotonic() - tick_began)))


def _tick(
    receiver: Receiver,
    run: Run,
    watch: Watch,
    manners: Manners | None,
    notes: tuple[tuple[str, str], ...] = (),
    *,
    is_last: bool = False,
) -> int:
    """Work in what came; where nothing did, the watermark, if it has not been worked in for a while. How much came."""
    delivery = receiver.drain()
    notes = (*delivery.notes, *notes)
    if manners is not None and not is_last:
        notes = (*notes, *_speak(receiver, delivery, manners))
    is_idle = not (delivery.arrivals or delivery.sources or notes)
    if is_idle and not is_last and delivery.watermark - run.watermark < _IDLE_NS:
        return 0
    for source in delivery.sources:
        run.add(source)
    run.count(receiver.counters() if manners is None else receiver.counters() | manners.counters)
    watch(run, run.work(delivery.arrivals, delivery.watermark, notes))
    return len(delivery.arrivals)


def _speak(receiver: Receiver, delivery: Delivery, manners: Manners) -> list[tuple[str, str]]:
    """Send what is due after what came; what there is to tell of it."""
    for source in delivery.sources:
        manners.add(source)
    manners.hear(delivery.arrivals)
    for number, frame in manners.due(delivery.watermark):
        receiver.send(number, frame)
    notes = list(manners.notes)
    manners.notes.clear()
    return notes


def run_replay(
    playback: Playback,
    setup: Setup,
    *,
    speed: float | None = None,
    watch: Watch = _nobody,
    asked_to_stop: AskedToStop = _never,
    step_ns: int | None = None,
    tell_smoothed: Callable[[float], None] = lambda share: None,
) -> Summary:
    """Run recordings again: as fast as it goes, or at `speed` times their pace. Any `step_ns` gives the same numbers.

    `tell_smoothed` hears how far the smoothing at the end is, from 0 to 1.
    Raises RunFailure when the archive cannot be written.
    """
    if step_ns is None:
        step_ns = _REPLAY_STEP_NS if speed is None else max(int(_PACED_STEP_NS * speed), 1)
    run = Run(setup, playback.started_at)
    with _Abandoning(run):
        for source in playback.sources:
            run.add(source)
        pace, ended = Pace(speed, asked_to_stop), "done"
        paced_from = setup.options.begins_at or playback.started_at  # what comes before is not waited for
        for arrivals, watermark in steps(playback.arrivals(), playback.started_at, step_ns, idle=speed is not None):
            if speed is not None and watermark >= paced_from:
                pace.wait(watermark)
            if asker := asked_to_stop():
                ended = f"stopped by {asker}"
                break
            run.count(playback.counters())
            watch(run, run.work(arrivals, watermark))
        else:
            if playback.watermark is not None:
                watch(run, run.work([], playback.watermark))
        if run.place is None and ended == "done":
            unbelieved = " that is signed with the key" if setup.signing_key is not None else ""
            raise RunFailure(
                f"Nothing in this recording{unbelieved} tells where the runway is; give a site file with --site."
            )
        return run.finish(ended, tell_smoothed)


def steps(
    arrivals: Iterable[Arrival], started_at: int, step_ns: int, *, idle: bool = False
) -> Iterator[tuple[list[Arrival], int]]:
    """Arrivals in order, cut at multiples of `step_ns` after the start; with each the watermark that its cut implies.

    A silence makes one long step, or with `idle` many empty ones. `step_ns` 0 gives every arrival a step of its own.
    """
    gathered: list[Arrival] = []
    cut = started_at + step_ns
    for arrival in arrivals:
        if not step_ns:
            # Arrivals of foreign recordings share stamps: the watermark stays below those still to come.
            if gathered:
                yield gathered, min(gathered[-1].received_at, arrival.received_at - 1)
            gathered = [arrival]
            continue
        while arrival.received_at > cut:
            if gathered or idle:
                yield gathered, cut
                gathered = []
            late = arrival.received_at - cut
            cut += step_ns if idle else -(-late // step_ns) * step_ns
        gathered.append(arrival)
    if gathered:
        yield gathered, gathered[-1].received_at


class _Abandoning:
    """A run that leaves by an exception is closed as far as it can be."""

    def __init__(self, run: Run) -> None:
        self._run = run

    def __enter__(self) -> None:
        return None

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: object) -> None:
        if isinstance(error, KeyboardInterrupt) or kind is None:
            return  # at once means at once: what was flushed is on the disk
        self._run.abandon(f"failed: {error}")
