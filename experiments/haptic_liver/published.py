"""Figures of paper 003, section 3.5."""

from validate.compare.published import Figure

from .exhibits import JUDGED

FIGURES = (
    Figure(
        "peak error of the extrapolated force over the largest", f"told:peak.{JUDGED}", None, None,
        "1", "not comparable",
        "printed in words ('reliable haptic feedback'), and without the rule: ours is linear, of a "
        "simulation at 100 Hz", "section 3.5",
    ),
    Figure(
        "least energy taken by the extrapolated force", f"told:least.{JUDGED}", None, None, "J",
        "not comparable", "the paper counts no energy; below 0 is not passive", "section 3.5",
    ),
    Figure(
        "reaction force (eq 32)", None, None, None, "N", "not comparable",
        "no force is printed; ours is the spring's between tool and body, which balances eq "
        "32's force on the touched nodes, except for their inertia", "section 3.5",
    ),
    Figure(
        "Fig. 6: the liver before and under the tool", None, None, None, "1", "not comparable",
        "figures without numbers: ours is drawn under 'Force between answers'",
        "section 3.5, Fig. 6",
    ),
)  # fmt: skip
