"""`validate outline`: found, followed, doubted and brought outlines, as a user commands them."""

import csv
import json
import re
from pathlib import Path

import nrrd
import numpy as np
import pytest
from command_line import here, refused
from scipy.ndimage import gaussian_filter

from validate.arrays import Floats
from validate.errors import RecordingError, UsageError
from validate.recording.images.image import encode_png
from validate.recording.mcap.read import read_recording
from validate.recording.mcap.write import write_recording
from validate.recording.outlines import third_party_outlines
from validate.recording.outlines.outline import EXPERTS, extract_outline
from validate.recording.types import Frames, Recording, Source

pytestmark = pytest.mark.usefixtures("decoded_here")

# private: _read, _shape: called alone, case by case.

SIDE = 0.2e-3  # m of a pixel
SHAPE = (110, 150)
CENTRE, RADIUS = np.array([58.0, 55.0]), 26.0  # px


def speckled(rng: np.random.Generator, *discs: tuple[float, float, float]) -> np.ndarray:
    """Log-compressed speckle (h, w) uint8 with dark discs (x, y, radius) px."""
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]]
    real, imaginary = (gaussian_filter(rng.normal(size=SHAPE), 1.1) for _ in range(2))
    envelope = np.hypot(real, imaginary)
    for a, b, r in discs:
        envelope = np.where(np.hypot(x - a, y - b) < r, 0.03 * envelope, envelope)
    return np.clip(200 + 100 * np.log10(envelope / envelope.mean() + 1e-3), 0, 255).astype(np.uint8)


def recorded(path: Path, *images: np.ndarray) -> Path:
    frames = Frames(np.arange(len(images)) / 10, images, (SIDE, SIDE), np.eye(4), "image")
    write_recording(Recording("x", Source("x", "", 0, ""), 0, frames={"images": frames}), path)
    return path


@pytest.fixture(scope="module")
def moving(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A disc that moves by 3 px an image."""
    rng = np.random.default_rng(0)
    images = [speckled(rng, (CENTRE[0] + 3 * i, CENTRE[1], RADIUS)) for i in range(3)]
    return recorded(tmp_path_factory.mktemp("moving") / "a.mcap", *images)


@pytest.fixture(scope="module")
def two(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A disc, and one as dark that is a little smaller."""
    image = speckled(np.random.default_rng(1), (45, 55, 24), (110, 55, 21))
    return recorded(tmp_path_factory.mktemp("two") / "b.mcap", image)


def radii(outline: Floats, centre: Floats) -> Floats:
    return np.asarray(np.linalg.norm(outline / SIDE - centre, axis=1))


@pytest.mark.usefixtures("drawn_figures")
def test_an_outline_is_followed_into_the_recording_itself(moving: Path) -> None:
    code, out, err = here("outline", str(moving))
    assert (code, err.count("confidence")) == (0, 0)
    assert "outline (3 outlines)" in out
    found = read_recording(moving)
    contours = found.contour("outline")
    assert contours.images == "images"
    assert set(found.streams) == {"images", "outline"}
    for i, outline in enumerate(contours.outlines):
        away = radii(outline, CENTRE + [3 * i, 0]) - RADIUS
        assert abs(away.mean()) < 0.8
        assert np.sqrt((away**2).mean()) * SIDE < contours.sd
    assert contours.each is not None
    assert contours.each[:, 1] == pytest.approx(1.0, abs=0.1)
    assert np.sqrt((contours.each[:, 0] ** 2).mean()) == pytest.approx(contours.sd)
    assert len(set(contours.each[:, 0])) == 3  # each image's own
    assert found.record("found/outline")["rivals"] == "none"
    assert moving.with_name("a-outline.png").stat().st_size > 20_000


def test_a_picture_that_cannot_be_written_is_refused(moving: Path, tmp_path: Path) -> None:
    (tmp_path / "c-outline.png").mkdir()
    code, _, err = here("outline", str(moving), "-o", str(tmp_path / "c.mcap"))
    assert code == 2
    assert "c-outline.png: cannot be written" in err


@pytest.mark.slow
def test_an_outline_that_was_found_before_is_made_anew(moving: Path) -> None:
    for _ in range(2):
        assert here("outline", str(moving))[0] == 0
    assert set(read_recording(moving).streams) == {"images", "outline"}


@pytest.mark.slow
def test_the_sd_says_that_it_is_widened_to_distances_from_experts_lines(
    moving: Path, tmp_path: Path
) -> None:
    code, out, _ = here("outline", str(moving), "-o", str(tmp_path / "c.mcap"), "--name", "other")
    assert code == 0
    assert f"{EXPERTS:.2f} times that of the wall on twins" in out
    assert pytest.approx(5 / 3) == EXPERTS
    found = read_recording(tmp_path / "c.mcap")
    each = found.contour("other").each
    assert each is not None
    frames = found.frame("images")
    wall = extract_outline(frames.images[0], frames.m_per_px).sd
    assert each[0, 0] == pytest.approx(EXPERTS * wall)


def test_a_rival_is_named_and_lowers_the_confidence(two: Path, tmp_path: Path) -> None:
    code, out, err = here("outline", str(two), "-o", str(tmp_path / "c.mcap"))
    assert code == 0
    assert "1 other regions are as distinct as the outline: (22." in err
    assert "to choose one, give --centre X,Y" in err
    assert "confidence falls to 0.5" in err
    assert "confidence: 0.5" in out


def test_what_is_meant_is_said(two: Path, tmp_path: Path) -> None:
    where = ("--centre", "110px,11mm", "--radius", "20px")
    code, _, err = here("outline", str(two), "-o", str(tmp_path / "c.mcap"), *where)
    assert (code, err) == (0, "")
    found = read_recording(tmp_path / "c.mcap")
    (outline,) = found.contour("outline").outlines
    assert found.record("found/outline")["rivals"] == "none"
    assert found.record("found/outline")["near the given centre"].startswith("(9.")
    assert radii(outline, np.array([110, 55])).mean() == pytest.approx(21, abs=0.5)


@pytest.mark.slow
def test_a_rival_that_leaves_too_little_confidence_refuses(two: Path, tmp_path: Path) -> None:
    out = tmp_path / "c.mcap"
    told = refused("outline", str(two), "-o", str(out), "--confidence", "0.9")
    assert "but 0.9 is needed, as other regions are as distinct: (22." in told
    assert "(--centre X,Y) or accept it (--confidence 0.56)" in told
    assert not out.exists()
    assert here("outline", str(two), "-o", str(out), "--confidence", "0.56")[0] == 0


@pytest.mark.slow
def test_an_image_without_an_outline_is_left_out_and_said(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    disc = (*CENTRE, RADIUS)
    path = recorded(tmp_path / "a.mcap", *(speckled(rng, *d) for d in ((disc,), (), (disc,))))
    code, out, err = here("outline", str(path))
    assert code == 0
    assert "1 images have no outline and are left out, first 1: no closed dark region" in err
    assert "left out: 1" in out
    assert read_recording(path).contour("outline").t == pytest.approx([0.0, 0.2])
    empty = recorded(tmp_path / "b.mcap", speckled(rng), speckled(rng))
    assert "2 of 2 images without an outline, first image 0" in refused("outline", str(empty))


def mask() -> np.ndarray:
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]]
    return np.where(np.hypot(x - CENTRE[0], y - CENTRE[1]) <= RADIUS, 255, 0).astype(np.uint8)


ANGLES = np.deg2rad(np.arange(0, 360, 5))
CIRCLE = CENTRE + RADIUS * np.stack([np.cos(ANGLES), np.sin(ANGLES)], axis=1)


def drawn(folder: Path, kind: str) -> Path:
    path = folder / f"drawn.{kind.removeprefix('coco.')}"
    match kind:
        case "png":
            path.write_bytes(encode_png(mask()))
        case "npy":
            np.save(path, mask()[None] > 0)
        case "npz":
            np.savez(path, masks=mask())
        case "nrrd":
            nrrd.write(str(path), np.ascontiguousarray(mask()[None].T > 0).astype(np.uint8))
        case "csv":
            with path.open("w", newline="") as file:
                rows = csv.writer(file)
                rows.writerow(["Frame", "X", "Y"])
                rows.writerows([0, *p] for p in CIRCLE.tolist())
        case "json":
            shape = {"label": "gel", "shape_type": "polygon", "points": CIRCLE.tolist()}
            path.write_text(json.dumps({"shapes": [shape]}))
        case "coco.json":
            note = {"image_id": 7, "segmentation": [CIRCLE.ravel().tolist()]}
            image = {"id": 7, "file_name": "0.png"}
            path.write_text(json.dumps({"images": [image], "annotations": [note]}))
    return path


@pytest.mark.parametrize(
    "kind",
    ["png", "csv", "json"]
    + [pytest.param(k, marks=pytest.mark.slow) for k in ("npy", "npz", "nrrd", "coco.json")],
)
def test_outlines_of_others_come_in(kind: str, two: Path, tmp_path: Path) -> None:
    """A mask's edge runs half a pixel outside its outermost pixels, at the circle that cut it."""
    out, file = tmp_path / "c.mcap", drawn(tmp_path, kind)
    arguments = ("outline", str(two), "--from", str(file), "--name", "theirs", "-o", str(out))
    assert (
        "does not contain the uncertainty of its outlines along their normal; give it, as --sd "
        "0.3mm or 2px" in refused(*arguments)
    )
    assert here(*arguments, "--sd", "2px")[0] == 0
    contours = read_recording(out).contour("theirs")
    assert contours.sd == pytest.approx(2 * SIDE)
    away = radii(contours.outlines[0], CENTRE) - RADIUS
    assert abs(away.mean()) < 0.15
    assert np.abs(away).max() < 0.6


def test_coco_images_are_in_the_order_of_their_files(moving: Path, tmp_path: Path) -> None:
    """Not in that of the list; a second polygon in an image is refused, a file too few as well."""
    images = [{"id": i, "file_name": f"{i:03}.png"} for i in (2, 0, 1)]
    notes = [{"image_id": i, "segmentation": [(CIRCLE + [3 * i, 0]).ravel().tolist()]}
             for i in range(3)]  # fmt: skip
    file, out = tmp_path / "drawn.json", tmp_path / "c.mcap"
    given = ("outline", str(moving), "--from", str(file), "--sd", "1px", "--name", "theirs",
             "-o", str(out), "--force")  # fmt: skip
    file.write_text(json.dumps({"images": images, "annotations": notes}))
    assert here(*given)[0] == 0
    for i, outline in enumerate(read_recording(out).contour("theirs").outlines):
        assert radii(outline, CENTRE + [3 * i, 0]) == pytest.approx(RADIUS)
    notes[0]["segmentation"] *= 2
    file.write_text(json.dumps({"images": images, "annotations": notes}))
    assert "several polygons in one image" in refused(*given)
    file.write_text(json.dumps({"images": images[:2], "annotations": notes[1:2]}))
    assert "2 images for 3 images do not show which belongs to which image" in refused(*given)


def test_masks_of_a_folder_are_one_an_image(moving: Path, tmp_path: Path) -> None:
    folder, out = tmp_path / "masks", tmp_path / "c.mcap"
    folder.mkdir()
    for i in (2, 10, 1):  # in the order of numbers, not of letters
        (folder / f"{i}.png").write_bytes(encode_png(np.roll(mask() * (i != 2), i, axis=1)))
    given = ("outline", str(moving), "--from", str(folder), "--sd", "1px", "--name", "theirs",
             "-o", str(out), "--force")  # fmt: skip
    assert here(*given)[0] == 0
    found = read_recording(out).contour("theirs")
    assert found.t == pytest.approx([0.0, 0.2])
    assert (found.outlines[1] / SIDE).mean(axis=0) == pytest.approx(CENTRE + [10, 0], abs=0.2)
    (folder / "2.png").unlink()
    assert "2 masks for 3 images do not show which belongs to which image" in refused(*given)


def segmented(path: Path) -> Path:
    """A small region (2) before the large one (5), as 3D Slicer names them."""
    both = np.where(mask() > 0, 5, 0).astype(np.uint8)
    both[4:12, 4:12] = 2
    own = {"Segment0_Name": "skin", "Segment0_LabelValue": "2",
           "Segment1_Name": "cyst", "Segment1_LabelValue": "5"}  # fmt: skip
    nrrd.write(str(path), np.ascontiguousarray(both[None].T), own)
    return path


@pytest.mark.parametrize("label", ["cyst", "5"])
def test_one_of_several_regions_is_said(label: str, two: Path, tmp_path: Path) -> None:
    """Of a segmentation: not zero was inside, so that a region in another was lost unsaid."""
    out = tmp_path / "c.mcap"
    given = ("outline", str(two), "--from", str(segmented(tmp_path / "x.seg.nrrd")), "--sd", "1px",
             "--name", "theirs", "-o", str(out))  # fmt: skip
    assert "2 regions, skin (2), cyst (5): choose one, as --label skin" in refused(*given)
    assert "--label bone: not in x.seg.nrrd; there are skin (2)" in refused(
        *given, "--label", "bone"
    )
    assert here(*given, "--label", label)[0] == 0
    away = radii(read_recording(out).contour("theirs").outlines[0], CENTRE) - RADIUS
    assert np.abs(away).max() < 0.6
    assert read_recording(out).record("found/theirs")["label"] == label
    assert "--label is for third-party outlines" in refused("outline", str(two), "--label", "cyst")


@pytest.mark.parametrize("coco", [True, False])
def test_one_of_several_labels_of_polygons_is_said(coco: bool, two: Path, tmp_path: Path) -> None:
    file, out = tmp_path / "x.json", tmp_path / "c.mcap"
    polygons = {"skin": CIRCLE / 4, "cyst": CIRCLE}
    if coco:
        notes = [{"image_id": 0, "category_id": i, "segmentation": [p.ravel().tolist()]}
                 for i, p in enumerate(polygons.values())]  # fmt: skip
        names = [{"id": i, "name": name} for i, name in enumerate(polygons)]
        images = [{"id": 0, "file_name": "0.png"}]
        told = {"images": images, "annotations": notes, "categories": names}
    else:
        told = {"shapes": [{"label": n, "points": p.tolist()} for n, p in polygons.items()]}
    file.write_text(json.dumps(told))
    given = ("outline", str(two), "--from", str(file), "--sd", "1px", "--name", "theirs",
             "-o", str(out))  # fmt: skip
    assert "2 regions, skin, cyst: choose one, as --label skin" in refused(*given)
    assert here(*given, "--label", "cyst")[0] == 0
    assert radii(read_recording(out).contour("theirs").outlines[0], CENTRE) == pytest.approx(RADIUS)


def test_a_picture_is_no_mask(two: Path, tmp_path: Path) -> None:
    levels = np.arange(mask().size).reshape(mask().shape) % 200
    (tmp_path / "x.png").write_bytes(encode_png(levels.astype(np.uint8)))
    given = ("outline", str(two), "--from", str(tmp_path / "x.png"), "--sd", "1px", "--name", "t")
    assert "199 values, not a mask of regions" in refused(*given, "-o", str(tmp_path / "c.mcap"))


def test_what_is_no_outline_is_one_line(two: Path, moving: Path, tmp_path: Path) -> None:
    both = mask()
    both[:, 57:60] = 0
    (tmp_path / "two.png").write_bytes(encode_png(both))
    (tmp_path / "small.png").write_bytes(encode_png(mask()[:50]))
    (tmp_path / "late.csv").write_text("frame,x,y\n9,1,1\n9,2,1\n9,2,2\n")
    (tmp_path / "bad.csv").write_text("frame,x,y\n0,1,one\n")
    (tmp_path / "bad.json").write_text("{")
    for name, why in (
        ("two.png", "2 closed lines, expected one region"),
        ("small.png", "mask 0 is (50, 150), its image (110, 150)"),
        ("late.csv", "outlines of 1 images, image 9 among them; 'images' has the images 0 to 0"),
        ("bad.csv", "are not numbers"),
        ("bad.json", "neither LabelMe nor COCO polygons"),
        ("none.png", "cannot be read"),
        ("x.doc", "outlines come as .png"),
    ):
        told = refused("outline", str(two), "--from", str(tmp_path / name), "--sd", "1px")
        assert why in told, name
    assert "expected a length with its unit" in refused("outline", str(moving), "--centre", "3,4")
    assert "already has a stream 'images'" in refused("outline", str(moving), "--name", "images")


def test_images_of_several_sizes_are_streams_of_their_own(tmp_path: Path) -> None:
    (tmp_path / "s").mkdir()
    for i, image in enumerate([np.zeros((20, 30), np.uint8), np.zeros((24, 32), np.uint8)] * 2):
        (tmp_path / "s" / f"{i}.png").write_bytes(encode_png(image))
    out = tmp_path / "a.mcap"
    assert here("import", str(tmp_path / "s"), "--m-per-px", "0.1mm", "--rate", "10",
                "-o", str(out))[0] == 0  # fmt: skip
    found = read_recording(out)
    assert {k: list(f.t) for k, f in found.frames.items()} == {
        "images_30x20": [0.0, 0.2],
        "images_32x24": [0.1, 0.3],
    }
    assert "choose one: --topic NAME" in refused("outline", str(out))


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda d: (d / "a.csv", "frame,x\n0,1\n"), "a.csv: columns ['frame', 'x'], expected"),
        (lambda d: (d / "a.npy", "none"), "a.npy: no array of masks ("),
        (lambda d: (d / "a.npz", {"a": np.zeros((2, 2)), "b": np.zeros(1)}), "arrays ['a', 'b']"),
        (lambda d: (d / "a.npz", {"a": np.zeros(4)}), "(4,), expected masks (n, h, w) or (h, w)"),
        (lambda d: (d / "a.nrrd", np.zeros((4, 5))), "a.nrrd: (4, 5) float64, expected masks"),
    ],
)
def test_files_without_masks_are_refused(
    make: object, says: str, moving: Path, tmp_path: Path
) -> None:
    file, content = make(tmp_path)  # type: ignore[operator]
    if isinstance(content, str):
        file.write_text(content)
    elif isinstance(content, dict):
        np.savez(file, **content)
    else:
        nrrd.write(str(file), content)
    with pytest.raises(RecordingError, match=re.escape(says)):
        third_party_outlines._read(file, read_recording(moving).frame("images"), "")


def test_a_label_a_limit_and_a_unit_that_do_not_fit_are_refused(
    moving: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    frames = read_recording(moving).frame("images")
    (tmp_path / "a.csv").write_text("frame,x,y\n")
    with pytest.raises(UsageError, match=r"--label cyst: a.csv has no labels"):
        third_party_outlines._read(tmp_path / "a.csv", frames, "cyst")
    (tmp_path / "a.csv").write_text("frame,x,y\n0,0,0\n0,4,0\n0,0,4\n")
    with pytest.raises(UsageError, match=r"unit kg of a.csv: expected px"):
        third_party_outlines.foreign_outlines(tmp_path / "a.csv", frames, "images", 1e-4, "kg")
    drawn = third_party_outlines.foreign_outlines(
        tmp_path / "a.csv", frames, "images", 1e-4, "mm"
    ).outlines[0]
    assert drawn.max() == pytest.approx(4e-3, rel=1e-12)
    masks = np.zeros((3, *frames.images[0].shape), dtype=np.uint8)
    masks[:, 10:20, 10:20] = 1
    np.save(tmp_path / "a.npy", masks)
    masked = third_party_outlines.foreign_outlines(
        tmp_path / "a.npy", frames, "images", 1e-4, "mm"
    ).outlines[0]
    assert np.ptp(masked, axis=0) == pytest.approx([10 * SIDE, 10 * SIDE], rel=1e-12)
    monkeypatch.setattr(third_party_outlines, "MAX_FILE", 5)
    with pytest.raises(RecordingError, match=r"a.csv: 28 bytes, limit 5"):
        third_party_outlines._read(tmp_path / "a.csv", frames, "")
    shapes = {"shapes": [{"label": "a", "points": []}, {"label": "a", "points": []}]}
    with pytest.raises(RecordingError, match=r"a.json: 2 polygons"):
        third_party_outlines._shape(tmp_path / "a.json", shapes, "a")
