"""Keeps one UAV's vehicle apart from others that it hears near it, whatever has been planned.

Stands between the core and the vehicle: it hears what the vehicle tells and what it is ordered,
says where the vehicle is to those in the cells of the sky around, hears them, and lets it give way
(swarm.separation.tactical). What the vehicle was ordered stays its order; it goes on by itself once
there is room. In a mission without a separation, and with vehicles of the simulator's ideal world,
nothing of this is met. Leaves out: what is planned so that it is not needed (agent.core.airway).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from agent.core.context import AgentContext, AgentPart
from agent.core.interface import (
    Arrived,
    Event,
    GiveWay,
    GoTo,
    Hold,
    Home,
    KeepOut,
    Landed,
    OrderVehicle,
    Prepare,
    Ready,
    Return,
    Swap,
    Telemetry,
    VehicleOrder,
)
from agent.core.room_aside import RoomAside
from agent.core.states import AgentState
from agent.core.take_off_turn import TakeOffTurn, who_is_in
from swarm.protocol.board import ranks
from swarm.protocol.events import Cell, MessageReceived, MessagesReceived, TuneIn
from swarm.protocol.fields import Point
from swarm.protocol.messages import Message, MissionConfig, PlanEpoch, Stamp
from swarm.protocol.timing import earliest
from swarm.protocol.uav_messages import MOST_CORNERS_AHEAD, Nearby
from swarm.separation.straight_pieces import off_piece_m
from swarm.separation.tactical import TacticalResolver
from swarm.separation.tactical_advice import Advice, Maneuver, OwnFlight
from swarm.separation.tactical_rules import cell_around, cell_m, cells_near, rules_of
from swarm.separation.tactical_traffic import (
    SILENT_S,
    Grade,
    Precedence,
    TrafficPicture,
    TrafficRules,
    TrafficWord,
)

BEACON_S = 1.0
"""Between two looks of a UAV that stands on the ground."""
_GROUNDED_S = 10.0
"""Between two words of a UAV that has been on the ground for so long, which nobody needs."""
_ALOFT_M = 1.0
"""Who is that far above where it started flies."""
_LIKELY_AGE_S = 0.2
"""Of a word, as long as nobody knows the mission's time."""
_EARLY = 0.2
"""Share of a tick by which it decides or says where it is too soon, if it takes a step anyway."""
_OLD_S = 10.0
"""Words that are older, or as far in the future, are somebody else's repeating."""
_FLOWN_M = 6.0
"""A corner of its way that near counts as flown; vehicles cut them."""
_STEERED = frozenset(
    {
        AgentState.IDLE,
        AgentState.FLYING,
        AgentState.SERVING,
        AgentState.FLYING_TO_BASE,
        AgentState.ABOVE_BASE,
        AgentState.RETURNING_VIA_START,
    }
)
"""In these its vehicle takes targets, and may be told to give way."""
_BY_ITSELF = GiveWay()
_GRADES = tuple(Grade)
"""By number; to make one of its number takes as long as all else of a word."""


class NearTraffic(AgentPart):
    """What one UAV does about others near it.

    Args:
        is_flown: whether the vehicle is one of those that are not quite where they are told.
    """

    def __init__(self, context: AgentContext, *, is_flown: bool) -> None:
        super().__init__(context)
        self._is_flown = is_flown
        self._turn = TakeOffTurn(context)
        self._room = RoomAside(context.replica)
        self.when_disturbed: Callable[[], None] = lambda: None
        """Is told when the vehicle no longer flies as it was ordered."""
        self._brief: MissionConfig | None = None
        self._fleet: frozenset[str] = frozenset()
        self._rules: TrafficRules | None = None
        self._resolver: TacticalResolver | None = None
        self._picture: TrafficPicture | None = None
        self._cell_m = 1.0
        self._ranked_by: tuple[MissionConfig | None, PlanEpoch | None] = None, None
        self._sequence_rank = self._rank_of(*self._ranked_by)
        self._telemetry: Telemetry | None = None
        self._way: tuple[Point, ...] = ()
        """Of the last order, from where the vehicle was on."""
        self._landed = self._leaves_ground = False
        self._is_let_go = False
        """It may take off, and is not in the air yet: others keep away as if it were."""
        self._held = False
        """Whether the last order was to stop it, or to bring it home or down at once."""
        self._told = _BY_ITSELF
        self._cells: frozenset[Cell] = frozenset()
        self._centre: Cell | None = None
        self._stamps: dict[str, Stamp] = {}
        self._ordered = False
        """Whether it was ordered something since the last decision."""
        self._waited_s: float | None = None
        """When it last waited for somebody before it took off or landed."""
        self._decide_at_s = -math.inf
        self._said_s = self._say_at_s = -math.inf
        self._pace_s = BEACON_S
        """Between two of its words, by its last decision."""
        self._said: tuple[object, ...] = ()
        """What of its last word changes only with what it is told to do."""
        self._turned_s = -math.inf
        """When it first said that it flies otherwise than before."""
        self._grounded_since_s: float | None = None
        """When it was first seen on the ground, since it was in the air last."""

    # -- what it hears ------------------------------------------------------------------

    def sense(self, event: Event) -> None:
        """What the vehicle says, before anybody else hears it; and others near it."""
        match event:
            case MessageReceived() | MessagesReceived():
                for message in event.messages:
                    if isinstance(message.body, Nearby):
                        self._hear(message, message.body, self._mission_view.now_s)
            case Telemetry():
                self._telemetry = event
            case Landed() | Home():
                self._landed, self._way = True, ()
            case Arrived() if self._told == _BY_ITSELF:
                self._way = self._way[-1:]
            case _:
                pass

    def _hear(self, message: Message, body: Nearby, now_s: float) -> None:
        """Another UAV says where it is."""
        writer, known = message.writer, self._stamps.get(message.writer)
        if (
            writer == self._uav
            or self._picture is None
            or (known is not None and message.stamp <= known)
            or writer not in self._fleet
        ):
            return
        age_s = self._age_s(body.said_s, now_s)
        if age_s is None:
            return
        self._stamps[writer] = message.stamp
        if not body.airborne:
            self._picture.forget(writer)
            return
        word = _word_of(body)
        if self._picture.hear(writer, word, now_s, age_s) and self._rules is not None:
            self._decide_at_s = min(self._decide_at_s, now_s + self._rules.tick_s)

    def _age_s(self, said_s: float | None, now_s: float) -> float | None:
        """How old a word is, as far as the time of the mission tells; None: not of now."""
        mission_s = self._mission_view.clock.mission_s(now_s)
        if said_s is None or mission_s is None:
            return _LIKELY_AGE_S
        age_s = mission_s - said_s
        return max(0.0, age_s) if abs(age_s) <= _OLD_S else None

    # -- what follows ---------------------------------------------------------------------

    def settle(self, now_s: float) -> None:
        """Heed what the vehicle is ordered in this step, decide, and say where it is, if due."""
        keeps_apart = self._heed_brief()
        for action in tuple(self._actions):
            if isinstance(action, OrderVehicle):
                self._heed(action.order)
                if keeps_apart:
                    self._await_turn(action.order)
        rules = self._rules
        if not keeps_apart or self._telemetry is None or rules is None:
            return
        # What is due soon is done now, and with it what is within a tick: each step costs as much.
        due_s = min(self._decide_at_s, self._say_at_s) - _EARLY * rules.tick_s
        if not (self._ordered or now_s >= due_s):
            return
        own, aloft = self._own(self._telemetry), self._is_aloft(self._telemetry)
        self._is_let_go &= not aloft
        self._tune_in(own.position_enu_m)
        if self._ordered or now_s + rules.tick_s >= self._decide_at_s:
            self._decide_at_s = now_s + BEACON_S
            self._take_turn(own, now_s)
            if aloft:
                self._decide(own, now_s)
            else:
                self._pace_s = BEACON_S
        self._ordered = False
        self._tell(own, aloft=aloft or self._is_let_go, now_s=now_s)

    def next_deadline_s(self) -> float | None:
        """When `settle` will next have something to do."""
        if self._rules is None or self._telemetry is None or not self._machine.acts:
            return None
        return earliest(self._decide_at_s, self._say_at_s)

    def _heed(self, order: VehicleOrder) -> None:
        place = () if self._telemetry is None else (self._telemetry.position_enu_m,)
        match order:
            case GoTo(position_enu_m=end, via_enu_m=via):
                self._leaves_ground = self._landed
                self._way, self._held, self._landed = (*place, *via, end), False, False
            case Return(via_enu_m=None):
                home = () if (me := self._mission_view.me) is None else (me.position_enu_m,)
                self._way, self._held, self._told = (*place, *home), True, _BY_ITSELF
            case Return(via_enu_m=end, path_enu_m=via, land=land) if end is not None:
                me = self._mission_view.me
                down = () if me is None or not land else ((*end[:2], me.position_enu_m[2]),)
                self._way, self._held = (*place, *via, end, *down), False
            case Prepare(position_enu_m=end) | Swap(position_enu_m=end):
                self._way, self._held, self._told = (*place, end), True, _BY_ITSELF
                self._landed &= isinstance(order, Swap)
            case Hold():
                self._way, self._held, self._told = place, True, _BY_ITSELF
            case Ready() | KeepOut() | GiveWay():
                return
        self._ordered = True

    def _await_turn(self, order: VehicleOrder) -> None:
        """Let a vehicle that is about to take off wait until nobody is before or above it."""
        match order:
            case Prepare(position_enu_m=top, resume=False):
                self._turn.begin(top, first=True)
            case GoTo(position_enu_m=end, via_enu_m=via) if self._leaves_ground:
                self._turn.begin((*via, end)[0], first=False)
            case Prepare() | Hold() | Return() | Swap():
                self._turn.end()
                self._is_let_go = False
                return
            case _:
                return
        self._actions.append(OrderVehicle(GiveWay(stands=True)))

    def _take_turn(self, own: OwnFlight, now_s: float) -> None:
        rules, picture = self._rules, self._picture
        if not self._turn.is_awaited or rules is None or picture is None:
            return
        before = self._turn.goes_before(own.position_enu_m, picture, rules, now_s)
        self._blame(before, picture, now_s)
        if before is not None:
            self._announcer.explain(f"waits for {before} before it takes off")
            return
        self._turn.end()
        self._is_let_go = True
        self._actions.append(OrderVehicle(_BY_ITSELF))

    def _blame(self, uav: str | None, picture: TrafficPicture, now_s: float) -> None:
        """It waits on the ground or above its start for that one; None: for nobody."""
        if uav is not None and self._waited_s is not None:
            picture.blame(uav, now_s, min(now_s - self._waited_s, 2.0 * BEACON_S))
        self._waited_s = None if uav is None else now_s

    def _heed_brief(self) -> bool:
        """Whether there is a distance to keep."""
        brief = self._replica.brief
        if brief is not self._brief:
            self._brief = brief
            self._fleet = frozenset(() if brief is None else (uav.id for uav in brief.uavs))
            rules = None if brief is None or not self._is_flown else rules_of(brief)
            if rules != self._rules:
                self._rules = rules
                self._cell_m = 1.0 if rules is None else cell_m(rules)
                self._resolver = self._picture = None
                if rules is not None:
                    self._resolver = TacticalResolver(self._uav, rules, self._room.is_clear)
                    self._picture = TrafficPicture(rules, 0.9 * self._cell_m)
        return self._rules is not None and self._mission_view.me is not None

    # -- its own flight -----------------------------------------------------------------

    def _is_aloft(self, telemetry: Telemetry) -> bool:
        me = self._mission_view.me
        if self._landed or me is None or self._mission_view.stands:
            return False
        return telemetry.position_enu_m[2] > me.position_enu_m[2] + _ALOFT_M

    def _own(self, telemetry: Telemetry) -> OwnFlight:
        me, state = self._mission_view.me, self._machine.state
        path = self._ahead(telemetry.position_enu_m)
        steered = state in _STEERED and not self._held
        if state is AgentState.RETURNING_VIA_START and _comes_down(telemetry, path):
            steered = False
        serves = state is AgentState.SERVING and not path
        if not steered or serves:
            grade = Grade.BOUND
        else:
            free = state is AgentState.IDLE and not path
            grade = Grade.FREE if free else Grade.FLYING
        return OwnFlight(
            telemetry.position_enu_m,
            telemetry.velocity_enu_m_s,
            path,
            1.0 if me is None else me.speed_m_s,
            Precedence(grade, self._rank(telemetry)),
            steered and not serves,
        )

    def _rank(self, telemetry: Telemetry) -> int:
        """Among those of its grade; of those on their way home the lowest lands first."""
        if self._machine.state is AgentState.RETURNING_VIA_START:
            return max(0, round(telemetry.position_enu_m[2]))
        ranked_by = self._replica.brief, self._replica.epoch
        if self._ranked_by != ranked_by:
            self._ranked_by, self._sequence_rank = ranked_by, self._rank_of(*ranked_by)
        return self._sequence_rank

    def _rank_of(self, brief: MissionConfig | None, epoch: PlanEpoch | None) -> int:
        fleet = [] if brief is None else [uav.id for uav in brief.uavs]
        by_place = fleet.index(self._uav) if self._uav in fleet else len(fleet)
        return by_place if epoch is None else ranks(epoch.sequence, fleet).get(self._uav, by_place)

    def _ahead(self, place: Point) -> tuple[Point, ...]:
        """What is left of its way."""
        way = self._way
        while len(way) > 2 and _is_past(place, way):
            way = way[1:]
        self._way = way
        if len(way) < 2 or math.dist(place, way[-1]) < _STANDS_M:
            return ()
        return way[1:]

    def _decide(self, own: OwnFlight, now_s: float) -> None:
        rules, resolver, picture = self._rules, self._resolver, self._picture
        if rules is None or resolver is None or picture is None:
            return
        before, advice = resolver.advice, resolver.decide(own, picture, now_s)
        self._pace_s = resolver.pace_s(own, picture, now_s)
        self._decide_at_s = now_s + min(self._pace_s, rules.beacon_s / 2.0)
        self._say_at_s = min(self._say_at_s, self._said_s + self._pace_s)
        if not own.gives_way:
            return
        wanted = _order_of(advice)
        if wanted == _BY_ITSELF and self._awaits_landing(own, picture, rules, now_s):
            wanted = GiveWay(stands=True)
        if wanted != self._told:
            if self._told == _BY_ITSELF:
                self.when_disturbed()
            self._told = wanted
            self._actions.append(OrderVehicle(wanted))
        if (advice.maneuver, advice.braked) != (before.maneuver, before.braked):
            self._explain(advice)

    def _awaits_landing(
        self, own: OwnFlight, picture: TrafficPicture, rules: TrafficRules, now_s: float
    ) -> bool:
        """Whether it waits, at its start, for those below it to land before."""
        path, place = own.path_enu_m, own.position_enu_m
        homebound = self._machine.state is AgentState.RETURNING_VIA_START and len(path) in (1, 2)
        if not homebound or math.dist(place[:2], path[-1][:2]) > _NEAR_HOME_M:
            return False
        above = (*path[-1][:2], max(each[2] for each in (place, *path)))
        below = who_is_in(above, path[-1][2], picture, rules, now_s)
        self._blame(below, picture, now_s)
        return below is not None

    def _explain(self, advice: Advice) -> None:
        if advice.maneuver is Maneuver.KEEP and not advice.braked:
            self._log("goes on: there is room again")
        else:
            what = "brakes" if advice.braked else advice.maneuver.value
            self._log("gives way", to=advice.because_of, by=what)

    # -- what it says -------------------------------------------------------------------

    def _tune_in(self, place: Point) -> None:
        """Hear those in the cells around, which are left with hysteresis."""
        self._centre = cell_around(place, self._cell_m, self._centre)
        cells = cells_near(self._centre)
        if cells != self._cells:
            self._cells = cells
            self._actions.append(TuneIn(cells))

    def _tell(self, own: OwnFlight, *, aloft: bool, now_s: float) -> None:
        """Say where it is: at the pace of its last decision, and of a turn as often as it may take
        to be heard: words get lost, and others count on that one of them is not (`SILENT_S`)."""
        resolver, rules = self._resolver, self._rules
        if resolver is None or rules is None:
            return
        word = resolver.word(own)
        said = aloft, word.path_enu_m, word.speed_m_s, word.precedence
        turns = said[:-1] != self._said[:-1]
        if said != self._said:
            self._say_at_s = min(self._say_at_s, self._said_s + rules.tick_s)
        if now_s + rules.tick_s < self._say_at_s:
            return
        if aloft:
            self._grounded_since_s = None
        elif self._grounded_since_s is None:
            self._grounded_since_s = now_s
        since_s = self._grounded_since_s
        is_long = since_s is not None and now_s - since_s >= _GROUNDED_S
        self._turned_s = now_s if turns and aloft else self._turned_s
        pace_s = rules.tick_s if aloft and now_s - self._turned_s < SILENT_S else self._pace_s
        self._said, self._said_s = said, now_s
        self._say_at_s = now_s + (_GROUNDED_S if is_long else pace_s)
        place = word.position_enu_m
        self._say(
            Nearby(
                (math.floor(place[0] / self._cell_m), math.floor(place[1] / self._cell_m)),
                aloft,
                place,
                word.velocity_enu_m_s,
                word.path_enu_m[:MOST_CORNERS_AHEAD],
                word.speed_m_s,
                int(word.precedence.grade),
                word.precedence.rank,
                word.precedence.depth,
                self._mission_view.clock.mission_s(now_s),
            )
        )


_MOST_WORDS = 4096
_words: dict[int, tuple[Nearby, TrafficWord]] = {}
"""By identity: agents of one process hear the very same, and each word is made once for them."""


def _word_of(body: Nearby) -> TrafficWord:
    kept = _words.get(id(body))
    if kept is not None and kept[0] is body:
        return kept[1]
    if len(_words) >= _MOST_WORDS:
        _words.clear()
    precedence = Precedence(_GRADES[body.grade], body.rank, body.depth)
    flown = body.position_enu_m, body.velocity_enu_m_s, body.path_enu_m, body.speed_m_s
    word = TrafficWord(*flown, precedence)
    _words[id(body)] = body, word
    return word


_NEAR_HOME_M = 25.0
"""Who is to wait before it lands does so from here on [m]."""
_DESCENT_M_S = 0.3
_ABOVE_M = 4.0


def _comes_down(telemetry: Telemetry, path: Sequence[Point]) -> bool:
    """Whether all that is left of its way home is to land, and it has begun."""
    place = telemetry.position_enu_m
    is_above = len(path) == 1 and math.dist(place[:2], path[0][:2]) <= _ABOVE_M
    return is_above and telemetry.velocity_enu_m_s[2] <= -_DESCENT_M_S


_STANDS_M = 2.0
"""Who is that near the end of its way has no way left."""


def _is_past(place: Point, way: Sequence[Point]) -> bool:
    """Whether the first piece of a way is behind a UAV there, which cuts corners."""
    here, corner, after = way[0], way[1], way[2]
    if math.dist(place, corner) <= _FLOWN_M:
        return True
    return off_piece_m(place, corner, after) + 1.0 < off_piece_m(place, here, corner)


def _order_of(advice: Advice) -> GiveWay:
    """What the vehicle is told."""
    if advice.stands:
        return GiveWay(stands=True)
    return GiveWay(advice.path_enu_m, speed_m_s=advice.speed_m_s)
