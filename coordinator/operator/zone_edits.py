"""A zone that the operator draws or takes away: what is to be said, and what has come of it.

Like an edit of a task it has arrived where somebody's answer shows it: everyone who is there is
asked until all have confirmed it. What lies in a zone is not refused, as in a scenario file, but
told: it may be drawn because of what is there.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from coordinator.mission_view.wording import listed
from coordinator.operator.commands import RequestHandler, RequestResult, RequestVerdict
from swarm.model import Mission, Origin
from swarm.model.frames import enu_from_wgs84
from swarm.model.ids import ID_RULE, OPERATOR, valid_id
from swarm.protocol.encoding import SMALL_LIMIT_BYTES, encode
from swarm.protocol.field_messages import ZoneEdit, ZoneSpec
from swarm.protocol.fields import MAX_COUNT, FlatPoint
from swarm.protocol.messages import Message, MissionConfig, Stamp
from swarm.protocol.operator_commands import zones_in_force

FARTHEST_M = 1e7
"""Of corners, as in a scenario file."""
_CORNER_BYTES = 19
"""Of one corner in a message: two numbers of nine bytes, and that they are two."""
_NAMES_TOLD = 3


class UnsoundZoneError(ValueError):
    """What is wrong with a zone, and what would be right."""

    def __init__(self, problem: str, remedy: str) -> None:
        super().__init__(problem)
        self.remedy = remedy


@dataclass(frozen=True, slots=True)
class NewZone:
    """A zone to be drawn.

    Raises:
        UnsoundZoneError: it is no zone, or too large to be told.
    """

    zone: str
    polygon: tuple[FlatPoint, ...]
    """Corners: east and north of the mission's origin [m], or latitude and longitude [deg]."""
    holes: tuple[tuple[FlatPoint, ...], ...] = ()
    """Inside of these the zone is not; as the polygon."""
    in_degrees: bool = False
    floor_m: float | None = None
    """Lowest height [m above the mission's origin]; None: from the ground up."""
    ceiling_m: float | None = None
    """Greatest height [m above the mission's origin]; None: unlimited."""
    inclusive: bool = False
    """It is the only place where to fly."""
    replaces: bool = False
    """A zone of that id may be there already: it is drawn anew."""
    reason: str = ""

    def __post_init__(self) -> None:
        if not valid_id(self.zone):
            raise UnsoundZoneError(f"{self.zone!r} is no id", f"give {ID_RULE}")
        for name in ("floor_m", "ceiling_m"):
            height_m = getattr(self, name)
            if height_m is not None and not abs(height_m) <= FARTHEST_M:
                problem = f"{name} of zone {self.zone} is {height_m:g}"
                raise UnsoundZoneError(problem, f"give a height within ±{FARTHEST_M:g} m")
        rings = (self.polygon, *self.holes)
        for corner in (corner for ring in rings for corner in ring):
            self._require_place(corner)
        # Whether it is a polygon does not depend on where the mission's origin is.
        near = Origin(*self.polygon[0], 0.0) if self.in_degrees and self.polygon else None
        edit = ZoneEdit(self.spec(near), False, MAX_COUNT, self.reason)
        mission, stamp = "m" * 64, Stamp(MAX_COUNT, MAX_COUNT)
        beyond = len(encode(Message(mission, OPERATOR, stamp, edit))) - SMALL_LIMIT_BYTES
        if beyond > 0:
            corners = sum(map(len, rings))
            most = corners - math.ceil(beyond / _CORNER_BYTES)
            raise UnsoundZoneError(
                f"zone {self.zone} has {corners} corners, and a message has room for {most}",
                "leave some out, or make several zones of it",
            )

    def __str__(self) -> str:
        return f"add zone {self.zone}"

    def spec(self, origin: Origin | None) -> ZoneSpec:
        """The zone in the frame of the mission of that ``origin``, which metres do not need.

        Raises:
            UnsoundZoneError: a corner is too far away, or it is no zone.
        """
        polygon, *holes = (
            tuple(self._flat(corner, origin) for corner in ring)
            for ring in (self.polygon, *self.holes)
        )
        heights = self.floor_m, self.ceiling_m
        try:
            return ZoneSpec(self.zone, polygon, tuple(holes), *heights, self.inclusive)
        except ValueError as fault:
            problem = str(fault).partition(": [")[0]
            heights_meant = problem.startswith("ceiling_m")
            raise UnsoundZoneError(
                problem,
                "give a ceiling above the floor"
                if heights_meant
                else "give three corners or more, round a simple polygon",
            ) from fault

    def _require_place(self, corner: FlatPoint) -> None:
        first, second = corner
        if self.in_degrees:
            if not (abs(first) <= 89.0 and abs(second) <= 180.0):
                problem = f"{first:g},{second:g} is no latitude and longitude"
                raise UnsoundZoneError(problem, "give degrees within ±89 and ±180")
        elif not max(abs(first), abs(second)) <= FARTHEST_M:
            problem = f"corner {first:g},{second:g} is too far away"
            raise UnsoundZoneError(problem, f"give metres within ±{FARTHEST_M:g}")

    def _flat(self, corner: FlatPoint, origin: Origin | None) -> FlatPoint:
        if not self.in_degrees or origin is None:
            return corner
        east_m, north_m, _ = enu_from_wgs84(origin, *corner, origin.alt_m)
        if max(abs(east_m), abs(north_m)) > FARTHEST_M:
            where = f"{corner[0]:g},{corner[1]:g}"
            problem = f"{where} is more than {FARTHEST_M:g} m from the mission's origin"
            raise UnsoundZoneError(problem, "give corners near the mission")
        return east_m, north_m


@dataclass(frozen=True, slots=True)
class ZoneRemoval:
    """A zone to be taken away."""

    zone: str
    reason: str = ""

    def __str__(self) -> str:
        return f"remove zone {self.zone}"


class ZoneEditHandler(RequestHandler[NewZone | ZoneRemoval, ZoneEdit]):
    """One word about a zone, and what comes of it."""

    def body(self, brief: MissionConfig) -> ZoneEdit | RequestVerdict:
        """What to say; or why it cannot be said."""
        wish = self._wish
        if self._is_over:
            return RequestVerdict.bad("the mission has ended: nobody flies any more")
        known = {zone.id: zone for zone in zones_in_force(self._mission_state.replica)}
        if isinstance(wish, ZoneRemoval):
            if (zone := known.get(wish.zone)) is None:
                there = listed(sorted(known), 12) or "none"
                return RequestVerdict(RequestResult.UNKNOWN_ZONE, f"the zones are {there}")
            return ZoneEdit(zone, True, brief.run, wish.reason)
        if wish.zone in known and not wish.replaces:
            text = "give another id, or --replace to draw it anew"
            return RequestVerdict(RequestResult.TAKEN_ID, text)
        try:
            spec = wish.spec(Origin(*brief.origin))
        except UnsoundZoneError as fault:
            return RequestVerdict.bad(f"{fault}: {fault.remedy}")
        return ZoneEdit(spec, False, brief.run, wish.reason)

    def judge(self, said: Message, now_s: float, *, late: bool) -> RequestVerdict | None:
        """What has come of it by now; None as long as that is open, and it is not ``late``."""
        del now_s  # it is as good later
        edit, known = said.body, self._mission_state.replica.known(said)
        if not isinstance(edit, ZoneEdit) or known is None:
            return None
        if known.stamp != said.stamp:
            return RequestVerdict.bad(f"another operator has changed zone {edit.zone.id} meanwhile")
        silent = sorted(self._expected - self.known_to)
        if (silent or not self.known_to) and not late:
            return None
        if not self.known_to:
            text = f"nobody has confirmed it within {self._patience_s:g} s"
            return RequestVerdict.bad(f"zone {edit.zone.id}: {text}")
        done = "taken away" if edit.withdrawn else f"drawn{self._what_lies_in(edit.zone)}"
        text = f"zone {edit.zone.id} is {done}"
        if not silent:
            return RequestVerdict.good(text)
        # Who does not know of a zone, such as an agent of an older release, flies through it.
        have = "have" if len(silent) > 1 else "has"
        return RequestVerdict.bad(f"{text}; {', '.join(silent)} {have} not confirmed it")

    @property
    def told(self) -> dict[str, object]:
        """Its zone, and who has confirmed it."""
        return {"zone": self._wish.zone, "known_to": sorted(self.known_to)}

    def _what_lies_in(self, spec: ZoneSpec) -> str:
        """What nobody may fly to any more because of the zone, in words; empty if nothing."""
        mission = self._mission_state.board.mission
        if mission is None:
            return ""
        inside = _kept_from(spec, mission)
        if not inside:
            return ""
        verb = "lies" if len(inside) == 1 else "lie"
        where = "outside of it" if spec.inclusive else "in it or nearer than the margin"
        return f"; {listed(inside, _NAMES_TOLD)} {verb} {where}"


def _kept_from(spec: ZoneSpec, mission: Mission) -> list[str]:
    """Bases, starts and open tasks that the zone forbids, whatever its heights."""
    named = [
        *((f"base {base.id}", base.position_enu_m) for base in mission.bases),
        *((f"the start of {uav.id}", uav.position_enu_m) for uav in mission.uavs),
        *(
            (str(task.id), point)
            for task in mission.tasks
            for point in task.path_enu_m or (task.position_enu_m,)
        ),
    ]
    if not named:
        return []
    places_m = np.array([point[:2] for _, point in named], dtype=np.float64)
    from swarm.allocation.legs.obstacles import Obstacles  # only for zones: it starts slowly

    free = Obstacles([spec.zone()], mission.zone_margin_m).free(places_m)
    kept = [name for (name, _), may in zip(named, free.tolist(), strict=True) if not may]
    return list(dict.fromkeys(kept))
