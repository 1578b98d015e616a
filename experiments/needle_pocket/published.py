"""Figures of paper 000, sections 5.2 and 5.3: results, settings, machines, Fig. 10."""

from validate.compare.published import Figure

from .hand import DEVICE_HZ

STATED = (
    Figure.of_setup("rate of the device", 512.0, float(DEVICE_HZ), "Hz", "section 5.2",
                    "an input, taken as printed: a tick's deadline"),
    Figure(
        "largest deviation of the volume", "told:volume.largest", 0.001, None, "1",
        "not comparable", "a limit; the share of ticks above checks it", "section 5.2, Fig. 10",
    ),
    Figure.uncompared("rate of the graphics", 30.0, "Hz", "section 5.2",
                      "the loop draws nothing; a viewer draws replay.mcap"),
    Figure.uncompared("clock of the device's machine", 2.0e9, "Hz", "section 5.2", Figure.MACHINE),
    Figure.uncompared("clock of the machine that was timed", 2.4e9, "Hz", "section 5.3",
                      Figure.MACHINE),
    Figure.uncompared("Fig. 10a: the device in use", None, "1", "section 5.2, Fig. 10a",
                      "a photograph"),
    Figure.uncompared("Fig. 10b: pocket under tension", None, "1", "section 5.2, Fig. 10b",
                      "a figure without numbers: ours is drawn under 'Compression and tension'"),
    Figure.uncompared("Fig. 10c: pocket under compression", None, "1", "section 5.2, Fig. 10c",
                      "a figure without numbers: ours is drawn under 'Compression and tension'"),
)  # fmt: skip

_ASSUMED = "pocket, needle's speed and boundary are not printed: ours"
FIGURES = (
    Figure(
        "share of ticks that keep the volume within .1 %", "told:volume.kept", 1.0, 0.0, "1",
        "reproduced", f"the law stops there; {_ASSUMED}", "section 5.2, Fig. 10",
    ),
    Figure(
        "updates in a tick, at most", "told:updates.most", 1.0, 0.0, "1", "reproduced",
        f"begun at the last tick's pressure; {_ASSUMED}", "section 5.2",
    ),
    Figure(
        "the median tick within 1/512 s (1: yes)", "told:median.paper", 1.0, 0.0, "1",
        "reproduced",
        "on a current machine; `validate live needle_pocket` measures it in real time",
        "section 5.2",
    ),
    Figure(
        "rate of the 82-node system", None, 3000.0, None, "1/s", "not comparable",
        "measured by benchmarks/fluid_loop.py on the paper's system and a current machine",
        "section 5.3",
    ),
)  # fmt: skip
