"""Declaration of all commands, and exit codes (0 passed, 1 failed, 2 usage, 70 bug)."""

import gc
import logging
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from validate import __version__
from validate.commands.arguments import (
    BAD_INPUT,
    BUG,
    EXPERIMENTS,
    FILE,
    FOLDER,
    FORCE,
    INTERRUPTED,
    complain,
    detailed,
    external_simulators,
    output,
    require_empty,
    require_new,
)
from validate.commands.external import external
from validate.commands.help import Sections, outlives_reader
from validate.commands.recording_commands import COMMANDS
from validate.errors import UsageError, ValidateError
from validate.memory import imports_stay
from validate.places import of_the_place, why_not

if TYPE_CHECKING:
    from validate.engine.pool import Pool


def main(argv: list[str] | None = None) -> None:
    """Runs the command line and exits.

    Linear algebra keeps to one thread unless the user says otherwise: step times are those of one
    thread, and small dense products on several lose far more than they gain.
    """
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    sys.stdout, sys.stderr = outlives_reader(sys.stdout), outlives_reader(sys.stderr)
    code = run(sys.argv[1:] if argv is None else argv)
    gc.freeze()  # all memory goes back at once: nothing is worth a last search for what is unused
    sys.exit(code)


def run(argv: list[str]) -> int:
    """The exit code of a command; known errors print one line, a bug its traceback."""
    log = logging.getLogger("validate")
    if not any(isinstance(handler, _OneLine) for handler in log.handlers):
        log.addHandler(_OneLine())
    try:
        given = tuple(argv)
        return int(cli.main(argv, prog_name="validate", standalone_mode=False, obj=given) or 0)
    except ValidateError as error:
        complain(str(error))
    except click.exceptions.NoArgsIsHelpError as wanted:
        click.echo(wanted.ctx.get_help())
        return 0
    except click.UsageError as error:
        complain(f"{error.format_message()} Try 'validate --help'.")
    except (click.Abort, KeyboardInterrupt):
        complain("interrupted")
        return INTERRUPTED
    except BrokenPipeError:
        return INTERRUPTED
    except OSError as error:
        if not of_the_place(error):
            return _bug()
        if error.filename is None:
            complain(f"the output cannot be written: {error.strerror}")
        else:
            place = Path(error.filename)
            complain(f"{place}: {why_not(error, place)}; free space there, or use another folder")
    except MemoryError as error:
        said = f" ({error})" if str(error) else ""
        complain(f"out of memory{said}: take a coarser mesh or fewer steps")
    except Exception:
        return _bug()
    return BAD_INPUT


class _OneLine(logging.Handler):
    """A warning of the package as a line on standard error, as errors are."""

    def emit(self, record: logging.LogRecord) -> None:
        complain(record.getMessage())


def _bug() -> int:
    """Keeps the traceback of what is being handled, says whose code raised it where that is an
    experiment's own, and gives the exit code."""
    import traceback

    from validate.catalogue import shipped

    traceback.print_exc()
    ours = (str(Path(__file__).parents[1]), str(shipped()))
    frames = [
        (frame.f_code.co_filename, line, frame.f_globals.get("__name__", ""))
        for frame, line in traceback.walk_tb(sys.exc_info()[2])
    ]
    # What lies below, as numpy, was called by the last of these.
    known = [f for f in frames if f[0].startswith(ours) or f[2].startswith("validate_experiment_")]
    if known and not known[-1][0].startswith(ours):
        file, line, _ = known[-1]
        complain(f"{file}, line {line}: raised by the experiment's own code; correct this file")
    return BUG


WORKERS = click.option(
    "--workers", type=click.IntRange(1), envvar="VALIDATE_WORKERS", metavar="N",
    help="Processes side by side (default: the idle cores).",
)  # fmt: skip


@click.group(cls=Sections, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="validate")
def cli() -> None:
    """Does my simulation predict what was measured, within the error of the
    measurement?

    \b
    Example:
      validate run fluid_phantom
      validate new my_gel --from log.mcap
    """


@cli.command("list")
@click.argument("name", required=False)
@EXPERIMENTS
@click.option("--all", "everything", is_flag=True, help="With NAME: list every parameter.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON document only.")
@click.option(
    "--declaration", is_flag=True, help="With NAME: print its declaration, which NAME.json runs."
)
@click.option("--plugins", is_flag=True, help="List the installed plug-ins with their versions.")
def list_(
    name: str | None,
    named: tuple[Path, ...],
    everything: bool,
    as_json: bool,
    declaration: bool,
    plugins: bool,
) -> None:
    """List experiments, or the parameters and methods of one.

    \b
    Example:
      validate list
      validate list hanging_bar
    """
    if plugins:
        from validate.commands import list_plugins as plug_ins

        return plug_ins.show(as_json)
    if name is None:
        from validate.commands import list_names as names

        return names.show(named, as_json)
    from validate.commands import list as listing

    if declaration:
        return listing.declare(name, named)
    return listing.show(name, named, as_json, "full" if everything else "screen")


@cli.command("run")
@click.argument("names", nargs=-1, metavar="NAME|FILE.py|FILE.json ...")
@click.option("--all", "everything", is_flag=True, help="Every experiment.")
@EXPERIMENTS
@click.option(
    "--quick", is_flag=True, help="Coarser meshes and fewer comparisons; the report says so."
)
@click.option(
    "--out", type=FOLDER, help="Folder of reports (default: reports/ of the project, or here)."
)
@click.option("--set", "values", multiple=True, metavar="PATH=VALUE", help="Change a parameter.")
@click.option("--methods", default="", metavar="M1,M2", help="Only these methods.")
@click.option(
    "--case",
    default="",
    metavar="NAME",
    help="Run only this case (variant) in addition to the recording.",
)
@external_simulators
@click.option("--refine", is_flag=True, help="Finer meshes, more load steps, no time limit.")
@click.option("--anyway", is_flag=True, help="Predict even if parameters are not identifiable.")
@click.option("--json", "as_json", is_flag=True, help="Print results.json of all runs as one list.")
@click.option(
    "--vtu", is_flag=True, help="Also write a ParaView series to paraview/ in the report."
)
@WORKERS
@detailed
def run_(names: tuple[str, ...], everything: bool, workers: int | None, **options: Any) -> int:
    """Simulate, compare with the measurement and write the report.

    Exit code 0: every requirement is met. 1: one is not, or is undecided.

    \b
    Example:
      validate run kf_cube --quick
    """
    if everything == bool(names):
        raise UsageError(
            "no experiment is named: name one or more experiments, or give --all; see 'validate "
            "list'"
        )
    with _pool(workers) as pool:
        from validate.commands import run as running

        imports_stay()
        return running.run(names, pool=pool, **options)


def _pool(workers: int | None) -> "Pool":
    """Workers that import what they need while this process imports the same."""
    from validate.engine.cell import Where
    from validate.engine.pool import Pool

    pool = Pool(
        Where(workers),
        ("validate.pipeline.run.cells", "validate.report.sections.sections"),
        shares=True,
    )
    pool.prepare()
    return pool


@cli.command()
@click.argument("names", nargs=-1, metavar="[NAME ...]")
@EXPERIMENTS
@click.option("--fresh", is_flag=True, help="Repeat every run, even if a stored run matches.")
@click.option("--out", type=FOLDER, help="Folder of reports (default: as for run).")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON document only.")
@WORKERS
@detailed
def check(names: tuple[str, ...], workers: int | None, **options: Any) -> int:
    """Check that printed figures and declared verdicts still hold.

    A stored run is used where code, files, parameters and machine are the same.

    \b
    Example:
      validate check bending_rod
    """
    with _pool(workers) as pool:
        from validate.commands import check as checking

        imports_stay()
        return checking.check(names, pool=pool, **options)


@cli.command("show")
@click.argument("run", metavar="NAME|FOLDER")
@click.argument("views", nargs=-1, metavar="[VIEW]...")
@click.option("--out", "reports", type=FOLDER, help="Folder of reports (default: as for run).")
@output("File for one view: .svg, .pdf, .png, .csv, .tex or .html.", required=False)
def show_(run: str, views: tuple[str, ...], reports: Path | None, out: Path | None) -> None:
    """Show tables and charts of a stored run.

    Without a view, all that have something to show are listed.

    \b
    Example:
      validate show kf_cube checks
    """
    from validate.commands import show as viewing

    viewing.show(run, views, reports, out)


@cli.command("history")
@click.argument("name", metavar="NAME|FILE.py")
@EXPERIMENTS
@click.option("--out", type=FOLDER, help="Folder of reports (default: as for run).")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON document only.")
def history_(name: str, named: tuple[Path, ...], out: Path | None, as_json: bool) -> None:
    """Show past runs and what changed between them.

    \b
    Example:
      validate history kf_cube
    """
    from validate.commands import history as past

    past.show(name, named, out, as_json)


@cli.command("report")
@click.option("--out", type=FOLDER, help="Folder of reports (default: as for run).")
def report_(out: Path | None) -> None:
    """Write one page over all stored runs: verdicts, changes, links.

    \b
    Example:
      validate report
    """
    from validate.commands import overview

    overview.show(out)


@cli.command("open")
@click.argument("name", default="", metavar="[NAME|FOLDER]")
@click.option("--out", type=FOLDER, help="Folder of reports (default: as for run).")
def open_(name: str, out: Path | None) -> None:
    """Open a report in the browser; without NAME the overview.

    \b
    Example:
      validate open kf_cube
    """
    from validate.commands import overview

    overview.open_page(name, out)


@cli.command("summary")
@click.option("--out", type=FOLDER, help="Folder of reports (default: as for run).")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON document; write no page.")
def summary_(out: Path | None, as_json: bool) -> None:
    """Summarise bias and scatter over all stored runs.

    \b
    Example:
      validate summary
    """
    from validate.commands import summary as summing

    summing.show(out, as_json=as_json)


@cli.command()
@click.argument("runs", nargs=-1, required=True, metavar="NAME|FOLDER ...")
@click.option(
    "--method", "methods", multiple=True, metavar="GLOB", help="Only these methods: 'kf_*'."
)
@click.option(
    "--score", "scores", multiple=True, metavar="GLOB", help="Only these scores: '*.rms@9mm'."
)
@click.option(
    "--sort", type=click.Choice(["change", "difference", "score", "method", "stored"]),
    default="change", show_default=True, help="Order of the scores; default: largest change first.",
)  # fmt: skip
@click.option(
    "--all", "-v", "--verbose", "everything", is_flag=True, help="Print everything, not one screen."
)
@click.option("--out", type=FOLDER, help="Folder of the page (default: next to the first run).")
@click.option(
    "--json", "as_json", is_flag=True, help="Print one JSON document; write a page only with --out."
)
def compare(runs: tuple[str, ...], out: Path | None, as_json: bool, **wanted: Any) -> None:
    """Compare stored runs side by side, without new runs.

    \b
    Example:
      validate compare kf_cube kf_cube_inertia
    """
    from validate.commands import compare as comparing

    comparing.compare(runs, comparing.Shown(**wanted), out, as_json=as_json)


@cli.command("export")
@click.argument("run", metavar="NAME|FOLDER")
@click.option("--junit", type=FILE, help="Write checks and published figures as JUnit XML.")
@click.option("--latex", type=FILE, help="Write checks as a LaTeX tabular.")
@click.option(
    "--figures",
    type=FOLDER,
    help="Write charts as SVG and PDF for one column and two, tables as CSV and LaTeX.",
)
@FORCE
def export_(
    run: str, junit: Path | None, latex: Path | None, figures: Path | None, *, force: bool
) -> None:
    """Write a stored run as JUnit XML, LaTeX or figures.

    \b
    Example:
      validate export reports/kf_cube --junit checks.xml --latex checks.tex
      validate export reports/kf_cube --figures thesis/figures
    """
    from validate.commands import export as exporting

    require_new((file for file in (junit, latex) if file is not None), (Path(run),), force=force)
    if figures is not None:
        require_empty(figures, "--figures", force=force)
    exporting.export(run, junit, latex, figures)


@cli.group()
def study() -> None:
    """Run many variations of an experiment; a stopped study resumes.

    \b
    Example:
      validate study stability kf_cube --quick
    """


def _studied(command: Any) -> Any:
    """The argument and the options of every study."""
    for option in (
        click.option("--json", "as_json", is_flag=True, help="Print results.json only."),
        click.option(
            "--scheduler",
            default="",
            metavar="ADDRESS",
            help="Address of a running Dask scheduler.",
        ),
        click.option(
            "--workers", type=int, help="Local processes (0: this one; default: the idle cores)."
        ),
        click.option(
            "--out",
            type=FOLDER,
            help="Folder of reports (default: reports/ of the project, or here).",
        ),
        click.option(
            "--quick", is_flag=True, help="Coarser meshes and fewer runs; the report says so."
        ),
        EXPERIMENTS,
        click.argument("name", metavar="NAME|FILE.py"),
    ):
        command = option(command)
    return detailed(command)


def _common(options: dict[str, Any]) -> Any:
    """Takes the options of every study out of a command's."""
    from validate.commands.study import StudyOptions

    return StudyOptions(**{k: options.pop(k) for k in StudyOptions.__dataclass_fields__})


@study.command("filters")
@click.option(
    "--sweep",
    "sweeps",
    multiple=True,
    metavar="PATH=VALUES",
    help="Values of a parameter: log:1e-6:1e-1:7, lin:1kPa:5kPa:5 or a,b,c; several make a grid.",
)
@click.option("--seeds", default="", metavar="N|A,B,C", help="Noise seeds of a twin (default: 10).")
@click.option("--set", "values", multiple=True, metavar="PATH=VALUE", help="Change a parameter.")
@click.option("--methods", default="", metavar="M1,M2", help="Only these methods.")
@click.option(
    "--by",
    default="",
    metavar="SCORE",
    help="Score to rank by (default: truth, or withheld markers).",
)
@click.option(
    "--hold-out",
    "hold_out",
    default="",
    metavar="each|A,B",
    help="Markers withheld from all filters: names, or each in turn.",
)
@_studied
def filters(name: str, **options: Any) -> int:
    """Rank filter settings on your recording.

    \b
    Example:
      validate study filters kf_cube --quick --sweep methods.kf_load.settings.Q=log:1e-12:1e-8:3
    """
    from validate.commands import study as studying

    return studying.filters(name, _common(options), **options)


@study.command("stability")
@_studied
def stability_(name: str, **options: Any) -> int:
    """Map where each time-stepping scheme stays stable.

    \b
    Example:
      validate study stability kf_cube --quick
    """
    from validate.commands import study as studying

    return studying.stability_map(name, _common(options))


@study.command()
@external_simulators
@_studied
def tradeoff(name: str, simulators: tuple[str, ...], **options: Any) -> int:
    """Measure error against time per step of every solver.

    \b
    Example:
      validate study tradeoff kf_cube --quick
    """
    from validate.commands import study as studying

    return studying.tradeoff(name, _common(options), simulators)


@study.command()
@click.option(
    "--error", required=True, metavar="ERROR",
    help="Largest error; the unit selects the quantity: 0.5mm (displacement), 0.2N (force), 300Pa.",
)  # fmt: skip
@click.option("--rate", required=True, metavar="RATE", help="Lowest rate, as 1000Hz.")
@click.option("--declared-law", is_flag=True, help="Leave out the error of the linear law.")
@_studied
def choose(name: str, **options: Any) -> int:
    """Find the cheapest method that meets your error and rate.

    Exit code 1: none meets both; the nearest is named.

    \b
    Example:
      validate study choose kf_cube --quick --error 0.5mm --rate 100Hz
    """
    from validate.commands import study as studying

    return studying.choosing(name, _common(options), **options)


@study.command()
@click.option(
    "--draws", type=int, help="Number of simulated recordings (default: 200; 40 with --quick)."
)
@click.option(
    "--noise",
    type=float,
    default=1.0,
    show_default=True,
    metavar="TIMES",
    help="Ratio of real to declared noise.",
)
@click.option("--set", "values", multiple=True, metavar="PATH=VALUE", help="Change a parameter.")
@_studied
def coverage(name: str, **options: Any) -> int:
    """Measure how often verdicts on a known truth are right.

    \b
    Example:
      validate study coverage kf_cube --quick --draws 10
    """
    from validate.commands.study import covering

    return covering(name, _common(options), **options)


@cli.command()
@click.option(
    "--parameters",
    default="",
    metavar="A,B=LOW:HIGH",
    help="Parameters to identify (default: those without a value); give bounds of undeclared ones.",
)
@click.option(
    "--seeds", type=int, help="Number of starting points (default: 10; 5 for one parameter)."
)
@click.option("--set", "values", multiple=True, metavar="PATH=VALUE", help="Change a parameter.")
@_studied
def identify(name: str, **options: Any) -> int:
    """Identify parameters with intervals from the recording.

    Exit code 1: the recording does not identify them.

    \b
    Example:
      validate identify multimode --quick --seeds 2
    """
    from validate.commands import identify as identifying

    return identifying.identifying(name, _common(options), **options)


@cli.command("live")
@click.argument("name", metavar="NAME|FILE.py")
@EXPERIMENTS
@click.option("--set", "values", multiple=True, metavar="PATH=VALUE", help="Change a parameter.")
@click.option(
    "--method", default="", metavar="NAME", help="Method to run (default: the accepted one)."
)
@click.option("--seconds", type=float, help="Stop after this time (default: end of the path).")
@click.option(
    "--listen", type=click.IntRange(0, 65535), is_flag=False, flag_value=51200, metavar="[PORT]",
    help="Take positions from UDP on 127.0.0.1, not the recording (51200; 0: any free port).",
)  # fmt: skip
@click.option(
    "--realtime", is_flag=True, help="Use real-time priority (Linux, needs the permission)."
)
@output("Recording to write (default: NAME-live.mcap in reports/).", required=False)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON document only.")
def live_(name: str, **options: Any) -> int:
    """Run a model in real time, driven by a tool.

    \b
    Example:
      validate live needle_pocket --seconds 1
    """
    from validate.commands import live as living

    return living.run(name, **options)


for _command in (*COMMANDS, external):
    cli.add_command(_command)
