"""Pictures as files and as data URIs: PNG in the folder, the smaller WebP in the page."""

import base64
from io import BytesIO

from PIL import Image

from validate.report.page import Picture


def png(picture: Picture) -> bytes:
    """An optimised PNG; line art in 256 colours, which it does not exceed visibly."""
    image = Image.fromarray(picture.pixels)
    if not picture.photo:
        image = image.quantize(256, dither=Image.Dither.NONE)
    out = BytesIO()
    image.save(out, "PNG", optimize=True)
    return out.getvalue()


def data_uri(picture: Picture) -> str:
    """The picture as a WebP data URI: lossless for line art."""
    out = BytesIO()
    image = Image.fromarray(picture.pixels)
    if picture.photo:
        image.save(out, "WEBP", quality=86, method=4)
    else:
        image.save(out, "WEBP", lossless=True, quality=60, method=4)
    return "data:image/webp;base64," + base64.b64encode(out.getvalue()).decode("ascii")
