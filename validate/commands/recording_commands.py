"""Click commands on recordings, from inspect and import to new and record."""

from pathlib import Path
from typing import Any

import click

from validate.commands.arguments import (
    EXPERIMENTS,
    FILE,
    FORCE,
    OK,
    Detail,
    detailed,
    output,
    require_new,
)
from validate.commands.help import WithFormats


@click.command()
@click.argument("file", type=click.Path(path_type=Path))
@click.option("--json", "as_json", is_flag=True, help="Print one JSON document only.")
@click.option("--as", "kind", metavar="KIND", help="File format, as for `validate import`.")
@click.option("--map", "mapping", multiple=True, metavar="KEY=VALUE", help="As for `import`.")
@click.option(
    "--messages", "topic", metavar="TOPIC", help="MCAP: print the topic's messages, one per line."
)
@click.option("--most", type=int, default=10, show_default=True, help="Largest number of messages.")
@detailed
def inspect(
    file: Path,
    as_json: bool,
    kind: str | None,
    mapping: tuple[str, ...],
    topic: str,
    most: int,
    detail: Detail,
) -> int:
    """Show what a recording holds, and its defects.

    Exit code 1: it has a defect.

    \b
    Example:
      validate inspect log.csv
    """
    from validate.commands import inspect as inspecting

    if topic:
        inspecting.messages(file, topic, most, as_json)
        return OK
    return inspecting.inspect(file, as_json, kind, mapping, detail)


@click.command("import", cls=WithFormats)
@click.argument("files", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option(
    "--as",
    "kind",
    metavar="KIND",
    help="File format, one of those below (default: detected).",
)
@output("The MCAP recording to write.")
@click.option(
    "--map",
    "mapping",
    multiple=True,
    metavar="ROLE=COLUMN[:UNIT][:-]",
    help="Column, unit and sign of a quantity, or a reader's option, as specimen=2.",
)
@click.option(
    "--m-per-px", metavar="LENGTH", help="Images and videos: size of a pixel, as 1e-4 (m) or 0.1mm."
)
@click.option("--rate", type=float, help="Images and videos: images per second, Hz.")
@click.option("--topic", help="Images and videos: topic to write (default: images).")
@click.option(
    "--specimens", metavar="one|each|A,A,B", help="Specimens of several logs: one, each, or labels."
)
@click.option("--recover", is_flag=True, help="Truncated MCAP: save all complete messages.")
def import_(
    files: tuple[Path, ...],
    kind: str | None,
    out: Path,
    mapping: tuple[str, ...],
    recover: bool,
    specimens: str | None,
    **given: Any,
) -> None:
    """Turn files of other programs into one recording.

    Several logs of a testing machine, or a folder of them, are repeats: their mean and scatter
    are kept.

    \b
    Example:
      validate import log.csv -o imported.mcap
    """
    from validate.commands import recordings

    if recover:
        recordings.recover_file(files, kind, out, mapping, {**given, "specimens": specimens})
    else:
        recordings.import_files(files, kind, out, mapping, specimens, given)


@click.command()
@click.argument("file", type=FILE)
@click.option("--topic", default="", help="Topic of the images (default: the only one).")
@click.option("--centre", metavar="X,Y", help="Rough centre, as 12mm,20mm or 120px,80px.")
@click.option("--radius", metavar="LENGTH", help="Rough radius, within a third, as 8mm or 80px.")
@click.option("--shape", type=click.Choice(["free", "ellipse", "circle"]), default="free",
              show_default=True, help="Shape fitted to the wall.")  # fmt: skip
@click.option("--bright", is_flag=True, help="The region is bright, its surroundings are dark.")
@click.option("--confidence", type=click.FloatRange(0, 1), default=0.5, show_default=True,
              help="Lowest confidence if other regions are equally distinct.")  # fmt: skip
@click.option("--from", "drawn", type=click.Path(path_type=Path),
              help="Third-party masks (.png, folder, .npy, .npz, .nrrd) or outlines (.csv, "
                   ".json).")  # fmt: skip
@click.option(
    "--sd", metavar="LENGTH", help="Standard uncertainty of third-party outlines, as 0.3mm or 2px."
)
@click.option("--unit", metavar="UNIT", help="Unit of third-party points (default: px).")
@click.option("--label", help="Third-party region, by its value or name.")
@click.option("--name", default="outline", show_default=True, help="Name of the stream to write.")
@output("The recording to write (default: FILE itself).", required=False)
def outline(
    file: Path, out: Path | None, topic: str, name: str, drawn: Path | None, **given: Any
) -> None:
    """Find or import the outline of a region in images.

    \b
    Example:
      validate outline images.mcap --bright -o outlined.mcap
    """
    from validate.commands import outline as outlining

    outlining.outline(file, out, topic, name, drawn, given)


@click.command()
@click.argument("files", nargs=-1, required=True, type=FILE)
@output("The MCAP recording to write.")
@click.option(
    "--shift",
    "shifts",
    multiple=True,
    metavar="TOPIC=SECONDS[:SD]",
    help="Shift the times of a stream from a separate clock; kept as a record.",
)
def merge(files: tuple[Path, ...], out: Path, shifts: tuple[str, ...]) -> None:
    """Join the streams of several recordings into one.

    \b
    Example:
      validate merge log.mcap images.mcap --shift images=0.25:0.01 -o test.mcap
    """
    from validate.commands import recordings

    recordings.merge_files(files, out, shifts)


@click.command()
@click.argument("files", nargs=-1, required=True, type=FILE)
@click.option("--by", required=True, multiple=True, metavar="CHANNEL=CHANNEL",
              help="Channels that move alike in the first and a further file, as "
              "force=-markers.tip.z; one per further file, in their order.")  # fmt: skip
@click.option(
    "--event",
    type=click.Choice(["onset", "step"]),
    help="Match an event instead of the correlation.",
)
@click.option("--within", type=float, metavar="SECONDS", help="Largest offset to search.")
@click.option("--correlation", type=click.FloatRange(0.0, 1.0, min_open=True), default=0.5,
              show_default=True, metavar="SHARE", help="Lowest accepted correlation.")  # fmt: skip
@click.option("--coverage", type=click.FloatRange(0.0, 1.0, min_open=True), default=0.5,
              show_default=True, metavar="SHARE",
              help="Lowest share of a file's samples within the first file's time.")  # fmt: skip
@click.option(
    "--drift", "straighten", is_flag=True, help="Correct the drift of further files' clocks."
)
@output("The MCAP recording to write.")
def align(files: tuple[Path, ...], out: Path, by: tuple[str, ...], **options: Any) -> None:
    """Put recordings of one test on one clock.

    \b
    Example:
      validate align log.mcap camera.mcap --by displacement=travel -o aligned.mcap
    """
    from validate.commands import align as aligning

    aligning.align(files, out, by, aligning.HowAligned(**options))


@click.command()
@click.argument("file", type=FILE)
@click.option("--points", type=FILE, help="Marked points, CSV: image, u, v (px), target.")
@click.option("--targets", type=FILE,
              help="Landmark file, or CSV: target, x, y, z; for wires also x2, y2, "
                   "z2.")  # fmt: skip
@click.option("--unit", metavar="UNIT", help="Unit of targets in a table, as mm.")
@click.option("--probe", metavar="TOOL", help="Poses of the probe, as ProbeToReference.")
@click.option("--topic", default="images", show_default=True, help="Topic of the images.")
@click.option(
    "--pivot",
    "tool",
    metavar="TOOL",
    help="Calibrate the tip of this tool from turns about a point.",
)
@click.option(
    "--reference", default="", metavar="TOOL", help="--pivot: tracked reference; it may move."
)
@click.option("--tip", "rough", default="", metavar="X,Y,Z",
              help="--pivot about several points: rough tip, as 108mm,8mm,3mm.")  # fmt: skip
@output("The MCAP recording to write.")
def calibrate(
    file: Path, out: Path, tool: str | None, reference: str, rough: str, **given: Any
) -> None:
    """Calibrate a tracked ultrasound probe, or a tool tip.

    Landmarks or wires give the image plane; --pivot gives the tip.

    \b
    Example:
      validate calibrate pivot.mcap --pivot StylusToTracker -o tip.mcap
    """
    images = [f"--{name}" for name in ("points", "targets", "unit", "probe") if given[name]]
    if tool is not None and images:
        raise click.UsageError(
            f"{', '.join(images)}: for an image plane; leave out with --pivot {tool}."
        )
    if tool is None and (reference or rough):
        raise click.UsageError("--reference and --tip need --pivot TOOL; give it.")
    from validate.commands import calibrate as calibrating

    if tool is not None:
        calibrating.calibrate_tip(file, out, tool, reference, rough)
        return
    for name, value in given.items():
        if value is None and name != "unit":
            raise click.UsageError(f"Missing option '--{name}'.")
    calibrating.calibrate(file, out, **given)


@click.command()
@click.argument("file", type=FILE)
@click.option(
    "--tool", required=True, metavar="TOOL", help="Poses of the tool, as StylusToTracker."
)
@click.option(
    "--tip", required=True, metavar="X,Y,Z", help="Tip in the tool's frame, as 108mm,8mm,3mm."
)
@click.option("--reference", default="", metavar="TOOL", help="Tracked tool whose frame is used.")
@click.option("--known", type=FILE, help="Landmark file, or CSV: target, x, y, z.")
@click.option("--unit", metavar="UNIT", help="Unit of landmarks in a table, as mm.")
@output("The MCAP recording to write.")
def digitise(file: Path, out: Path, **how: Any) -> None:
    """Find the landmarks touched with a tracked tool.

    With --known, landmarks get their names, and each is also predicted from the others.

    \b
    Example:
      validate digitise stylus.mcap --tool StylusToTracker --tip 108mm,8mm,3mm -o touched.mcap
    """
    from validate.commands import digitise as digitising

    digitising.digitise(file, out, digitising.HowDigitised(**how))


@click.command()
@click.argument("name")
@click.option("--from", "source", required=True, type=FILE, help="The MCAP recording.")
@click.option("--answers", type=FILE, help="TOML file of answers.")
@click.option(
    "--questions", is_flag=True, help="Print the questions as a file of answers; write nothing."
)
@click.option("-o", "out", type=FILE, help="File to write (default: experiments/NAME.py).")
@FORCE
def new(
    name: str, source: Path, out: Path | None, answers: Path | None, *, questions: bool, force: bool
) -> None:
    """Write an experiment from a recording and your answers.

    The command asks for what the recording does not contain, or reads it from --answers.

    \b
    Example:
      validate new my_gel --from log.mcap --questions
    """
    from validate.commands.questions import new as writing

    writing.new(name, source, out, answers, questions=questions, force=force)


@click.command()
@click.argument("file", type=FILE)
@click.option("--unit", metavar="UNIT", help="Unit of lengths, as mm; npz files are in m.")
@click.option("--edge", metavar="LENGTH", help="Edge of the elements that fill a surface, as 2mm.")
@click.option(
    "--part", metavar="PART", help="One of several bodies, by name or rank: 1 is the largest."
)
@click.option(
    "--face", "faces", multiple=True, metavar="NAME=WORDS",
    help="Facet set by place: top=zmax, side=x=20mm, box A to B or near P (docs/how-to/new.md).",
)  # fmt: skip
@click.option("--size", metavar="LENGTH", help="Largest side; confirms an unusual size.")
@click.option(
    "--quadratic", "curved", is_flag=True, help="Quadratic elements: add a node on every edge."
)
@output("The npz file to write, for experiments.", required=False)
def body(file: Path, **given: Any) -> None:
    """Convert a mesh or closed surface into a body.

    \b
    Example:
      validate body gel.stl --unit mm --edge 8mm -o gel.npz
    """
    from validate.commands import body as bodies

    bodies.body(file, **given)


@click.command()
@click.argument("name")
@click.option("-o", "out", required=True, type=FILE, help="The MCAP recording to write.")
@FORCE
@click.option("--set", "values", multiple=True, metavar="PATH=VALUE", help="Change a parameter.")
@EXPERIMENTS
def record(
    name: str, out: Path, values: tuple[str, ...], named: tuple[Path, ...], *, force: bool
) -> None:
    """Make the synthetic recording of an experiment.

    \b
    Example:
      validate record kf_cube -o twin.mcap
    """
    from validate.commands import record as making

    require_new((out, out.with_suffix(".json")), force=force)
    making.record(name, out, values, named)


@click.group("data", invoke_without_command=True)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON document only.")
@click.pass_context
def data_(context: click.Context, as_json: bool) -> None:
    """List and fetch public recordings by name.

    \b
    Example:
      validate data
    """
    if context.invoked_subcommand is None:
        from validate.commands import data

        data.show(as_json)


@data_.command("get")
@click.argument("name")
def get_(name: str) -> None:
    """Fetch a public recording, checked against its hashes.

    \b
    Example:
      validate data get hanging-bar
    """
    from validate.commands import data

    data.get(name)


COMMANDS = (inspect, import_, outline, align, calibrate, digitise, merge, body, new, record, data_)
