"""Polygons that others drew: of which images, and what is none, as a user brings them."""

import json
from pathlib import Path

import numpy as np
from command_line import here, refused
from test_outlining import CIRCLE, SHAPE, recorded


def asked(folder: Path, count: int) -> tuple[str, ...]:
    """The command up to its file, on so many images."""
    file = recorded(folder / "a.mcap", *[np.zeros(SHAPE, np.uint8)] * count)
    return ("outline", str(file), "--sd", "1px", "--name", "t", "-o", str(folder / "c.mcap"))


def labelme(folder: Path, size: tuple[int, int], *shapes: str) -> Path:
    """A file of LabelMe, of an image `size` px, with the disc as each of these shapes."""
    file = folder / "labelme.json"
    drawn = [{"label": "gel", "shape_type": s, "points": CIRCLE.tolist()} for s in shapes]
    told = {"shapes": drawn, "imageWidth": size[0], "imageHeight": size[1]}
    file.write_text(json.dumps(told))
    return file


def test_polygons_of_images_of_another_size_are_refused(tmp_path: Path) -> None:
    """They came in at half the size, silently."""
    given = asked(tmp_path, 1)
    h, w = SHAPE
    half = labelme(tmp_path, (w // 2, h // 2), "polygon")
    why = f"drawn in an image of {w // 2} x {h // 2} px, image 0 is {w} x {h}"
    assert why in refused(*given, "--from", str(half))
    images = [{"id": 0, "file_name": "0.png", "width": w // 2, "height": h // 2}]
    notes = [{"image_id": 0, "segmentation": [CIRCLE.ravel().tolist()]}]
    half.write_text(json.dumps({"images": images, "annotations": notes}))
    assert why in refused(*given, "--from", str(half))
    far = tmp_path / "far.csv"
    far.write_text("frame,x,y\n0,10,10\n0,900,10\n0,10,90\n")
    assert f"a point at (900, 10) px, the image is {w} x {h}" in refused(*given, "--from", str(far))
    assert here(*given, "--from", str(labelme(tmp_path, (w, h), "polygon")))[0] == 0


def test_shapes_that_are_no_polygons_are_named(tmp_path: Path) -> None:
    """A circle of LabelMe, and a mask of COCO, which was called several polygons."""
    given = asked(tmp_path, 1)
    h, w = SHAPE
    for shapes in (["circle"], ["polygon", "circle"]):
        file = labelme(tmp_path, (w, h), *shapes)
        assert "'gel' is drawn as circle, expected polygons" in refused(*given, "--from", str(file))
    rle = {"counts": [0, 10, 20], "size": [h, w]}
    note = {"image_id": 0, "category_id": 1, "segmentation": rle}
    told = {"images": [{"id": 0, "file_name": "0.png"}], "annotations": [note],
            "categories": [{"id": 1, "name": "gel"}]}  # fmt: skip
    file.write_text(json.dumps(told))
    assert "'gel' is drawn as masks (RLE), expected polygons" in refused(
        *given, "--from", str(file)
    )


def test_coco_images_without_numbers_leave_their_order_open(tmp_path: Path) -> None:
    images = [{"id": i, "file_name": f"{name}.png"} for i, name in enumerate("cab")]
    notes = [{"image_id": 0, "segmentation": [CIRCLE.ravel().tolist()]}]
    file = tmp_path / "drawn.json"
    file.write_text(json.dumps({"images": images, "annotations": notes}))
    told = refused(*asked(tmp_path, 3), "--from", str(file))
    assert "'c.png' and 'a.png' have the same number" in told
