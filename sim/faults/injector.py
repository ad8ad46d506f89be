"""Lets a schedule come true in a world, and knows when the world is calm again."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import partial

from coordinator.operator.requests import OperatorClient
from coordinator.operator.task_edits import NewTask, TaskWithdrawal
from coordinator.operator.zone_edits import ZoneRemoval
from sim.faults.drawn_zones import DrawnZone, zone_over
from sim.faults.field_judge import VehicleFlaw
from sim.faults.schedule import Disturbance, DisturbanceKind
from sim.world.engine import Process
from sim.world.rough_network import RoughNetwork
from sim.world.settings import RestartMemory
from sim.world.virtual_world import World
from swarm.protocol.fields import Point
from swarm.protocol.messages import CommandKind

_LEAVES_ALONE = (
    DisturbanceKind.CRASH,
    DisturbanceKind.HANG,
    DisturbanceKind.DEADLOCK,
    DisturbanceKind.HOLD,
)


class FaultInjector:
    """Plays one schedule in a world that has not begun."""

    def __init__(
        self, world: World, network: RoughNetwork, schedule: Iterable[Disturbance]
    ) -> None:
        self.held_for_good: set[Process] = set()
        """Processes that hang and never go on."""
        self.left_alone: set[str] = set()
        """UAVs whose agents were not always at work, or were stopped by the operator."""
        self.drawn: list[DrawnZone] = []
        """What the operator has drawn in flight, whoever knows of it."""
        self.flaws: list[VehicleFlaw] = []
        """Of vehicles that fly more slowly, or whose batteries drain faster."""
        self._world = world
        self._network = network
        self._disturbed_s = 0.0
        self._in_force = 0
        self._holds: Counter[Process] = Counter()
        self._stops: Counter[Process] = Counter()
        for disturbance in schedule:
            world.queue.at(disturbance.at_s, partial(self._begin, disturbance))

    @property
    def calm_for_s(self) -> float:
        """How long nothing has gone wrong that goes on or that has to be got over [s].

        Where messages are lost all the time it is never calm.
        """
        calm_s = self._world.queue.now_s() - self._disturbed_s
        return -math.inf if self._in_force or self._network.is_lossy else calm_s

    def _begin(self, what: Disturbance) -> None:
        world, network, names = self._world, self._network, what.names
        self._disturb()
        if what.kind in _LEAVES_ALONE:
            self.left_alone |= set(what.names)
        match what.kind:
            case DisturbanceKind.LOSE:
                world.lose(names[0])
            case DisturbanceKind.CRASH:
                world.crash(names[0])
                self._until(
                    what, partial(world.restart, names[0], what.memory or RestartMemory.NONE)
                )
            case DisturbanceKind.HANG | DisturbanceKind.DEADLOCK:
                self._hold(world.processes[names[0]], what)
            case DisturbanceKind.CUT:
                network.cut(names)
                self._until(what, partial(network.heal, names))
            case DisturbanceKind.UNPLUG:
                network.unplug(names[0])
                self._until(what, partial(network.plug, names[0]))
            case DisturbanceKind.MUTE:
                network.mute(*names)
                self._until(what, partial(network.unmute, *names))
            case DisturbanceKind.ROUTERS:
                network.routers_down()
                self._until(what, network.routers_up)
            case DisturbanceKind.BLINK:
                network.blink()
            case DisturbanceKind.WEATHER:
                network.worsen(what.amount or 0.0)
                self._until(what, partial(network.worsen, -(what.amount or 0.0)))
            case DisturbanceKind.SKEW:
                world.skew(names[0], what.amount or 0.0)
            case DisturbanceKind.SLOW:
                share = what.amount or 1.0
                self.flaws.append(VehicleFlaw(names[0], what.at_s, speed_frac=share))
                world.slow(names[0], share)
            case DisturbanceKind.REFUSE:
                refusal = names[0], names[1]
                world.refuses.add(refusal)
                self._until(what, partial(world.refuses.discard, refusal))
            case DisturbanceKind.WITHDRAW:
                world.withdraw(names[0])
            case DisturbanceKind.ADD:
                world.operate(NewTask(self._place(what.amount or 0.0)))
            case DisturbanceKind.RETRACT:
                world.operate(TaskWithdrawal(names[0]))
            case DisturbanceKind.HOLD:
                held = world.command(CommandKind.HOLD, names[0])
                self._until(what, partial(self._let_go_on, names[0], held))
            case DisturbanceKind.RETURN:
                world.command(CommandKind.RETURN, names[0])
            case DisturbanceKind.ABORT:
                world.command(CommandKind.ABORT)
            case DisturbanceKind.ZONE:
                self._draw_zone(what)
            case DisturbanceKind.DRAIN:
                drain_frac = 1.0 + (what.amount or 0.0)
                self.flaws.append(VehicleFlaw(names[0], what.at_s, drain_frac=drain_frac))
                world.drain(names[0], drain_frac)

    def _draw_zone(self, what: Disturbance) -> None:
        """Over a UAV; nowhere if it is not in the air, or too near to a start or a base."""
        number = len(self.drawn)
        wish = zone_over(self._world, what.names[0], what.amount or 0.0, f"drawn-{number}")
        if wish is None:
            return
        now_s = self._world.queue.now_s()
        self.drawn.append(DrawnZone(wish.spec(None).zone(), now_s))
        self._world.operate(wish)
        self._until(what, partial(self._remove_zone, number))

    def _remove_zone(self, number: int) -> None:
        drawn = self.drawn[number]
        self.drawn[number] = replace(drawn, until_s=self._world.queue.now_s())
        self._world.operate(ZoneRemoval(drawn.zone.id))

    def _place(self, along_frac: float) -> Point:
        """As far between the scenario's outermost places [m; mission origin]."""
        places = [task.position_enu_m for task in self._world.mission.tasks]
        corners = [(min(axis), max(axis)) for axis in zip(*places, strict=True)]
        east_m, north_m, up_m = (low + along_frac * (high - low) for low, high in corners)
        return east_m, north_m, up_m

    def _hold(self, process: Process, what: Disturbance) -> None:
        """Hold one life of a process; several holds end with the last of them."""
        stops = what.kind is DisturbanceKind.HANG
        if process.over:
            return
        self._holds[process] += 1
        self._stops[process] += stops
        process.held = True
        if stops and self._stops[process] == 1:
            self._network.stop(process)
        if what.lasts_s is None:
            self.held_for_good.add(process)
        self._until(what, partial(self._let_go, process, stops))

    def _let_go(self, process: Process, stops: bool) -> None:
        self._holds[process] -= 1
        self._stops[process] -= stops
        if process.over:
            return
        if stops and not self._stops[process]:
            self._network.cont(process)
        if not self._holds[process]:
            process.resume()

    def _let_go_on(self, uav: str, held: OperatorClient) -> None:
        """Nobody takes a command back before they know what came of it."""
        if held.verdict is None:
            self._world.queue.after(0.5, partial(self._let_go_on, uav, held))
        else:
            self._world.command(CommandKind.RESUME, uav)

    def _until(self, what: Disturbance, end: Callable[[], object]) -> None:
        if what.lasts_s is None:
            return
        self._in_force += 1

        def ends() -> None:
            self._in_force -= 1
            self._disturb()
            end()

        self._world.queue.after(what.lasts_s, ends)

    def _disturb(self) -> None:
        self._disturbed_s = self._world.queue.now_s()
