"""Types of a recording: markers, signals, outlines, images, clocks. All are frozen and checked.

Times are float seconds from the recording's first message; the int64 nanoseconds of that moment
are kept in `Recording.t0_ns`. Positions are metres, one named frame per stream.

Time of a measurement: the stamp in its message, else its publish time, never its log time, which
holds the recorder's delays.
"""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from validate.arrays import Floats, checked, rebuilt
from validate.display import Screen, brief
from validate.errors import RecordingError, UsageError
from validate.exports import lazily
from validate.installation import install_command

if TYPE_CHECKING:
    from pandas import DataFrame
    from xarray import DataArray, DataTree
from validate.arrays import Ints

# --- Streams of a recording as labelled arrays of xarray.


def labelled(
    name: str,
    values: NDArray[Any],
    dimensions: tuple[str, ...],
    t: NDArray[Any],
    attributes: Mapping[str, Any],
    **labels: tuple[str, ...],
) -> "DataArray":
    """Return values with named dimensions, times t (s) along the first one, labels along others.

    Raises `UsageError` where xarray is not installed.
    """
    try:
        from xarray import DataArray
    except ImportError:
        raise UsageError(
            f"labelled arrays need xarray, which is not installed: {install_command('tables')}"
        ) from None
    coordinates: dict[str, Any] = {name: list(label) for name, label in labels.items()}
    coordinates["time"] = ((dimensions[0],), t, {"units": "s"})
    return DataArray(values, coordinates, dimensions, name, dict(attributes))


def tree_of(streams: Mapping[str, "DataArray"], name: str, facts: Mapping[str, Any]) -> "DataTree":
    """Return the arrays of `labelled` as a tree, each in a node of its topic.

    Below a topic that is a stream itself the others have a dot: a node shares its parent's times.
    """
    from xarray import DataTree

    nodes = {}
    for topic, array in streams.items():
        above = [t for t in streams if topic.startswith(f"{t}/")]
        top = min(above, key=len, default="")
        place = f"{top}.{topic[len(top) + 1 :].replace('/', '.')}" if top else topic
        nodes[place] = array.to_dataset()
    tree = DataTree.from_dict(nodes)
    tree.name, tree.attrs = name, dict(facts)
    return tree


# -------------------------------------------------------------------------------------------------

Record = Mapping[str, str]
MADE_WITH = "made_with"  # the record of a twin's parameters
T = TypeVar("T")


def _set(instance: object, name: str, value: object) -> None:
    object.__setattr__(instance, name, value)


def _times(t: Floats, stream: str) -> Floats:
    t = checked(t, f"{stream} t [s]", (None,), error=RecordingError)
    if len(t) == 0:
        raise RecordingError(f"{stream}: no samples")
    steps = np.diff(t)
    if (steps < 0).any():
        at = int(np.argmax(steps < 0)) + 1
        raise RecordingError(
            f"{stream}: time runs backward at sample {at} ({t[at - 1]:.6f} s -> {t[at]:.6f} s)"
        )
    return t


def _spread(sd: float, stream: str) -> float:
    if not (np.isfinite(sd) and sd >= 0):
        raise RecordingError(f"{stream}: standard deviation {sd} is not a number >= 0")
    return float(sd)


@dataclass(frozen=True)
class Markers:
    """Named points over time: t (nt,) s, x (nt, k, d) m with NaN = not seen, sd m per axis."""

    t: Floats
    names: tuple[str, ...]
    x: Floats
    sd: float
    frame: str

    def __post_init__(self) -> None:
        _set(self, "t", _times(self.t, "markers"))
        k = len(self.names)
        if len(set(self.names)) != k or k == 0:
            raise RecordingError(f"markers: {k} names, {len(set(self.names))} different ones")
        x = checked(self.x, "markers x [m]", (len(self.t), k, None), nan=True, error=RecordingError)
        if x.shape[2] not in (2, 3):
            raise RecordingError(f"markers: {x.shape[2]} coordinates per point, expected 2 or 3")
        _set(self, "x", x)
        _set(self, "sd", _spread(self.sd, "markers"))

    __repr__, __reduce__ = brief, rebuilt

    def to_xarray(self) -> "DataArray":
        """Return the positions (time, marker, axis) in m, NaN where not seen.

        Attributes: `units`, `frame`, `sd`. Raises `UsageError` where xarray is not installed.
        """
        axes = ("x", "y", "z")[: self.x.shape[2]]
        attributes = {"units": "m", "frame": self.frame, "sd": self.sd}
        dimensions = ("time", "marker", "axis")
        return labelled("x", self.x, dimensions, self.t, attributes, marker=self.names, axis=axes)


@dataclass(frozen=True)
class Signal:
    """Numbers over time in one unit: t (nt,) s, y (nt, c) in `unit`, sd in `unit`."""

    t: Floats
    y: Floats
    unit: str
    sd: float
    frame: str

    def __post_init__(self) -> None:
        _set(self, "t", _times(self.t, "signal"))
        _set(self, "y", checked(self.y, "signal y", (len(self.t), None), error=RecordingError))
        if not self.unit:
            raise RecordingError("signal: no unit declared")
        _set(self, "sd", _spread(self.sd, "signal"))

    __repr__, __reduce__ = brief, rebuilt

    def to_xarray(self) -> "DataArray":
        """Return the numbers (time, column) in their unit.

        Attributes: `units`, `frame`, `sd`. Raises `UsageError` where xarray is not installed.
        """
        attributes = {"units": self.unit, "frame": self.frame, "sd": self.sd}
        return labelled("y", self.y, ("time", "column"), self.t, attributes)


@dataclass(frozen=True)
class Contours:
    """Closed outlines in an image plane: outlines nt x (k_i, 2) m, sd m along the normal.

    `each` (nt, 2) is the sd m of every outline, of which `sd` is the root mean square, and the
    confidence 0..1 that it is the one that is meant; None where nobody told them apart.

    `pose` is T_frame_from_image (4, 4): image x, y in metres become `frame` coordinates. `images`
    is the topic of the images that they were found in; empty: recorded as outlines.
    """

    t: Floats
    outlines: tuple[Floats, ...]
    sd: float
    pose: Floats
    frame: str
    images: str = ""
    each: Floats | None = None

    def __post_init__(self) -> None:
        _set(self, "t", _times(self.t, "contours"))
        if self.each is not None:
            each = self.each
            each = checked(
                each, "contours' sd [m] and confidence", (len(self.t), 2), error=RecordingError
            )
            if (each < 0).any() or (each[:, 1] > 1).any():
                raise RecordingError(
                    "contours: an sd below 0, or a confidence that is not within 0..1"
                )
            _set(self, "each", each)
        if len(self.outlines) != len(self.t):
            raise RecordingError(f"contours: {len(self.outlines)} outlines, {len(self.t)} times")
        outlines = tuple(
            checked(o, f"outline {i} [m]", (None, 2), error=RecordingError)
            for i, o in enumerate(self.outlines)
        )
        short = [i for i, o in enumerate(outlines) if len(o) < 3]
        if short:
            raise RecordingError(f"contours: outline {short[0]} has fewer than 3 points")
        _set(self, "outlines", outlines)
        _set(self, "sd", _spread(self.sd, "contours"))
        _set(self, "pose", checked(self.pose, "contours pose", (4, 4), error=RecordingError))

    __repr__, __reduce__ = brief, rebuilt

    def to_xarray(self) -> "DataArray":
        """Return the points of all outlines (point, axis) in image m, each with its `time`.

        Attributes: `units`, `frame`, `sd`. Raises `UsageError` where xarray is not installed.
        """
        attributes = {"units": "m", "frame": self.frame, "sd": self.sd}
        t = np.repeat(self.t, [len(outline) for outline in self.outlines])
        points = np.concatenate(self.outlines)
        return labelled("points", points, ("point", "axis"), t, attributes, axis=("x", "y"))


def _image(image: NDArray[np.uint8], number: int) -> NDArray[np.uint8]:
    if image.dtype != np.uint8 or image.ndim != 2 or not image.size:
        raise RecordingError(
            f"frames: image {number} is {image.shape} {image.dtype}, expected (h, w) uint8"
        )
    if not image.flags.writeable:
        return image
    image = image.copy()
    image.setflags(write=False)
    return image


@dataclass(frozen=True)
class Frames:
    """B-mode images over time: images nt x (h, w) uint8, m_per_px (x, y), pose T_frame_from_image.

    Image x runs along the columns, y along the rows (depth); the centre of pixel [row, column] lies
    at (column, row) * m_per_px in image metres.
    """

    t: Floats
    images: tuple[NDArray[np.uint8], ...]
    m_per_px: tuple[float, float]
    pose: Floats
    frame: str

    def __post_init__(self) -> None:
        _set(self, "t", _times(self.t, "frames"))
        if len(self.images) != len(self.t):
            raise RecordingError(f"frames: {len(self.images)} images, {len(self.t)} times")
        _set(self, "images", tuple(_image(a, i) for i, a in enumerate(self.images)))
        shapes = sorted({a.shape for a in self.images})
        if len(shapes) > 1:
            raise RecordingError(f"frames: images of different sizes {shapes}")
        scale = checked(self.m_per_px, "frames m_per_px", (2,), error=RecordingError)
        if (scale <= 0).any():
            raise RecordingError(f"frames: {self.m_per_px} m per pixel, expected two numbers > 0")
        _set(self, "m_per_px", (float(scale[0]), float(scale[1])))
        _set(self, "pose", checked(self.pose, "frames pose", (4, 4), error=RecordingError))

    __repr__, __reduce__ = brief, rebuilt

    def to_xarray(self) -> "DataArray":
        """Return the images (time, row, column), uint8.

        Attributes: `units`, `frame`, `m_per_px`. Raises `UsageError` where xarray is not installed.
        """
        attributes = {"units": "1", "frame": self.frame, "m_per_px": self.m_per_px}
        images = np.stack(self.images)
        return labelled("images", images, ("time", "row", "column"), self.t, attributes)


Stream = Markers | Signal | Contours | Frames
_KINDS = {"markers": Markers, "signals": Signal, "contours": Contours, "frames": Frames}


def by_kind(streams: Mapping[str, Stream]) -> dict[str, Any]:
    """Streams by topic as the arguments of `Recording` that take them."""
    return {
        name: {topic: s for topic, s in streams.items() if isinstance(s, kind)}
        for name, kind in _KINDS.items()
    }


@dataclass(frozen=True)
class Clock:
    """What a stream's times look like, s; `gaps` counts steps over 3 x the median step."""

    topic: str
    count: int
    duration: float
    rate_hz: float | None
    gaps: int
    longest_gap: float
    duplicates: int
    backward: int
    stamp_minus_publish: float | None  # largest difference, s; None: messages have no stamp
    publish_minus_log: float  # largest difference, s


@dataclass(frozen=True)
class Source:
    """Where a recording came from: file name, its SHA-256 and size, and what its bytes prove."""

    path: str
    sha256: str
    bytes: int
    integrity: str  # "verified" or "integrity not provable: ..."


@dataclass(frozen=True)
class Recording:
    """All streams of one experiment by topic, with metadata records (calibration, provenance).

    `unread` are the topics of the file that are no stream here, and why.
    Raises `RecordingError` for a topic in two kinds of streams.
    """

    name: str
    source: Source
    t0_ns: int
    markers: Mapping[str, Markers] = field(default_factory=dict)
    signals: Mapping[str, Signal] = field(default_factory=dict)
    contours: Mapping[str, Contours] = field(default_factory=dict)
    frames: Mapping[str, Frames] = field(default_factory=dict)
    clock: Mapping[str, Clock] = field(default_factory=dict)
    metadata: Mapping[str, Record] = field(default_factory=dict)
    unread: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in (*_KINDS, "clock", "metadata", "unread"):
            _set(self, name, MappingProxyType(dict(getattr(self, name))))
        topics = Counter(topic for name in _KINDS for topic in getattr(self, name))
        twice = sorted(topic for topic, count in topics.items() if count > 1)
        if twice:
            raise RecordingError(f"{self.name}: topics used twice: {twice}; rename one")

    __reduce__ = rebuilt

    def __repr__(self) -> str:
        return self._screen.text

    def _repr_html_(self) -> str:
        return self._screen.html

    @property
    def made_with(self) -> Record:
        """Parameters of the twin that made it, as text by path; none where it says none."""
        return self.metadata.get(MADE_WITH, {})

    @property
    def _screen(self) -> Screen:
        source = self.source
        title = f"{self.name}: {len(self.streams)} streams of {source.path}, {source.integrity}"
        rows = tuple((topic, *_row(stream)) for topic, stream in self.streams.items())
        head = ("stream", "content", "samples", "time / s", "unit", "frame")
        records = (f"records: {', '.join(self.metadata)}",) if self.metadata else ()
        return Screen(title, (), head, rows, records)

    @property
    def plot(self) -> Any:
        """Figures by topic, as `recording.plot.force()`: signals over time, and how far markers
        moved; a `validate.library` Plots, which `list()` names."""
        return lazily("validate.library", {"plots": ("recording_plots",)})("recording_plots")(self)

    def to_xarray(self) -> "DataTree":
        """Return a tree with each stream at its topic, since every stream has its own times.

        `tree["markers/x"]` is (time, marker, axis) in m, `tree["force/y"]` (time, column) in the
        unit of the signal; outlines are `points`, images `images`. Raises `UsageError` where
        xarray is not installed.
        """
        source = self.source
        facts = {"source": source.path, "sha256": source.sha256, "t0_ns": self.t0_ns}
        return tree_of({t: s.to_xarray() for t, s in self.streams.items()}, self.name, facts)

    def to_pandas(self) -> "DataFrame":
        """Return all streams but images as one long table: `stream`, `time` s, `value`, `unit`, and
        where there are several the `marker`, `axis` or `column`.

        Raises `UsageError` where xarray is not installed, which brings pandas.
        """
        arrays = {t: s.to_xarray() for t, s in self.streams.items() if not isinstance(s, Frames)}
        parts = [array.to_dataframe("value").reset_index().assign(stream=t, unit=array.units)
                 for t, array in arrays.items()]  # fmt: skip
        if not parts:
            raise UsageError(f"{self.name}: no stream of numbers")
        from pandas import concat

        return concat(parts, ignore_index=True)

    @property
    def streams(self) -> Mapping[str, Stream]:
        """The streams of all kinds by topic."""
        return {**self.markers, **self.signals, **self.contours, **self.frames}

    def signal(self, topic: str, unit: str) -> Signal:
        """Return the signal of that topic; raises `RecordingError` when absent or in another
        unit."""
        found = _present(self.signals, topic, f"{self.name}: no signal")
        if found.unit != unit:
            raise RecordingError(f"{self.name}: '{topic}' is in {found.unit}, expected {unit}")
        return found

    def marker(self, topic: str) -> Markers:
        """Return the markers of that topic; raises `RecordingError` when absent."""
        return _present(self.markers, topic, f"{self.name}: no markers")

    def contour(self, topic: str) -> Contours:
        """Return the contours of that topic; raises `RecordingError` when absent."""
        return _present(self.contours, topic, f"{self.name}: no outlines")

    def frame(self, topic: str) -> Frames:
        """Return the images of that topic; raises `RecordingError` when absent."""
        return _present(self.frames, topic, f"{self.name}: no images")

    def record(self, name: str) -> Record:
        """Return the metadata record of that name; raises `RecordingError` when absent."""
        return _present(self.metadata, name, f"{self.name}: no record")


def _row(stream: Stream) -> tuple[str, str, str, str, str]:
    """Content, number of samples, times in s, unit and frame."""
    what, unit = type(stream).__name__.lower(), "m"
    if isinstance(stream, Markers):
        what = f"{len(stream.names)} markers"
    elif isinstance(stream, Signal):
        what, unit = f"signal of {stream.y.shape[1]}", stream.unit
    elif isinstance(stream, Frames):
        height, width = stream.images[0].shape
        what, unit = f"images of {width} x {height}", "1"
    span = f"{stream.t[0]:.4g} to {stream.t[-1]:.4g}"
    return what, str(len(stream.t)), span, unit, stream.frame


def _present(streams: Mapping[str, T], topic: str, missing: str) -> T:
    if topic not in streams:
        raise RecordingError(
            f"{missing} '{topic}'; it has {sorted(streams)}; see `validate inspect`"
        )
    return streams[topic]


GAP_FACTOR = 3.0  # a step longer than this many median steps is a gap


def clock_of(topic: str, stamps_ns: Ints | None, publish_ns: Ints, log_ns: Ints) -> Clock:
    """Return the clock of one stream from int64 ns (n,) each, in the order of the file.

    `stamps_ns` None: the messages have no stamp and publish time counts. The median step is over
    steps forward, so repeated stamps do not hide gaps; `longest_gap` is 0 where there is no gap.
    Raises `RecordingError` without messages or when the counts differ.
    """
    times = publish_ns if stamps_ns is None else stamps_ns
    counts = (len(times), len(publish_ns), len(log_ns))
    if counts[0] == 0 or len(set(counts)) != 1:
        raise RecordingError(f"{topic!r}: {counts} stamps, publish and log times, expected equal")
    steps = np.diff(times)
    duplicates, backward = int((steps == 0).sum()), int((steps < 0).sum())
    # The steps that are gaps; reorders `forward`, as a copy costs 8 bytes a sample.
    forward = steps[steps > 0]
    if not len(forward):
        gaps = forward
    else:
        gaps = forward[forward > GAP_FACTOR * np.median(forward, overwrite_input=True)]
    duration = _seconds(int(times.max()) - int(times.min()))
    return Clock(
        topic=topic,
        count=len(times),
        duration=duration,
        rate_hz=(len(times) - 1) / duration if duration > 0 else None,
        gaps=len(gaps),
        longest_gap=_seconds(int(gaps.max(initial=0))),
        duplicates=duplicates,
        backward=backward,
        stamp_minus_publish=None if stamps_ns is None else _largest(stamps_ns, publish_ns),
        publish_minus_log=_largest(publish_ns, log_ns),
    )


def _seconds(ns: int) -> float:
    return ns / 1e9


def _largest(a: Ints, b: Ints) -> float:
    apart = a - b
    return _seconds(int(np.abs(apart, out=apart).max()))
