"""What of the errors that were found is taken off: what is significant and told by the geometry, and not by a fluke."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from gateway.align import SECOND, Correction
from gateway.register.corrections import stated
from gateway.register.verdicts import Verdict
from gateway.settings import RadarSite, Registering

LEAST_PAIRS = 30  # of a radar, before anything is made of them
SAID_AFTER_NS = 120 * SECOND  # what is not taken off is said once there was time to find it
GONE_SIGMAS = 2.0  # what was taken off is given back when it is no further than this from what the site file says


@dataclass(frozen=True, slots=True)
class Choice:
    """Of one radar: where its correction goes to, which errors are taken off, and what was said of each."""

    target: Correction
    applied: tuple[bool, ...] = (False,) * 4
    found: tuple[bool, ...] = (False,) * 4  # the last time already
    said: frozenset[str] = frozenset()
    since: int = 1 << 62  # when something was known of it first

    @classmethod
    def nothing(cls, target: Correction) -> Choice:
        """Nothing but what the site file says."""
        return cls(target)

    @classmethod
    def remembered(cls, verdicts: Sequence[Verdict], radar: RadarSite, use: Registering) -> Choice:
        """What was found before, and is still significant for its age."""
        applied = tuple(use == "apply" and one.is_found for one in verdicts)
        return cls(_target(verdicts, applied, stated(radar)), applied, applied)


def chosen(
    before: Choice, verdicts: Sequence[Verdict], radar: RadarSite, use: Registering, at: int, *, trusted: bool
) -> tuple[Choice, list[str]]:
    """The choice after new verdicts, and what is to be said of it; nothing new is taken off that is not `trusted`."""
    applied, target, said, told, since = [], [], set(before.said), [], min(before.since, at)
    for place, verdict in enumerate(verdicts):
        was, found = before.applied[place], verdict.is_found and trusted
        is_gone = verdict.is_told and verdict.off_sigmas <= GONE_SIGMAS
        now = use == "apply" and (not is_gone if was else found and before.found[place])
        applied.append(now)
        # What is taken off and can no longer be told, since nobody flies there, stays as it was.
        kept = before.target[place] if now else verdict.stated
        target.append(verdict.value if now and verdict.is_told else kept)
        kind = "applied" if now else "no more" if was else "found" if found else "told" if verdict.is_told else "untold"
        if (kind == "found" and use == "apply") or (kind in ("told", "untold") and at < since + SAID_AFTER_NS):
            continue  # once more, and it is applied
        topic = f"{verdict.name} {kind}"
        if topic not in said or now != was:
            said.add(topic)
            told.append(f"radar {radar.number}: {_in_words(verdict, kind, use)}")
    where = (target[0], target[1], target[2], target[3])
    return Choice(where, tuple(applied), tuple(one.is_found for one in verdicts), frozenset(said), since), told


def _in_words(verdict: Verdict, kind: str, use: Registering) -> str:
    if kind == "no more":
        return f"{verdict.name}: no longer significant: no longer taken off"
    return verdict.sentence("applied" if use == "apply" else "to be applied")


def _target(verdicts: Sequence[Verdict], applied: Sequence[bool], otherwise: Correction) -> Correction:
    parts = [
        verdict.value if is_on else there for verdict, is_on, there in zip(verdicts, applied, otherwise, strict=True)
    ]
    return parts[0], parts[1], parts[2], parts[3]
