"""Hypothesis strategies for everything that may be said on the bus."""

from __future__ import annotations

from typing import Any

from hypothesis import strategies as st

from swarm.model import Area, AreaId, Camera
from swarm.model.ids import COORDINATOR, FLEET, OPERATOR
from swarm.protocol.field_messages import AreaSpec, BaseSpec, UavReady, ZoneEdit, ZoneSpec
from swarm.protocol.fields import MAX_COUNT
from swarm.protocol.messages import (
    CommandKind,
    Message,
    MissionConfig,
    MissionPhase,
    OperatorCommand,
    PlanEpoch,
    Stamp,
    StartWithout,
    TaskEdit,
    TaskEntry,
    UavSpec,
)
from swarm.protocol.uav_messages import (
    MAX_CANDIDATES,
    MOST_CORNERS_AHEAD,
    AttemptResult,
    BaseStage,
    Calibration,
    Candidate,
    Choice,
    ChoiceBasis,
    Claim,
    ClaimPhase,
    Nearby,
    Outcome,
    Status,
    StatusPhase,
)
from tests.support.builders import MISSION

ids = st.from_regex(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,63}", fullmatch=True)
uav_ids = st.sampled_from(["u0", "u1", "u2", "quad-3"])
task_ids = st.sampled_from(["t0", "t1", "t2"])
numbers = st.floats(-1e6, 1e6)
positives = st.floats(1e-3, 1e6)
not_negatives = st.floats(0.0, 1e6)
probabilities = st.floats(0.0, 1.0)
points = st.tuples(numbers, numbers, numbers)
tables = st.dictionaries(ids, probabilities, max_size=3)
counts = st.integers(0, MAX_COUNT)
notes = st.text(max_size=20) | st.just("x" * 200)
stamps = st.builds(Stamp, counts, counts)

fleets = st.builds(
    UavSpec,
    uav_ids,
    points,
    positives,
    tables,
    tables,
    st.none() | ids,
    numbers,
    st.none() | positives,
    st.none() | st.floats(50.0, 1e6),
    st.none() | positives,
    probabilities,
    probabilities,
)
bases = st.builds(BaseSpec, ids, points, not_negatives, st.none() | st.integers(1, MAX_COUNT))
corners = st.tuples(numbers, numbers)


def _box(corner: tuple[float, float], size_m: float) -> tuple[tuple[float, float], ...]:
    east_m, north_m = corner
    return (corner, (east_m + size_m, north_m), (east_m + size_m, north_m + size_m))


rings = st.builds(_box, corners, st.floats(1.0, 1e6))
holed = st.tuples(
    st.just(((0.0, 0.0), (9.0, 0.0), (9.0, 9.0), (0.0, 9.0))),
    st.just((((1.0, 1.0), (2.0, 1.0), (2.0, 2.0)), ((5.0, 5.0), (6.0, 5.0), (6.0, 6.0)))),
)
zones = st.builds(
    lambda name, rings, *more: ZoneSpec(name, rings[0], rings[1], *more),
    ids,
    rings.map(lambda ring: (ring, ())) | holed,
    st.none() | st.floats(-1e6, 0.0),
    st.none() | st.floats(1.0, 1e6),
    st.booleans(),
)
cameras = st.builds(
    Camera,
    st.floats(1.0, 50.0),
    st.floats(1.0, 50.0),
    st.floats(1.0, 200.0),
    st.integers(1, 20_000),
    st.integers(1, 20_000),
    st.booleans(),
    st.floats(1e-6, 1.0),
)
spacings = st.fixed_dictionaries(
    {"spacing_m": st.floats(0.1, 1e3), "trigger_m": st.none() | st.floats(0.1, 1e3)}
) | st.fixed_dictionaries(
    {
        "camera": cameras,
        "height_m": st.floats(1.0, 500.0),
        "sidelap_frac": st.floats(0.0, 0.9),
        "frontlap_frac": st.floats(0.0, 0.9),
    }
)


def _area(
    name: str, rings: Any, spacing: dict[str, Any], lines: int, due_s: float | None
) -> AreaSpec:
    area = Area(AreaId(name), rings[0], 3.0, rings[1], lines=lines, due_s=due_s, **spacing)
    return AreaSpec.of(area)


areas = st.builds(
    _area,
    ids,
    rings.map(lambda ring: (ring, ())) | holed,
    spacings,
    st.integers(0, 200),
    st.none() | st.floats(0.0, 1e6),
)
origins = st.tuples(st.floats(-89, 89), st.floats(-180, 180), numbers)
briefs = st.builds(
    MissionConfig,
    positives,
    probabilities,
    probabilities,
    st.booleans(),
    counts,
    origins,
    st.lists(fleets, max_size=4, unique_by=lambda fleet: fleet.id).map(tuple),
    st.lists(bases, max_size=2, unique_by=lambda base: base.id).map(tuple),
    st.lists(zones, max_size=2, unique_by=lambda zone: zone.id).map(tuple),
    st.tuples(st.floats(-30.0, 30.0), st.floats(-30.0, 30.0)),
    not_negatives,
    st.none() | st.tuples(st.floats(0.0, 50.0), st.floats(51.0, 200.0)),
    st.lists(areas, max_size=2, unique_by=lambda area: area.id).map(tuple),
)
epochs = st.builds(
    PlanEpoch,
    counts,
    st.sampled_from(MissionPhase),
    st.sampled_from(["greedy", "lookahead"]),
    st.lists(uav_ids, unique=True).map(tuple),
    numbers,
    notes,
    st.dictionaries(uav_ids, st.lists(task_ids, unique=True, max_size=3).map(tuple), max_size=3),
    st.dictionaries(
        st.sampled_from(["due", "nobody can", "energy"]),
        st.lists(task_ids, unique=True, max_size=3).map(tuple),
        max_size=2,
    ),
)


@st.composite
def _of_tasks(draw: st.DrawFn, kind: type[TaskEntry | TaskEdit]) -> TaskEntry | TaskEdit:
    """What coordinator or operator says of a task, which may be a line or have limits."""
    place = draw(points)
    further = draw(st.lists(points, max_size=3))
    more = (draw(counts), draw(notes)) if kind is TaskEdit else ()
    return kind(
        draw(task_ids),
        draw(counts),
        place,
        draw(not_negatives),
        draw(not_negatives),
        draw(st.none() | ids),
        draw(st.booleans()),
        *more,
        due_s=draw(st.none() | not_negatives),
        opens_s=draw(st.just(0.0) | not_negatives),
        closes_s=draw(st.none() | not_negatives),
        path_enu_m=(place, *further) if further else (),
        height_m=draw(st.none() | numbers),
    )


boards = _of_tasks(TaskEntry)
_taken = st.sampled_from([ClaimPhase.PROPOSED, ClaimPhase.HELD])
_free = st.sampled_from([ClaimPhase.IDLE, ClaimPhase.PAUSED, ClaimPhase.OUT])
_on_the_ground = st.sampled_from([BaseStage.LANDED, BaseStage.PARKED])
_reversed = st.none() | st.booleans()
_maybe_s = st.none() | numbers
claims = st.one_of(
    st.builds(Claim, _taken, task_ids, numbers, counts, numbers),
    st.builds(Claim, _free, st.none(), numbers, counts, numbers),
    st.builds(
        Claim,
        _taken,
        st.none(),
        numbers,
        counts,
        numbers,
        base=ids,
        stage=st.sampled_from(BaseStage),
        arrives_s=_maybe_s,
        sortie_end_s=_maybe_s,
    ),
    st.builds(
        Claim,
        _taken,
        task_ids,
        numbers,
        counts,
        numbers,
        base=ids,
        stage=_on_the_ground,
        reversed=_reversed,
        departs_s=_maybe_s,
    ),
    st.builds(
        Claim,
        _free,
        st.none(),
        numbers,
        counts,
        numbers,
        base=ids,
        stage=_on_the_ground,
        arrives_s=_maybe_s,
        sortie_end_s=_maybe_s,
    ),
)
outcomes = st.builds(
    Outcome,
    task_ids,
    st.sampled_from(AttemptResult),
    st.integers(1, MAX_COUNT),
    numbers,
    reversed=_reversed,
)
statuses = st.builds(
    Status,
    st.sampled_from(StatusPhase),
    st.none() | task_ids,
    st.none() | points,
    st.none() | points,
    st.none() | probabilities,
    st.none() | numbers,
    st.dictionaries(st.sampled_from(["malformed", "stale", "too many"]), counts),
    notes,
)
scores = st.floats(-1e30, 1e30)
choices = st.builds(
    Choice,
    number=counts,
    task=task_ids,
    left=st.none() | task_ids,
    chosen_s=numbers,
    epoch=counts,
    rule=ids,
    rank=counts,
    score=scores,
    second_score=st.none() | scores,
    certificate=st.booleans(),
    completion_s=numbers,
    candidates=st.lists(
        st.builds(Candidate, task_ids, scores), max_size=MAX_CANDIDATES, unique_by=lambda c: c.task
    ).map(tuple),
    basis=st.builds(
        ChoiceBasis,
        decided_s=numbers,
        place_enu_m=points,
        patience_s=not_negatives,
        credible=st.lists(uav_ids, unique=True).map(tuple),
        awaited=st.lists(uav_ids, unique=True).map(tuple),
        excluded=st.lists(task_ids, unique=True).map(tuple),
        heads=st.dictionaries(uav_ids, st.tuples(counts, counts)),
        digest=counts,
        sortie_end_s=st.none() | numbers,
        landed_at=st.none() | ids,
        parked=st.booleans(),
        blocking=st.lists(st.tuples(uav_ids, ids)).map(tuple),
    ),
)
commands = st.one_of(
    st.builds(
        OperatorCommand,
        uav_ids,
        st.sampled_from([CommandKind.HOLD, CommandKind.RESUME, CommandKind.RETURN]),
        counts,
        notes,
    ),
    st.builds(OperatorCommand, st.just(FLEET), st.just(CommandKind.ABORT), counts, notes),
)
task_orders = _of_tasks(TaskEdit)
starts = st.builds(StartWithout, uav_ids, counts, notes)
zone_edits = st.builds(ZoneEdit, zones, st.booleans(), counts, notes)
readies = st.builds(UavReady, uav_ids, counts, notes)
calibrations = st.builds(
    Calibration,
    st.floats(1e-3, 1e3),
    st.floats(1e-3, 1e3),
    counts,
    acceleration_m_s2=st.none() | st.floats(1e-6, 1e6),
    speed_m_s=st.none() | st.floats(1e-6, 1e6),
)
by_coordinator = briefs | epochs | boards
nearbys = st.builds(
    Nearby,
    st.tuples(st.integers(-(2**31), 2**31), st.integers(-(2**31), 2**31)),
    st.booleans(),
    points,
    points,
    st.lists(points, max_size=MOST_CORNERS_AHEAD).map(tuple),
    st.floats(1e-6, 1e6),
    st.integers(0, 2),
    counts,
    st.integers(0, 255),
    st.none() | numbers,
)
by_uav = claims | outcomes | calibrations | statuses | choices | nearbys
by_operator = commands | task_orders | starts | zone_edits | readies


def messages(
    stamped: st.SearchStrategy[Stamp] = stamps, *, all_kinds: bool = True
) -> st.SearchStrategy[Message]:
    """Statements of the mission `MISSION`, each by a writer who may say it.

    Args:
        stamped: their stamps.
        all_kinds: also what is no register.
    """
    said = by_uav if all_kinds else claims | outcomes | calibrations
    return st.one_of(
        st.builds(Message, st.just(MISSION), st.just(COORDINATOR), stamped, by_coordinator),
        st.builds(Message, st.just(MISSION), uav_ids, stamped, said),
        st.builds(Message, st.just(MISSION), st.just(OPERATOR), stamped, by_operator),
    )
