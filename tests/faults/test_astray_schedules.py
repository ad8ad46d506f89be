"""Missions with positions that are off and losses all along, and everything that goes wrong."""

from __future__ import annotations

import pytest

from sim.faults.case import play
from sim.faults.generator import random_case

BROKEN_ONCE = {
    5001693: "an agent that began anew counted twice how fast its battery drains",
    5001206: "an agent that began anew counted again what its earlier life knew, but had not told",
    5001560: "who was in a new zone waited for a long way, and landed there beside a free way out",
    5000176: "the judge asked for a slot's holder to be known that was cut off before it came",
    5002105: "who did not know enough to decide stayed in a new zone until it did",
    5000996: "who waited for a way set off on it when its battery did not last any more",
    5003744: "a sortie was counted from when it was to take off, not from when its way was free",
    5003806: "who stood beside the slots said that it stood on one when its way was refused",
    5003941: "slow legs cost a UAV all of the time that it then spent in a hover as well",
    5004105: "who had been held on its way, and found nothing to do, made room for nobody",
    5006078: "an agent that hung told the end of its service when it woke",
    5004270: "the judge allowed no climb on the way out of a zone",
    5005804: "the judge allowed no time for a way out of a zone to be granted",
    5010244: "the judge took the height of a task for one above the layers",
    6003017: "who waited for its way home after the mission had ended looked at its charge no more",
    7000079: "a fast drain was measured only after a way that was as long as that takes",
    7000213: "a coordinator begun anew forgot what the operator had said before the start",
    9002971: "an agent begun anew while its vehicle landed at home stopped it there, on the ground",
    9003249: "who flew to its base stopped for a zone that was taken away",
    9004022: "who lost its task right after take-off was stopped where it had stood, underground",
    9700274: "a sortie was counted from when it asked for its way up if that became a longer one",
    11001244: "the judge took a zone for gone of which the coordinator had not heard that it is",
    11002437: "who waited for its way home took its reserve for what lasts as long as planned",
    11004872: "who hovered above its start for a mission that never began looked at no charge",
    11005429: "who was sent on to its base, as a zone was drawn elsewhere, began anew at rest",
    11005759: "who turned back for a drain on each short flight decided for the same task for ever",
    11006086: "who hovered above its home in another layer went home through the one between",
    13000758: "who could not come home any more went on asking for its way, and set off on it",
    15000239: "who was told to fly home on its way out of a zone stopped in it to ask for that",
    18001175: "the judge bound one on the ground to its task though a zone changed its way there",
    21000517: "who set off from a task's own height was led twice as high if it turned at once",
    22001564: "who was sent home before its mission began waited until its battery was empty",
    22006210: "who was begun anew, and knew of no mission, waited for its way home for ever",
    29000688: "two bases less than a metre apart were one to the log of flights",
    29001620: "the judge took who was astray near the border of a new zone to have left it",
    27000101: "who had left its slot told so, and then that it held it all along",
    29003951: "who had left its slot to others told that it held it when it asked for its way up",
    28003719: "who waited for its way and was begun anew took it for its own",
    24000293: "who turned back for its battery set off for the same line again and again",
    30004993: "who turned back for its battery set off for the same task again and again",
    30006611: "who was begun anew during a cut was told by nobody what it had claimed",
    5000447: "who decided anew in a new zone waited there anew before it landed",
}


@pytest.mark.parametrize("seed", BROKEN_ONCE)
def test_what_broke_once_holds(seed: int) -> None:
    done = play(random_case(seed))
    assert done.broken is None, f"{seed}: {done.broken}"
