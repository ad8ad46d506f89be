"""What a bridge may say to its vehicle in each phase: commands, and messages about missions."""

from __future__ import annotations

from agent.vehicle.activity import FlightPhase
from tests.support.fake_copter import ARM, REPOSITION, SET_MODE, SPEED, SWITCH_FENCE, TAKEOFF

MISSION_MESSAGES = {
    "MISSION_COUNT",
    "MISSION_ITEM_INT",
    "MISSION_REQUEST_INT",
    "MISSION_REQUEST_LIST",
    "MISSION_ACK",
    "MISSION_SET_CURRENT",
    "MISSION_CLEAR_ALL",
}
MISSION_READING = {"MISSION_REQUEST_INT", "MISSION_REQUEST_LIST", "MISSION_ACK"}
WITHOUT_MISSION = {FlightPhase.IDLE, FlightPhase.RETURNING}
WAYPOINT = 16
COMMANDS: dict[FlightPhase, set[int]] = {
    FlightPhase.IDLE: {ARM, SWITCH_FENCE},
    FlightPhase.PREPARING: {SET_MODE, ARM, TAKEOFF, REPOSITION, SPEED, SWITCH_FENCE},
    FlightPhase.HOVERING: {REPOSITION, SPEED, SWITCH_FENCE},
    FlightPhase.FLYING: {REPOSITION, SPEED, SWITCH_FENCE},
    FlightPhase.YIELDING: {REPOSITION, SPEED, SWITCH_FENCE},
    FlightPhase.HOLDING: {SET_MODE, REPOSITION, SPEED, ARM, SWITCH_FENCE},
    FlightPhase.RETURNING: {SET_MODE, REPOSITION, SPEED, SWITCH_FENCE},
    FlightPhase.LANDING: {SET_MODE, REPOSITION, ARM, SWITCH_FENCE},
    FlightPhase.STANDING: set(),
    FlightPhase.HANDED_OVER: set(),
}
"""What may be commanded in each phase, beside requests for messages; motors are started
while preparing only."""
TRIGGER, LOOK_AT, LOOK_AHEAD = 206, 195, 197
IN_OUR_HANDS = COMMANDS.keys() - {FlightPhase.IDLE, FlightPhase.HANDED_OVER}
"""In which a camera may be told to take pictures, or none, and to look at nothing."""
COMMANDS_OF_MISSIONS: dict[FlightPhase, set[int]] = {
    FlightPhase.HOVERING: {SET_MODE, SPEED},
    FlightPhase.FLYING: {SET_MODE, SPEED},
}
"""What else, if targets are missions."""
LIMITS, GIVES_WAY = 222, 92
MISSION_ITEMS = {WAYPOINT, 20, SPEED, LIMITS, GIVES_WAY}
"""A place, and the speed, the time for targets and the way home around it."""
