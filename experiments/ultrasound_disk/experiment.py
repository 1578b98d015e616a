"""A disk of 20 mm in real B-mode images: outline, diameter and roundness, image by image.

Verasonics images made by others (creatis-ULTIM/PyMUST, LGPL-3). Nothing is fitted but the disk's
place. Other images of the kind: `--set recording=FILE --set disk.diameter=15mm`.
"""

from validate.compare.verdict import Accept
from validate.pipeline.experiment.experiment import Experiment, Uncertainty, vary
from validate.pipeline.experiment.method import Method
from validate.solve.static.without_mechanics import RigidMotion

from .disk import ImagedDisk, build, load, place
from .exhibits import exhibits, follows, identified

UNCERTAINTY = Uncertainty(
    inputs=(
        vary("image.scale", "relative ranges.scale", "scale",
              "lengths of the images", "assumed: the speed of sound within 1.7 % of the scanner's"),
        vary("disk.diameter", "absolute ranges.diameter", "nominal diameter",
              "diameter", "assumed; the data set gives none"),
    ),
    surrogate="rigid",
)  # fmt: skip

EXPERIMENT = Experiment(
    name="ultrasound_disk",
    needs="ultrasound-disk",
    title="Disk of 20 mm in B-mode images",
    source="creatis-ULTIM/PyMUST c605195 (LGPL-3)",
    settings=ImagedDisk(),
    methods={"rigid": Method("rigid disk of nominal diameter", RigidMotion())},
    accepted=("rigid",),
    accept=(
        Accept("diameter", 1e-3, "a twentieth of the diameter, rms over images", statistic="rms"),
    ),
    load=load,
    build=build,
    place=place,
    identify=identified,
    uncertainty=UNCERTAINTY,
    exhibits=exhibits,
    follows=follows,
    locates=("recording", "image.m_per_px", "image.rate", "image.topic"),
)
