"""What reports and programs are told of the areas of a mission: lines, coverage, pictures."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import asdict

from coordinator.mission_view.results import ReportFact
from coordinator.mission_view.wording import counted
from swarm.model import Mission, TaskId
from swarm.survey.facts import AreaFacts, area_facts

ENOUGH_FRAC = 0.995
"""Less than this share covered is told as bad."""


def areas_as_json(
    mission: Mission, planned: Collection[TaskId], flown: Collection[TaskId] | None = None
) -> dict[str, object]:
    """The key ``areas``, ready for `json.dumps`; nothing where there are none."""
    if not mission.areas:
        return {}
    told = {}
    for facts in area_facts(mission, planned, flown):
        values = asdict(facts)
        told[values.pop("area")] = values
    return {"areas": told}


def areas_in_words(
    mission: Mission, planned: Collection[TaskId], flown: Collection[TaskId] | None = None
) -> Iterator[ReportFact]:
    """A line or two for each area; bad where less is covered than is enough.

    Of an area that appears later no plan covers anything.
    """
    for area, facts in zip(mission.areas, area_facts(mission, planned, flown), strict=True):
        share = facts.coverage_planned if flown is None else facts.coverage_flown
        unknown = flown is None and area.appears_s > 0.0
        bad = not unknown and (share or 0.0) < ENOUGH_FRAC
        lines, *more = facts_in_words(facts)
        yield ReportFact(f"area {facts.area}", lines, bad=bad)
        yield from (ReportFact("", words) for words in more)


def facts_in_words(facts: AreaFacts) -> list[str]:
    """One about lines and what they cover, and one about pictures where there are any."""
    lines = f"{_coverage_in_words(facts)}; {_lines_in_words(facts)}"
    pictures = _pictures_in_words(facts)
    return [lines, pictures] if pictures else [lines]


def _lines_in_words(facts: AreaFacts) -> str:
    """How many lines there are, how long, and how far apart."""
    return (
        f"{counted(facts.lines, 'line')}, {facts.length_m / 1000.0:.1f} km, "
        f"{facts.apart_m:.3g} m apart at most"
    )


def _coverage_in_words(facts: AreaFacts) -> str:
    """How much of what may be covered is."""
    planned = f"{100.0 * facts.coverage_planned:.2f} % of {facts.to_cover_m2 / 1e4:.1f} ha"
    if facts.coverage_flown is None:
        return f"covers {planned}"
    lines = f"{facts.lines_flown} of {counted(facts.lines, 'line')}"
    return (
        f"{100.0 * facts.coverage_flown:.2f} % covered by {lines}, "
        f"{100.0 * facts.coverage_planned:.2f} % planned"
    )


def _pictures_in_words(facts: AreaFacts) -> str:
    """How many pictures, how sharp, and how much of each is on the next; empty without any."""
    if facts.pictures is None or facts.picture_m is None:
        return ""
    every = "" if facts.every_s is None else f" ({facts.every_s:.2g} s)"
    words = f"{facts.pictures} pictures, one every {facts.picture_m:.3g} m{every}"
    if facts.ground_sample_m is not None and facts.blur_px is not None:
        words += f", {100.0 * facts.ground_sample_m:.2g} cm a pixel, blur {facts.blur_px:.2g} px"
    if facts.sidelap_frac is not None and facts.frontlap_frac is not None:
        side, front = 100.0 * facts.sidelap_frac, 100.0 * facts.frontlap_frac
        words += f", overlap {front:g} % ahead, {side:g} % aside"
    return words
