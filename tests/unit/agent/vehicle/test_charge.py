"""One charge of all that a vehicle says of its batteries."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from agent.vehicle.charge import ChargeMeter
from agent.vehicle.messages import BatteryStatus, Heartbeat, SystemStatus
from agent.vehicle.state import VehicleState


def flying() -> VehicleState:
    state = VehicleState()
    state.on_message(Heartbeat(2, 3, True, 4, 4), 0.0)
    return state


def heard(state: VehicleState, at_s: float, *batteries: float | None, system: float | None) -> None:
    """SYS_STATUS, then BATTERY_STATUS of each battery."""
    state.on_message(SystemStatus(True, True, system), at_s)
    for number, frac in enumerate(batteries):
        state.on_message(BatteryStatus(frac, number), at_s)


def test_nothing_told_or_only_that_it_is_unknown_is_no_charge() -> None:
    state = flying()
    assert state.charge.frac is None
    heard(state, 1.0, None, None, system=None)
    assert state.charge.frac is None


def test_sys_status_counts_where_no_battery_tells_and_takes_nothing_back_that_one_tells() -> None:
    state = flying()
    heard(state, 1.0, system=0.8)
    assert state.charge.frac == 0.8
    heard(state, 2.0, 0.7, system=0.8)
    assert state.charge.frac == 0.7
    state.on_message(SystemStatus(True, True, None), 2.5)
    assert state.charge.frac == 0.7


def test_the_lowest_battery_that_lifts_counts() -> None:
    state = flying()
    heard(state, 1.0, 0.9, 0.6, 0.8, system=0.9)
    state.on_message(BatteryStatus(0.05, 3, lifts=False), 1.0)
    assert state.charge.frac == 0.6


def test_a_battery_that_drops_out_in_the_air_takes_no_charge_with_it() -> None:
    """The other one tells more: what counts goes on from where it was, and falls with it."""
    for says_unknown in (True, False):
        state = flying()
        heard(state, 0.0, 0.8, 0.5, system=0.8)
        for at_s in range(1, 31):
            frac = 0.8 - 0.01 * at_s
            lost = (None,) if says_unknown else ()
            heard(state, float(at_s), frac, *lost, system=frac)
        assert state.charge.frac is not None
        since_s = 30 if says_unknown else 30 - 10
        assert abs(state.charge.frac - (0.5 - 0.01 * since_s)) < 0.011

        heard(state, 31.0, 0.49, 0.45, system=0.49)
        assert state.charge.frac == min(0.45, state.charge.frac)


def test_on_the_ground_what_is_told_is_believed_be_it_more() -> None:
    state = flying()
    heard(state, 0.0, 0.8, 0.2, system=0.2)
    state.on_message(Heartbeat(2, 3, False, 4, 3), 1.0)
    heard(state, 2.0, 0.99, 0.98, system=0.99)
    assert state.charge.frac == 0.98


def test_one_battery_that_jumps_up_on_the_ground_while_another_has_gone_is_full() -> None:
    meter = ChargeMeter()
    meter.on_battery(0, 0.3, 0.0, armed=True)
    meter.on_battery(1, 0.2, 0.0, armed=True)
    for at_s in range(1, 12):
        meter.on_battery(0, 0.97, float(at_s), armed=False)
    assert (meter.frac, meter.told_at_s) == (0.97, 11.0)


words = st.tuples(
    st.integers(-1, 2),
    st.one_of(st.none(), st.floats(0.0, 1.0)),
    st.floats(0.0, 15.0),
)


@given(st.lists(words, max_size=40))
def test_it_tells_no_more_than_somebody_told_and_never_more_because_somebody_fell_silent(
    said: list[tuple[int, float | None, float]],
) -> None:
    meter, now_s = ChargeMeter(), 0.0
    last: dict[int, float] = {}
    for number, frac, gap_s in said:
        before, now_s = meter.frac, now_s + gap_s
        if number < 0:
            meter.on_system(frac, now_s, armed=True)
        else:
            meter.on_battery(number, frac, now_s, armed=True)
        rises = frac is not None and frac > last.get(number, 1.0)
        if frac is not None:
            last[number] = frac
        if meter.frac is None:
            continue
        assert 0.0 <= meter.frac <= max(last.values())
        if before is not None and not rises:
            assert meter.frac <= before + 1e-9
