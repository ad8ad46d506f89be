"""Placemarks of KML (``.kml``), and of KMZ, which is KML in a zip archive.

Format: OGC 07-147r2, KML 2.2. Points, lines and polygons with their holes, also several of them in
a MultiGeometry; names become ids, ExtendedData properties as those of GeoJSON. Heights count where
altitudeMode is absolute (above mean sea level) or relativeToGround, and are passed over where the
shape lies on the ground, which is the default.

The parser is fed the file as it comes and keeps nothing but placemarks. A file that declares
entities is refused, so none can be expanded. Leaves out: styles, overlays, tours, tracks of
gx:Track, and links to other files, which are never followed.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from xml.parsers import expat

from swarm.runtime.errors import Fault, InputError
from swarm.scenario.findings import printable, shown
from swarm.scenario.task_files.archive import member_of
from swarm.scenario.task_files.features import (
    Feature,
    FeatureReader,
    Form,
    Place,
    Shape,
    place_of,
)
from swarm.scenario.task_files.mission_items import above_ground
from swarm.scenario.task_files.task_file import (
    MOST_ENTRIES,
    MOST_POINTS,
    FileEntry,
    ReadOptions,
    TaskFile,
    gather,
    spelt_number,
)

_WHAT = "a KML file as Google Earth saves it"
_DEEPEST = 100
"""Elements nested deeper are refused; folders of people are not ten deep."""
_LONGEST_NAME = 1000
_SHAPES = {form.value: form for form in Form} | {"LinearRing": Form.POLYGON}
_LEFT_OUT = ("Track", "MultiTrack", "Model", "GroundOverlay", "NetworkLink", "Tour")
_FOLDERS = ("Document", "Folder")
_ON_GROUND = ("", "clampToGround", "clampToSeaFloor")
_ABOVE_GROUND = ("relativeToGround", "relativeToSeaFloor")


def read_kml(data: bytes, request: ReadOptions) -> TaskFile:
    """What the placemarks of a KML file are.

    Raises:
        InputError: with every fault of the file.
    """
    reading = _KmlElements(request)
    parser = expat.ParserCreate()
    parser.buffer_text = True
    parser.StartElementHandler = reading.start
    parser.EndElementHandler = reading.end
    parser.CharacterDataHandler = reading.text
    parser.StartDoctypeDeclHandler = reading.doctype
    reading.line_of = lambda: parser.CurrentLineNumber
    try:
        parser.Parse(data, True)
    except expat.ExpatError as error:
        place = f"line {error.lineno}, column {error.offset + 1}"
        problem = f"is not XML: {printable(expat.ErrorString(error.code))}"
        raise InputError(Fault(request.source, place, problem, f"give {_WHAT}")) from error
    except (LookupError, ValueError) as error:  # an encoding that nobody knows
        problem = f"is not XML: {printable(str(error))}"
        raise InputError(Fault(request.source, "line 1", problem, f"give {_WHAT}")) from error
    if not reading.is_kml:
        raise InputError(Fault(request.source, "", "is not KML", f"give {_WHAT}"))
    return gather(
        request,
        reading.found,
        "add placemarks with points, paths or polygons",
        home=request.home,
        left_out=reading.reader.left_out + reading.left_out,
    )


def read_kmz(data: bytes, request: ReadOptions) -> TaskFile:
    """What the placemarks of the first KML file in an archive are.

    Raises:
        InputError: with every fault of the file.
    """
    return read_kml(member_of(data, ".kml", request.source), request)


@dataclass(slots=True)
class _Geometry:
    """A shape as far as it has been read."""

    form: Form
    mode: str = ""
    rings: list[list[Place]] = field(default_factory=list)


@dataclass(slots=True)
class _Placemark:
    """A placemark as far as it has been read."""

    line: int
    name: str = ""
    data: dict[str, object] = field(default_factory=dict)
    shapes: list[_Geometry] = field(default_factory=list)
    problem: tuple[str, str] | None = None
    """The first thing that is wrong with it, and what would be right."""

    @property
    def place(self) -> str:
        name = f" {shown(self.name)}" if self.name else ""
        return f"line {self.line}, Placemark{name}"


class _KmlElements:
    """Follows the elements of a file, and makes entries of its placemarks."""

    def __init__(self, request: ReadOptions) -> None:
        self.reader = FeatureReader(request.source)
        self.found: list[FileEntry | Fault] = []
        self.left_out: Counter[str] = Counter()
        self.is_kml = False
        self.line_of: Callable[[], int] = lambda: 0
        self._request = request
        self._above: list[str] = []
        self._folders: list[str] = []
        self._placemark: _Placemark | None = None
        self._open: list[_Geometry] = []
        self._key = ""
        self._text: list[str] = []

    def start(self, name: str, attributes: dict[str, str]) -> None:
        """An element begins."""
        name = name.rpartition(":")[2]
        if not self._above:
            self.is_kml = name == "kml"
        self._above.append(name)
        if len(self._above) > _DEEPEST:
            raise self._refused("is nested too deeply", f"give {_WHAT}")
        self._text.clear()
        if name in _LEFT_OUT:
            self.left_out[name] += 1
        elif name in _FOLDERS:
            self._folders.append("")
        elif name == "Placemark":
            self._placemark = _Placemark(self.line_of())
        elif name in ("Data", "SimpleData"):
            self._key = attributes.get("name", "").strip().lower()
        elif self._placemark is not None and name in _SHAPES and not self._is_border(name):
            self._open.append(_Geometry(_SHAPES[name]))

    def _is_border(self, name: str) -> bool:
        """Whether a ring is one of a polygon and no shape of its own."""
        return name == "LinearRing" and self._above[-2:-1] in (
            ["outerBoundaryIs"],
            ["innerBoundaryIs"],
        )

    def text(self, data: str) -> None:
        """More text of the element."""
        self._text.append(data)

    def doctype(self, *_: object) -> None:
        """A document type, the one place where entities are declared."""
        raise self._refused("has a DOCTYPE, which no KML needs", "take it out")

    def end(self, name: str) -> None:
        """An element ends."""
        name = self._above.pop()
        above = self._above[-1] if self._above else ""
        text = "".join(self._text).strip()
        self._text.clear()
        if name in _FOLDERS:
            self._folders.pop()
        elif name == "Placemark" and self._placemark is not None:
            self._finish(self._placemark)
            self._placemark = None
        elif name == "name" and above in _FOLDERS:
            self._folders[-1] = text[:_LONGEST_NAME]
        elif self._placemark is not None:
            self._end_in(self._placemark, name, above, text)

    def _end_in(self, placemark: _Placemark, name: str, above: str, text: str) -> None:
        """An element of a placemark ends."""
        if name == "name" and above == "Placemark":
            placemark.name = text[:_LONGEST_NAME]
        elif (name == "value" and above == "Data") or name == "SimpleData":
            placemark.data[self._key] = text
        elif not self._open:
            return
        elif name == "altitudeMode":
            self._open[-1].mode = text
        elif name == "coordinates":
            self._open[-1].rings.append(self._places(placemark, text))
        elif name in _SHAPES and not (name == "LinearRing" and above.endswith("BoundaryIs")):
            placemark.shapes.append(self._open.pop())

    def _places(self, placemark: _Placemark, text: str) -> list[Place]:
        places: list[Place] = []
        words = text.split()
        if len(words) > MOST_POINTS:
            problem = f"has {len(words)} points"
            placemark.problem = problem, f"simplify it to {MOST_POINTS} or fewer"
            return []
        for word in words:
            place = place_of([spelt_number(number) for number in word.split(",")])
            if place is None:
                if placemark.problem is None:
                    placemark.problem = (
                        f"{shown(word)} is no place",
                        "give longitude,latitude,height with spaces between places alone",
                    )
                return []
            places.append(place)
        return places

    def _finish(self, placemark: _Placemark) -> None:
        if len(self.found) > MOST_ENTRIES:
            raise self._refused(f"has more than {MOST_ENTRIES} placemarks", "give fewer at a time")
        self._open.clear()
        if placemark.problem is None and any(
            not shape.rings or not all(shape.rings) for shape in placemark.shapes
        ):
            placemark.problem = "has a shape without coordinates", "draw it again"
        if placemark.problem is not None:
            self.found.append(Fault(self._request.source, placemark.place, *placemark.problem))
            return
        if not placemark.shapes:
            self.left_out["placemark without a shape"] += 1
            return
        shapes = []
        for geometry in placemark.shapes:
            shape = self._shape(geometry, placemark)
            if isinstance(shape, Fault):
                self.found.append(shape)
                return
            shapes.append(shape)
        feature = Feature(
            placemark.place, shapes, placemark.data, placemark.name or None, self._folders, True
        )
        self.found += self.reader.entries(feature)

    def _shape(self, geometry: _Geometry, placemark: _Placemark) -> Shape | Fault:
        source, place = self._request.source, placemark.place
        if geometry.mode == "absolute":
            return Shape(geometry.form, geometry.rings)
        flat = [[point[:2] for point in ring] for ring in geometry.rings]
        heights_m = {point[2] for ring in geometry.rings for point in ring if point[2:]}
        if geometry.mode in _ON_GROUND or not any(heights_m):
            return Shape(geometry.form, flat)
        if geometry.mode not in _ABOVE_GROUND:
            problem = f"{shown(geometry.mode)} is no altitudeMode"
            return Fault(source, place, problem, "give absolute, relativeToGround or clampToGround")
        if not self._request.has_terrain:
            return above_ground(source, place)
        if len(heights_m) > 1:
            problem = "has points of several heights above the ground"
            return Fault(source, place, problem, "give all its points one height")
        return Shape(geometry.form, flat, heights_m.pop())

    def _refused(self, problem: str, remedy: str) -> InputError:
        return InputError(Fault(self._request.source, f"line {self.line_of()}", problem, remedy))
