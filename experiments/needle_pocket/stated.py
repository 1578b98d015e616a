"""Numbers that sections 5.2 and 5.3 of paper 000 state about their machines, and its Fig. 10."""

from validate.compare.published import Figure
from validate.papers.stated import MACHINE, said, taken
from validate.solve.haptic import DEVICE_HZ

STATED = (
    taken("rate of the device", 512.0, float(DEVICE_HZ), "Hz", "section 5.2",
          "an input, taken as printed: a tick's deadline"),
    Figure(
        "largest deviation of the volume", "told:volume.largest", 0.001, None, "1",
        "not comparable", "a limit; the share of ticks above checks it", "section 5.2, Fig. 10",
    ),
    said("rate of the graphics", 30.0, "Hz", "section 5.2",
          "the loop draws nothing; a viewer draws replay.mcap"),
    said("clock of the device's machine", 2.0e9, "Hz", "section 5.2", MACHINE),
    said("clock of the machine that was timed", 2.4e9, "Hz", "section 5.3", MACHINE),
    said("Fig. 10a: the device in use", None, "1", "section 5.2, Fig. 10a", "a photograph"),
    said("Fig. 10b: pocket under tension", None, "1", "section 5.2, Fig. 10b",
          "a figure without numbers: ours is drawn under 'Compression and tension'"),
    said("Fig. 10c: pocket under compression", None, "1", "section 5.2, Fig. 10c",
          "a figure without numbers: ours is drawn under 'Compression and tension'"),
)  # fmt: skip
