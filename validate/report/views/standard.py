"""Standard views of every run, with their names in `validate show` and `.plot`.

VIEWS.add(View("late_error", "Error at the last markers", {"part": "score"}, x="method", by="name"))
"""

from validate.compare.view import View
from validate.errors import UsageError
from validate.parameters import nearest_names
from validate.plugins import Registry, kind_fault

_CHECKS = View(
    "checks", "Checks", {"part": ("check", "check.*", "!check.size.*")},
    x=("label", "name"), by="part",
    columns={
        "acceptance": "check:acceptance", "validation": "check:validation", "E": "check",
        "2 u_val": "check:expanded", "limit": "check.limit", "margin": "check.margin",
        "raw rms": "check.raw", "noise rms": "check.noise", "u_D": "check.u_D",
        "u_num": "check.u_num", "u_input": "check.u_input", "values": "check:n",
        "limit from": "check.limit:note", "why": "check:note",
    },
    below="why", folded=True,
    caption="E = simulation minus measurement. max: the point with the largest |E| + 2 u_val; rms: "
    "the rms error, noise removed (0: below noise). u_val² = u_D² (measurement) + u_num² (mesh, "
    "step) + u_input² (declared ranges, and a filter's claimed error), standard uncertainties. "
    "Acceptance: E ± 2 u_val against the limit; good enough inside, not good enough outside, "
    "undecided where it straddles. Validation: differs where E ± 2 u_val excludes zero; of many "
    "points, where one lies beyond the largest noise expected among so many. Margin: "
    "limit minus (|E| + 2 u_val). Fitted (data used for identification) and same model (recording "
    "made by the model) are not evidence.",
)  # fmt: skip
_LIMITS = View(
    "limits", "Every check against its limit", {"part": "check"}, "intervals",
    x=("label", "name"),
)  # fmt: skip
_COST = View(
    "methods", "How each method ended, and its cost",
    {"part": ("outcome", "chosen", "rate", "score"),
     "quantity": ("outcome", "rate", "setup", "step", "updates"), "condition": ""},
    x=("label", "method"), by=("part", "quantity", "statistic"),
    columns={"role": "outcome outcome:role", "ended": "outcome outcome:note",
             "chosen": "chosen outcome:note", "rate": "rate rate",
             "p99 of a step": "score step p99", "updates": "score updates max",
             "set-up": "score setup"},
    caption="Rate: 1 over the median time of one step; set-up: done once (mesh, assembly, "
    "factorisation). Times hold for this machine.",
)  # fmt: skip
_ERRORS = View(
    "errors", "Errors against the recording, at the last load or over the whole time",
    {"part": "score", "condition": "?*", "statistic": ("rms", "value")},
    x="label", by=("quantity", "statistic"), several="last",
)  # fmt: skip
_TRUTH = View(
    "errors_of_truth", "Errors against the truth over the whole time",
    {"part": "score", "condition": "", "quantity": ("!setup", "!step", "!updates"),
     "statistic": ("mae", "rmse", "sd", "max", "nrmse")},
    x=("label", "quantity"), by="statistic", also=("n", "against"),
    caption="sd: sample standard deviation (ddof 1) of the absolute error. nrmse: rmse over the "
    "range of the reference.",
)  # fmt: skip
_SPEEDS = View(
    "speeds", "Time steps and real time", {"part": "speed"}, x="label", by="quantity",
    caption="One thread of this machine. Real-time factor: recorded over computing time. Cost: "
    "computing time over that of the experiment's reference method. dt: a step of the integration.",
)  # fmt: skip
_WHOLE = View(
    "scores", "Scores over the whole run, every method",
    {"part": "score", "condition": "", "quantity": ("!setup", "!step", "!updates")},
    x=("quantity", "statistic"), by="method", also=("n",),
)  # fmt: skip
_BY_LOAD = View(
    "scores_by_load", "Scores by load or time", {"part": "score", "condition": "?*"},
    x=("quantity", "statistic"), by="condition", each="label", also=("n",), folded=True,
)  # fmt: skip
_PRINTED = {
    "ours": "published", "expected": "published.expected", "theirs": "published.theirs",
    "tolerance": "published.tolerance", "verdict": "published:note",
    "reason": "published.reason:note", "source": "published:against",
}  # fmt: skip
_PUBLISHED = View(
    "published", "Published results, and ours",
    {"part": "published*", "role": "result"},
    x="quantity", by="part", columns=_PRINTED,
)  # fmt: skip
_SETTINGS = View(
    "settings", "Settings, sketches and citations of the source",
    {"part": "published*", "role": "setting"}, x="quantity", by="part", columns=_PRINTED,
    caption="They are not results and are not counted as figures.", folded=True,
)  # fmt: skip
_IDENTIFIED = View(
    "identified", "Identified from the recordings",
    {"part": ("identified", "identified.*")}, x="name", by="part",
    columns={"value": "identified", "u": "identified:sd", "95 % from": "identified.low",
             "to": "identified.high", "u, *": "identified.u.*", "values": "identified:n",
             "how": "identified:note", "against": "identified:against"},
    below="how",
    caption="u: standard uncertainty, its terms beside it.",
)  # fmt: skip
_REST = View(
    "rest", "Errors of registration and geometry at rest", {"part": "rest"},
    x="name", y=("value", "sd"), also=("n",), caption="rms of lengths; sd: noise of one component, "
    "of a length of two components sqrt(2) times as much.",
)  # fmt: skip
_EFFECTS = View(
    "effects", "Separation of each effect in each recorded quantity",
    {"part": "effect", "statistic": "separation", "role": "measured"},
    x=("variation", "note"), by="quantity", several="largest",
    caption="At the load where it is largest: the rms change over the uncertainty of the mean (no "
    "unit). Above 2 the recording shows the effect.",
)  # fmt: skip
_BUDGET = View(
    "budget", "Error budget: rms change by each effect, at the last load or over the whole time",
    {"part": "effect", "statistic": "rms"}, x=("variation", "note"), by="quantity", several="last",
)  # fmt: skip
_CURVES = View(
    "curve", "Measured and simulated over the drive", {"part": "sample", "role": "!drives"},
    "lines", x="drives", by=("label", "recording"), each="quantity",
    y=("value", "sd"), caption="Points: every sample. Shaded: ± 2 standard deviations.",
)  # fmt: skip
_DIFFERENCES = View(
    "difference", "Simulated minus measured over the drive", {"part": "sample", "role": "!drives"},
    "lines", x="drives", by=("label", "recording"), each="quantity",
    y=("value", "sd"), less="measured", caption="Shaded: ± 2 standard deviations of one sample.",
)  # fmt: skip
_TRACES = View(
    "traces", "What each method computed over time", {"part": "trace"}, "lines", x="at",
    by=("label", "recording"), each="quantity",
)  # fmt: skip

STANDARD = (
    _CHECKS, _LIMITS, _COST, _SPEEDS, _ERRORS, _TRUTH, _WHOLE, _BY_LOAD, _PUBLISHED, _SETTINGS,
    _IDENTIFIED, _REST, _EFFECTS, _BUDGET, _CURVES, _DIFFERENCES, _TRACES,
)  # fmt: skip
VIEWS: Registry[View] = Registry(
    "views", STANDARD, lambda view: view.name, lambda part: kind_fault(part, View)
)


def view_of(name: str) -> View:
    """Return the view of that name; raises `UsageError` where there is none."""
    known = {view.name: view for view in VIEWS}
    if name not in known:
        raise UsageError(f"no view '{name}'; {nearest_names(name, set(known))}")
    return known[name]
