"""What Prometheus is told, read from what is known whenever it asks.

Names begin with ``peckorder_`` and end in their unit; of the process itself there are the usual
``process_…``.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence

from prometheus_client import CollectorRegistry, ProcessCollector
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily
from prometheus_client.exposition import choose_encoder
from prometheus_client.metrics_core import Metric
from prometheus_client.registry import Collector

from coordinator.dashboard.hub import Hub
from coordinator.dashboard.source import DashboardSource
from coordinator.mission_view.mission_state import MissionState
from coordinator.mission_view.uav_state import LOST, FleetStates
from swarm.model.ids import COORDINATOR
from swarm.protocol.board import TaskState
from swarm.protocol.messages import MissionConfig, MissionPhase

Samples = Iterable[tuple[Sequence[str], float]]
"""Values of labels, and of the metric."""


def _gauge(name: str, text: str, labels: Sequence[str], samples: Samples) -> Metric:
    return _filled(GaugeMetricFamily(f"peckorder_{name}", text, labels=labels), samples)


def _counter(name: str, text: str, labels: Sequence[str], samples: Samples) -> Metric:
    return _filled(CounterMetricFamily(f"peckorder_{name}", text, labels=labels), samples)


def _filled(family: GaugeMetricFamily | CounterMetricFamily, samples: Samples) -> Metric:
    for values, number in samples:
        family.add_metric(values, number)
    return family


class Metrics(Collector):
    """The metrics of one dashboard: read, when asked, from what is known and who looks on."""

    def __init__(self, source: DashboardSource, hub: Hub) -> None:
        self._source = source
        self._hub = hub
        self._registry = CollectorRegistry(auto_describe=False)
        self._registry.register(self)
        ProcessCollector(registry=self._registry)

    def page(self, accept: str) -> tuple[bytes, str]:
        """What to answer, and its content type, to somebody who accepts that."""
        encode, content_type = choose_encoder(accept)
        return encode(self._registry), content_type

    def collect(self) -> Iterator[Metric]:
        """All metrics, as they are now."""
        source = self._source
        clients = [((), self._hub.clients)]
        yield _gauge("dashboard_clients", "Pages that follow the feed.", (), clients)
        yield _gauge(
            "link_up", "Whether this process is linked to the bus.", (), [((), source.link)]
        )
        yield _counter(
            "dashboard_dropped_messages",
            "Messages this process has dropped, by reason.",
            ("reason",),
            (((reason,), number) for reason, number in sorted(source.dropped.items())),
        )
        given = Counter(
            (row.text.partition(" ")[0], row.state.value.replace(" ", "_"))
            for row in source.commands
        )
        yield _gauge(
            "operator_commands",
            "Commands and tasks given here, by what has come of them.",
            ("command", "state"),
            sorted(given.items()),
        )
        mission_state = source.mission_state
        brief = None if mission_state is None else mission_state.replica.brief
        if mission_state is not None and brief is not None:
            yield from self._of_mission(mission_state)
            yield from self._of_uavs(mission_state, brief)

    def _of_mission(self, mission_state: MissionState) -> Iterator[Metric]:
        mission, epoch = mission_state.mission.name, mission_state.replica.epoch
        progress, measure = self._hub.feed.progress, self._hub.feed.measure

        def gauge(name: str, text: str, value: float | None) -> Metric:
            return _gauge(name, text, ("mission",), () if value is None else [((mission,), value)])

        def by(label: str, values: Iterable[tuple[str, float]]) -> tuple[tuple[str, str], Samples]:
            return ("mission", label), [((mission, name), value) for name, value in values]

        mission_s = mission_state.mission_s(self._source.now_s())
        yield gauge("mission_time_seconds", "Mission time; from 0 at the start.", mission_s)
        phases = by("phase", ((phase, mission_state.phase is phase) for phase in MissionPhase))
        yield _gauge("mission_phase", "1 for the phase it is in.", *phases)
        objective = 0.0 if progress is None else progress.objective
        yield gauge("objective_value_seconds", "J of the tasks done so far.", objective)
        planned = None if measure is None else measure.objective
        yield gauge("plan_objective_value_seconds", "J of the first epoch's lists.", planned)
        bound = None if measure is None else measure.bound
        yield gauge("objective_bound_value_seconds", "Upper bound on J of any lists.", bound)
        number = None if epoch is None else epoch.number
        yield gauge("epoch", "Number of the epoch in force.", number)
        there = COORDINATOR in mission_state.present
        yield gauge("coordinator_present", "Whether there is a coordinator.", there)
        states = Counter(mission_state.board.states.values())
        tasks = by("state", ((state, states[state]) for state in TaskState))
        yield _gauge("tasks", "Tasks on the board, by state.", *tasks)
        reasons = Counter(mission_state.left_out.values())
        text = "Open tasks that the plan leaves out, by why."
        yield _gauge("tasks_left_out", text, *by("reason", sorted(reasons.items())))

    def _of_uavs(self, mission_state: MissionState, brief: MissionConfig) -> Iterator[Metric]:
        progress, speedup = self._hub.feed.progress, self._source.speedup
        done = {} if progress is None else {uav: len(t) for uav, t in progress.flown.items()}
        mission, states = (
            mission_state.mission.name,
            FleetStates(mission_state, self._source.now_s()),
        )
        fleet = [((mission, uav.id), states.of(uav.id)) for uav in brief.uavs]
        labels = ("mission", "uav")
        present = [(names, state.there) for names, state in fleet]
        yield _gauge("uav_present", "Whether its agent is there.", labels, present)
        lost = [(names, state.does == LOST) for names, state in fleet]
        yield _gauge("uav_lost", "Whether it disappeared while it took part.", labels, lost)
        does = [
            ((*names, state.does), 1.0)
            for names, state in fleet
            if state.there or state.does == LOST
        ]
        yield _gauge("uav_phase", "1 for what it does.", (*labels, "phase"), does)
        charge = [(n, s.battery_frac) for n, s in fleet if s.battery_frac is not None]
        yield _gauge("uav_battery_ratio", "Charge left, from 0 to 1.", labels, charge)
        silent = [(n, s.link_age_s / speedup) for n, s in fleet if s.link_age_s is not None]
        yield _gauge("uav_silence_seconds", "Since its agent last said something.", labels, silent)
        ended = [(names, done.get(names[1], 0)) for names, _ in fleet]
        yield _counter("uav_tasks_done", "Tasks it has done.", labels, ended)
        dropped = [
            ((mission, uav, reason), number)
            for uav, reasons in sorted(mission_state.dropped.items())
            for reason, number in sorted(reasons.items())
        ]
        text = "Messages its agents have dropped, by reason."
        yield _counter("uav_dropped_messages", text, (*labels, "reason"), dropped)
